"""Our phases beside other programs as tables and a figure, made from peers.json alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from study.core import machine, show
from study.core.show import Column
from study.experiments.peers.measure import FILE, Row
from study.experiments.peers.schema import Peers
from study.experiments.section import Found, Part, Section, chapter, part
from study.numbers import stats
from study.pictures import dots
from study.pictures.draw import Drawing

COLUMNS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "program", lambda r: r["program"]),
    Column("", "ms [95 %]", show.spread_of("ms")),
    Column("", "times the fastest phase's [95 %]", show.spread_of("ratio", "×")),
    Column("", "PSNR to ground truth, dB", show.error_psnr),
]
PROGRAMS = [
    Column("", "program", lambda r: r["program"]),
    Column("", "version", lambda r: r["version"]),
    Column("", "what is timed", lambda r: r["timed"]),
    Column("", "why its picture is not ours", lambda r: r["differs"]),
    Column(
        "", "wrong below, dB", lambda r: " / ".join(f"{x:g}" for x in dict.fromkeys(r["least_db"].values()))
    ),
]
PAPER = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "step", lambda r: r["beside"]),
    Column("the paper's program", "ms [95 %]", show.spread_of("ms")),
    Column("the paper's program", "× its baseline", show.spread_of("gain", "×")),
    Column("the paper's program", "displayed, dB", lambda r: displayed(r)),
    Column("ours", "ms [95 %] ", lambda r: show.spread(r["ours"]["ms"])),
    Column("ours", "× our baseline", show.spread_of("own_gain", "×")),
    Column("ours", "displayed, dB ", lambda r: displayed(r["ours"])),
    Column("", "theirs over ours [95 %]", show.spread_of("ratio", "×")),
]  # fmt: skip


def displayed(row: Row) -> str:
    """PSNR of the displayed picture, which can be identical where the linear one is not."""
    if row["rmse"] is None or row.get("psnr_display_db") is not None:
        return show.plain("psnr_display_db")(row)
    return "identical"


def of_kind(result: Row, paper: bool) -> list[Row]:
    """Rows of the paper's scenes, or of the others."""
    theirs = {row["scene"] for row in result["rows"] if row["kind"] == "paper"}
    return [row for row in result["rows"] if (row["scene"] in theirs) is paper]


def beside_the_paper(rows: Sequence[Row]) -> list[Row]:
    """Each step of the paper's program with ours, and both speed-ups over their own baselines."""
    at = {(row["kind"], row["scene"], row["beside"]): row for row in rows if row["kind"] == "paper"}
    ours = {(row["scene"], row["program"]): row for row in rows if row["kind"] == "phase"}

    def gain(base: Row | None, row: Row) -> stats.Interval | None:
        if base is None or "ns" not in base or "ns" not in row:
            return None
        return stats.ratio_interval(base["ns"], row["ns"])

    made = []
    for (kind, scene, step), row in at.items():
        mine = ours.get((scene, step))
        if mine:
            first, own = at.get((kind, scene, "baseline")), ours.get((scene, "baseline"))
            made.append(row | {"ours": mine, "gain": gain(first, row), "own_gain": gain(own, mine)})
    return made


def title(row: Row) -> str:
    return f"{row['scene']}, {row['threads']} thread{'s' * (row['threads'] > 1)}"


def draw(rows: Sequence[Row]) -> Figure:
    """Ours in blue, the others in grey, the fastest first."""
    panels = list(dict.fromkeys(title(row) for row in rows))
    shown = []
    for row in sorted(rows, key=lambda row: (panels.index(title(row)), row["ms"]["value"])):
        dot = dots.of(row["ms"], title(row), row["program"], show.decibels(show.error_psnr(row)))
        shown.append(dot if row["kind"] == "phase" else replace(dot, colour=dots.QUIET))
    return dots.draw(shown, "What a frame takes, and its PSNR to ground truth: our phases in blue", "ms")


def answer(result: Row) -> str:
    """Of each scene on one thread: the fastest peer, and how many times as long it takes as our phase."""
    said = []
    rows = [row for row in of_kind(result, False) if row["threads"] == 1]
    for scene in dict.fromkeys(row["scene"] for row in rows):
        peers = [row for row in rows if row["scene"] == scene and row["ratio"] and row["kind"] == "peer"]
        best = min(peers, key=lambda row: row["ms"]["value"], default=None)
        ours = [row for row in rows if best and (row["scene"], row["program"]) == (scene, best["beside"])]
        if best and ours:
            theirs, own = (show.decibels(show.error_psnr(row)) for row in (best, ours[0]))
            said.append(
                f"{best['program']} takes {show.spread(best['ratio'], 3, '×')} the time of {best['beside']} "
                f"on {scene} ({theirs}, ours {own})"
            )
    return f"On one thread, the fastest peer of each scene: {'; '.join(said)}." if said else ""


def note(result: Row) -> str:
    """What was run, and what was left out."""
    lines = [
        f"{machine.name(result.get('context'))}; n = {result['n']}, {result.get('launches')} interleaved "
        f"launches; errors in linear RGB at n = {result['error_n']}, of a Mandelbulb's 4×4 means. Scenes "
        "`_plain` have no shadows and no mirrors. Start, compiling and output are in no time."
    ]
    for one in result["left_out"]:
        scene = f" on {one['scene']}" if one.get("scene") else ""
        lines.append(f"Left out: {one['phase']}{scene}: {one['reason']}.")
    return "\n".join(lines)


def wrong(result: Row) -> list[str]:
    """Pictures that are further from ground truth than their program's known differences explain."""
    least = {one["program"]: one["least_db"] for one in result["programs"]}
    made = []
    for row in result["rows"]:
        wanted = least.get(row["program"], {}).get(row["scene"])
        exact = row["rmse"] is not None and row["psnr_db"] is None  # identical
        if wanted and row["threads"] == 1 and not exact and not (row["psnr_db"] or 0) >= wanted:
            text = show.decibels(show.error_psnr(row))
            made.append(f"{row['program']} on {row['scene']}: {text} to ground truth, less than {wanted:g}")
    return made


def parts(result: Row) -> list[Part]:
    made = part("peers", "Our phases and other programs", of_kind(result, False), COLUMNS, note(result))
    steps = beside_the_paper(of_kind(result, True))
    made += part(
        "peers-paper", "The paper's program and ours, step by step, on its scene files", steps, PAPER
    )
    return made + part("peers-programs", "The other programs", result["programs"], PROGRAMS)


def found(result: Row) -> Found:
    rows = of_kind(result, False)
    drawn = {}
    if rows:
        caption = "Time of a frame by our phases and by other programs, with each one's PSNR to ground truth"
        drawn["peers"] = Drawing(caption, note(result), lambda: draw(rows))
    return Found(parts(result), answer(result), drawn)


def section(run: Path) -> Section:
    return chapter("peers", "Beside what one would use instead", run / FILE, Peers.read_if_there, found)
