"""What was set out to be reached, beside what runs have: a line each, judged by the whole interval.

The speed-ups were asked of a CPU with AVX-512 at 1280×720, and half of each of one with AVX2 alone (8 lanes);
"best" is the ladder's last rung, unless another is better by intervals that do not overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from study.core import registry, show
from study.experiments.accuracy import measure as accuracy
from study.experiments.drjit import measure as drjit_measure
from study.experiments.frames import measure as frames
from study.experiments.lattice import measure as lattice
from study.experiments.packets import measure as packets
from study.experiments.packets import tables as packets_page
from study.experiments.scaling import goals as scaling_goals
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import series as scaling_series
from study.experiments.section import reading
from study.experiments.sweep import ladder
from study.numbers import verdicts
from study.numbers.analysis import Data
from study.numbers.stats import Interval

HEIGHT = 720  # of the goals' pictures
WIDE = 16  # lanes from which the whole goal is asked
SPEEDUPS = {  # over a baseline of 15.7 s (scene0) and 16.7 s, as it is on the machine that they were set on
    "opt6_wide": {"scene0": 150.0, "mandelbulb": 27.0},
    "opt7_tiles": {"scene0": 320.0, "mandelbulb": 40.0},
    "opt8_streams": {"scene0": 530.0, "mandelbulb": 80.0},
    "best": {"scene0": 3000.0, "mandelbulb": 130.0},
}
TWO_THREADS = 1.9
RTRM = 14.0  # times CPU-RTRM's own figures
DIGITS = 0.05  # dB: what is shown equal is taken to be equal
Row = dict[str, Any]


class Goal(NamedTuple):
    """`asked` in the figure's unit; `found` with the same; `what` is the phase, `beside` its error."""

    name: str
    asked: float
    found: Interval
    verdict: str
    what: str = ""
    unit: str = "×"
    beside: str = ""
    at_most: bool = False
    narrow: bool = False  # half of `asked` was asked, see NOTE
    of_phase: str = ""  # `asked` is what this phase has in the same run
    scenes: int = 0  # drawn at random, that it is a mean over
    ours: bool = False  # the interval is of our side alone: the value decides
    over_baseline: bool = False


def _interval(row: Row, name: str, launches: str = "launches") -> Interval:
    ends = [math.nan if row.get(key) is None else row[key] for key in (name, f"{name}_low", f"{name}_high")]
    return Interval(*ends, launches=row.get(launches) or 0, sufficient=all(map(math.isfinite, ends)))


def _given(found: Row) -> Interval:
    """Of a file, where NaN is null."""
    return Interval(**{key: math.nan if value is None else value for key, value in found.items()})


def _exact(value: float) -> Interval:
    return Interval(value, value, value, 1, True)


def _error(row: Row) -> str:
    """Of a row of the ladder: PSNR to truth, a fractal's of 4×4 means."""
    found = row.get("truth_psnr_db")
    if found is None or math.isnan(found):
        return ""
    means = ", 4×4" if show.yes(row.get("truth_converged_only")) else ""
    return f"{show.number(found)} dB to truth{means}"


def _best(rows: Sequence[Row], name: str, value: Callable[[Row], Interval], least: bool = False) -> Row:
    """The last rung's row (`name`: the phase's key); another's only where it is better and told apart."""
    order = list(registry.ladder())
    last = max(rows, key=lambda r: order.index(r[name]) if r[name] in order else -1)
    held = value(last)
    if least:
        return min((r for r in rows if r is last or value(r).high < held.low), key=lambda r: value(r).value)
    return max((r for r in rows if r is last or value(r).low > held.high), key=lambda r: value(r).value)


def _speed(rows: Sequence[Row], rung: str, scene: str, asked: float) -> Iterable[Goal]:
    """The rung's speed-up over baseline; of "best" see _best."""
    mine = [r for r in rows if r["scene"] == scene and r["threads"] == 1 and math.isfinite(r["speedup"])]
    mine = [r for r in mine if r["phase"] == rung or (rung == "best" and r["phase"] in registry.ladder())]
    if not mine:
        return
    row = _best(mine, "phase", lambda r: _interval(r, "speedup"))
    narrow = (row["lanes"] or 0) < WIDE
    least, found = asked / 2 if narrow else asked, _interval(row, "speedup")
    beside = "; ".join(text for text in (_error(row), f"{show.number(row['ms'])} ms") if text)
    yield Goal(
        f"{rung} on {scene} over baseline, 1280×720, one thread", asked, found, verdicts.goal(found, least),
        row["phase"] if rung == "best" else "", beside=beside, narrow=narrow,
        over_baseline=True,
    )  # fmt: skip


def _two(rows: Sequence[Row], scene: str) -> Iterable[Goal]:
    """Two threads over one: opt5_threads, and the best."""
    mine = [r for r in rows if r["scene"] == scene and r["threads"] == 2]
    mine = [r for r in mine if math.isfinite(r["over_one_thread"])]
    own = [r for r in mine if r["phase"] == "opt5_threads"]
    for name, some in (("opt5_threads", own), ("best", mine)):
        if some:
            row = _best(some, "phase", lambda r: _interval(r, "ms"), least=True)
            found = _interval(row, "over_one_thread")
            verdict = verdicts.goal(found, TWO_THREADS)
            what = row["phase"] if name == "best" else ""
            yield Goal(f"{name} on {scene}, two threads over one", TWO_THREADS, found, verdict, what)


def of_ladder(data: Data) -> Iterable[Goal]:
    table = ladder.rows(data)
    rows = [] if table.empty else [r for r in table.to_dict("records") if r["height"] == HEIGHT]
    for rung, scenes in SPEEDUPS.items():
        for scene, asked in scenes.items():
            yield from _speed(rows, rung, scene, asked)
    for scene in ("scene0", "mandelbulb"):
        yield from _two(rows, scene)


def of_errors(data: Data) -> Iterable[Goal]:
    """Against truth, of the worst rung: scene0's colours and hits no further off than baseline's, the
    Mandelbulb's 4×4 means and depths no further than opt4's.
    """
    every = accuracy.read(data.path)["rows"]
    kinds: tuple[tuple[str, str, str, Callable[[Row], float]], ...] = (
        ("scene0", "baseline", "PSNR to truth", lambda r: r["psnr_db"]),
        ("scene0", "baseline", "PSNR to truth with ideal shadows", lambda r: r["psnr_ideal_db"]),
        ("scene0", "baseline", "wrong hits, ppm", _wrong),
        ("mandelbulb", "opt4", "PSNR of 4×4 means to truth", lambda r: r["antialiased"]["psnr_db"]),
        ("mandelbulb", "opt4", "depth other than truth's, ppm", _other_depth),
    )
    for scene, base, name, value in kinds:
        rows = [r for r in every if r["scene"] == scene and r["phase"] in _asked_with(base)]
        yield from _worst_rung(scene, base, name, {r["phase"]: value(r) for r in rows})


def of_pictures(data: Data) -> Iterable[Goal]:
    """The Mandelbulb's pictures against baseline's: 4×4 means and depths no further off than opt4's."""
    scene, base = "mandelbulb", "opt4"
    kinds: tuple[tuple[str, str, Callable[[Row], float]], ...] = (
        ("antialiased_psnr_db", "PSNR of 4×4 means to baseline", lambda p: p["antialiased_psnr_db"]),
        ("depth_agree_fraction", "depth other than baseline's, ppm", _other_depth),
    )
    for key, name, value in kinds:
        pairs = [p for p in data.pairs if (p["scene"], p["reference"]) == (scene, "baseline")]
        pairs = [p for p in pairs if p.get(key) is not None and p["phase"] in _asked_with(base)]
        yield from _worst_rung(scene, base, name, {p["phase"]: value(p) for p in pairs})


def _asked_with(base: str) -> list[str]:
    """The rungs beyond opt4, and what they are held against."""
    phases = list(registry.ladder())
    return [base, *phases[phases.index("opt4") + 1 :]]


def _worst_rung(scene: str, base: str, name: str, values: dict[str, float]) -> Iterable[Goal]:
    """Of phase → dB, or ppm of the pixels: the worst of the rungs against `base`; of equals the last."""
    mine = {p: values[p] for p in reversed(_asked_with(base)[1:]) if p in values}
    if not mine or math.isnan(values.get(base, math.nan)):
        return
    ppm, limit = name.endswith("ppm"), values[base]
    worst = max(mine, key=lambda p: (math.isnan(mine[p]), mine[p] if ppm else -mine[p]))
    good = mine[worst] <= limit if ppm else mine[worst] >= limit - DIGITS
    unit = "" if ppm else " dB"
    yield Goal(
        f"{scene}, {name}: no rung beyond opt4 behind {base}" + ("" if ppm else f", to {DIGITS:g} dB"),
        limit, _exact(mine[worst]), verdicts.MET if good else verdicts.MISSED, worst, unit,
        _apart(mine[worst], limit) or f"{base} {show.number(limit)}{unit}", at_most=ppm, of_phase=base,
    )  # fmt: skip


def _other_depth(row: Row) -> float:
    """In ppm, from the share of pixels that agree in depth (images.DEPTH_AGREES); NaN: not known."""
    share = row.get("depth_agree_fraction")
    return math.nan if share is None else 1e6 * (1 - share)


def _apart(value: float, limit: float) -> str:
    """Of a value below its limit that three digits show equal: a digit more than tells them apart."""
    if not value < limit or show.number(value) != show.number(limit):
        return ""
    digits = next((n for n in range(1, 12) if f"{value:.{n}f}" != f"{limit:.{n}f}"), 12) + 1
    return f"{value:.{digits}f} of {limit:.{digits}f}"


def _wrong(row: Row) -> float:
    return sum(row[name] for name in ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm"))


def of_frames(data: Data) -> Iterable[Goal]:
    result = frames.read(data.path / frames.FILE)
    rows, away = result["rows"], result.get("away", frames.AWAY_ONCE)
    for scene, hit in dict.fromkeys((r["scene"], r["hit"]) for r in rows):
        mine = [r for r in rows if (r["scene"], r["hit"]) == (scene, hit)]
        row = _best(mine, "phase", lambda r: _given(r["frames_per_s"]))
        found, by = (row["to_own"], " by the scene's own limits") if row["to_own"] else (row, "")
        error = f"{show.number(found['psnr_db'])} dB to {row['reference']}{by}" if found["psnr_db"] else ""
        yield Goal(
            f"frames a second, {scene} {row['width']}×{row['n']}, all cores, hit distance {hit}"
            + (f", secondary rays {away} of it off" if hit == frames.HALF else ""),
            row["goal"], _given(row["frames_per_s"]), row["verdict"], row["phase"], "", error,
        )  # fmt: skip


def of_drjit(data: Data) -> Iterable[Goal]:
    rows = drjit_measure.read(data.path / drjit_measure.FILE)["rows"]
    alone = [r for r in rows if r["threads"] == 1]
    theirs = {r["scene"]: r for r in alone if r["program"] == drjit_measure.DRJIT}
    asked = [r for r in alone if r["verdict"]]
    for scene in dict.fromkeys(r["scene"] for r in asked):
        mine = [r for r in asked if r["scene"] == scene]
        marching = [r for r in mine if not registry.is_exact(r["program"])]
        for some, which in ((mine, ""), (marching, ", the best that marches")):
            if some:
                row = _best(some, "program", lambda r: _given(r["ratio"]))
                name = f"{scene} over Dr.Jit, ours by the scene's own limits, one thread{which}"
                error = f"{show.number(row['psnr_db'])} dB to {row['reference']}{_limits(theirs.get(scene))}"
                yield Goal(
                    name, row["goal"], _given(row["ratio"]), row["verdict"], row["program"], "×", error
                )
        if scene in theirs:
            yield from _by_its_limits(alone, theirs[scene], mine[0]["goal"])


def _by_its_limits(rows: Sequence[Row], theirs: Row, asked: float) -> Iterable[Goal]:
    """Both by Dr.Jit's hit distance and steps, beside how far that is from the scene's own picture."""
    scene, limits = theirs["scene"], theirs["limits"]
    mine = [r for r in rows if (r["scene"], r["limits"]) == (scene, limits) and r is not theirs]
    if mine and all(r["to_own"] for r in (theirs, *mine)):
        row = _best(mine, "program", lambda r: _given(r["ratio"]))
        ours, other = (show.number(r["to_own"]["psnr_db"]) for r in (row, theirs))
        yield Goal(
            f"{scene} over Dr.Jit, both by its limits, {limits}, one thread", asked, _given(row["ratio"]),
            verdicts.goal(_given(row["ratio"]), asked), row["program"], "×",
            f"{ours} dB to {row['reference']} by the scene's own limits, Dr.Jit {other} dB",
        )  # fmt: skip


def _limits(row: Row | None) -> str:
    """Dr.Jit's own limits, and the error that they give it."""
    return f"; Dr.Jit by {row['limits']}: {show.number(row['psnr_db'])} dB" if row else ""


def of_growth(data: Data) -> Iterable[Goal]:
    found = scaling.read(data.path / scaling.FILE)
    full = scaling_goals.MANY, scaling_series.CROWD_HEIGHT
    rows = [r for r in found.get("goals", []) if r["ratio"] and (r["shapes"], r["n"]) == full]
    if rows:
        row = _best(rows, "phase", lambda r: _given(r["ratio"]), least=True)
        few, many = row.get("scenes") or (1, 1)  # runs of before there were more
        drawn = "mean over scenes" if few > 1 else "one scene of each"
        name = f"time of 4,096 scattered shapes over 16 at equal coverage, 1280×720, {drawn}"
        known = [show.number(c) for c in row["coverage"] if c is not None]
        covered = f"coverage {' and '.join(known)}" if known else "coverage not recorded in this run"
        if few > 1:
            covered = f"{few} and {many} scenes; coverage made to be {found['coverage_wanted']:g}"
            if row.get("by_medians") and row["by_medians"]["value"] is not None:
                covered += f"; by medians {show.spread(row['by_medians'], 3, '×')}"
            others = [r for r in rows if r["phase"] != row["phase"]]
            covered += "".join(f"; {r['phase']} {show.spread(r['ratio'], 3, '×')}" for r in others)
        yield Goal(
            name, scaling_goals.MOST_TIMES, _given(row["ratio"]), row["shapes_goal"], row["phase"],
            beside=covered, at_most=True, scenes=few if few > 1 else 0,
        )  # fmt: skip
    most = [r for r in found.get("goals", []) if r["above_frame_mib"] is not None]
    if most:
        row = max(most, key=lambda r: r["above_frame_mib"])
        threads = max(r["threads"] for r in found["memory"] if r["phase"] == row["phase"])
        name = f"memory above the frame at 3840×2160, MiB, {threads} threads"  # a worker adds its own
        mib = _exact(row["above_frame_mib"])
        limit = scaling_goals.MOST_MIB
        verdict = scaling_goals.memory_goal(found["memory"], row["phase"])
        yield Goal(name, limit, mib, verdict, row["phase"], "", at_most=True)


def of_packets(data: Data) -> Iterable[Goal]:
    """Against the fastest of Embree's ways that were asked, on the rays where that is least."""
    result = packets.read(data.path / packets.FILE)
    for kind, asked in result["goals"].items() if result.get("rays") else ():
        rows = [(r, packets_page.fastest(r)) for r in result["rays"] if r["kind"] == kind]
        ways = [(r, _interval(r, f"{way}_ratio", "")) for r, way in rows if way]
        if not ways:
            continue
        row, ratio = min(ways, key=lambda found: found[1].value)
        name = f"rays {packets_page.OF_KIND[kind]}: over Embree's fastest way, rays a second"
        known = [text for way, text in packets_page.WAYS.items() if any(r.get(way) for r, _ in ways)]
        error = f"asked by {', '.join(known)}; {row['embree']}"
        verdict = "" if asked is None else verdicts.goal(ratio, asked)
        least = math.nan if asked is None else asked
        yield Goal(name, least, ratio, verdict, f"packets on {row['scene']}", beside=error)


def of_lattice(data: Data) -> Iterable[Goal]:
    result = lattice.read(data.path / lattice.FILE)
    for threads in (1, 2):
        row = lattice.best(result, threads)
        if row is None:
            continue
        ms = _interval(row, "ms", "")
        ratio = Interval(*(row["program_ms"] / x for x in (ms.value, ms.high, ms.low)), 0, ms.sufficient)
        other = f"CPU-RTRM's {row['program_ms']:g} ms (another machine: the value decides)"
        name = f"lattice over {other}, threads {threads}"
        error = f"{show.number(row['psnr_db'])} dB to truth"
        verdict = verdicts.MET if ratio.value >= RTRM else verdicts.MISSED
        yield Goal(name, RTRM, ratio, verdict, row["phase"], beside=error, ours=True)


SOURCES: tuple[tuple[str, str, Callable[[Data], Iterable[Goal]]], ...] = (
    ("frames.jsonl", "scripts/stepwise sweep", of_ladder),
    (accuracy.FILE, "scripts/stepwise accuracy", of_errors),
    ("verify.json", "scripts/stepwise verify", of_pictures),
    (frames.FILE, "scripts/stepwise frames", of_frames),
    (drjit_measure.FILE, "scripts/stepwise drjit", of_drjit),
    (scaling.FILE, "scripts/stepwise scaling", of_growth),
    (packets.FILE, "scripts/stepwise packets", of_packets),
    (lattice.FILE, "scripts/stepwise lattice", of_lattice),
)


def of_run(data: Data) -> list[tuple[int, Goal]]:
    """Goals that the run has a figure for, and their source's place. Raises StudyError for a broken file."""
    made: list[tuple[int, Goal]] = []
    for place, (file, script, goals) in enumerate(SOURCES):
        with reading(data.path / file, f"{script} --run {data.path}"):
            made += [(place, goal) for goal in goals(data)]
    return made
