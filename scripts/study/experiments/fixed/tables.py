"""The integer ray tracer as tables and a figure: from fixed.json and the pictures it names."""

from __future__ import annotations

from collections.abc import Iterator

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from study.core import show
from study.core.show import Column
from study.experiments.fixed import measure as fixed
from study.experiments.fixed.measure import Row
from study.experiments.moving import measure as moving
from study.experiments.section import Part, part
from study.pictures.draw import COLOURS, Drawing, plain_log

FIGURE, FRAMES = "fixed-bits", "fixed-frames"


def _ms(row: Row) -> str:
    return show.interval(row, "ms", 3) if row.get("ms") else show.NOTHING


def _ratio(key: str):
    def say(row: Row) -> str:
        one = {name: row.get(name) for name in (key, f"{key}_low", f"{key}_high")}
        return show.interval(one, key, 3, "×") if one[key] else show.NOTHING

    return say


def _base_or(key: str):
    """The ratio; "base" in the row that others are compared with (case_rows)."""
    return lambda row: "base" if key in row.get("base_of", ()) else _ratio(key)(row)


def _shown(key: str, digits: int = 3):
    return lambda row: show.number(row[key], digits) if row.get(key) is not None else show.NOTHING


def _wrong(row: Row) -> str:
    return show.number(row["wrong_ppm"]) if "wrong_ppm" in row else show.NOTHING


CASES = [
    Column("", "case", lambda r: r["case"]),
    Column("", "settings", lambda r: r["settings"]),
    Column("", "ms [95 %]", _ms),
    Column("", "× the article's on one lane [95 %]", _base_or("gain")),
    Column("", "× float in the most lanes that ran [95 %]", _base_or("over_float")),
    Column("", "× float in as many lanes [95 %]", _base_or("over_like_float")),
    Column("to ground truth", "wrong hits, ppm", _wrong),
    Column("to ground truth", "|Δt| 99 %", _shown("dt_p99", 2)),
    Column("to ground truth", "PSNR, dB", _shown("psnr_db")),
]
SWEEP = [
    Column("", "bits of fraction", lambda r: str(r["bits"])),
    Column(
        "", "roots", lambda r: "the article's" if r["roots"] == "article" else f"{r['roots']} Newton steps"
    ),
    Column("", "ms [95 %]", _ms),
    Column("to ground truth", "wrong hits, ppm", _wrong),
    Column("to ground truth", "|Δt| 50 %", _shown("dt_p50", 2)),
    Column("to ground truth", "99 %", _shown("dt_p99", 2)),
    Column("to ground truth", "PSNR, dB", _shown("psnr_db")),
    Column("", "refused", lambda r: r.get("refused", show.NOTHING)),
]
MEANING = {
    "never": "none is cleared",
    "corners": "the article's four corners",
    "safe": "planes against spheres",
    "lists": "the same, and a list of spheres for each block",
}
PROGRAMS = {
    "article": "the article's roots and corners, one lane",
    "lanes": "integers in lanes",
    "floats": "floats in lanes",
}


def _who(row: Row) -> str:
    return f"{PROGRAMS[row['program']]} ({row['phase']})" if "program" in row else row["phase"]


def _per_article(row: Row) -> str:
    return row["per_article"].partition(" ")[0]


def _common(row: Row) -> str:
    if row.get("common_ms") is None:
        return show.NOTHING
    return f"{show.number(row['common_ms'], 4)} (first {row['common_frames']:,})"


COMMON = Column("ms a frame, update and all", "mean of the frames that all rows have", _common)
ANIMATION = [
    Column("", "program", _who),
    Column("", "shadows", lambda r: "none" if r.get("shadows") is False else "hard"),
    Column("", "cores", lambda r: str(r["threads"])),
    *moving.COLUMNS[2:4],
    COMMON,
    *moving.COLUMNS[4:],
    Column("", "pixels per core and second, × the article's", _per_article),
]
CLEARING = [
    Column("", "picture", lambda r: f"{r['width']}×{r['n']}"),
    Column("", "blocks", lambda r: MEANING[r["clear"]]),
    Column("", "ms [95 %]", _ms),
    Column("", "cleared, % of the pixels", lambda r: show.number(100 * r["cleared"])),
    Column("", "wrongly cleared, ppm", lambda r: show.number(r["wrongly_cleared_ppm"])),
    Column("", "as seen by", lambda r: "ground truth" if "against" not in r else "itself without clearing"),
    Column("to ground truth", "PSNR, dB", _shown("psnr_db")),
]
NOTE = (
    "The article's program shades otherwise (no shadow, no falloff, mirrors of full weight) and moves its "
    "spheres otherwise; here is this house's shading, so that ground truth can judge it, and once without "
    "shadows. Its time is the mean of 900 frames on 35 cores of a CPU without vectors: core·ns a pixel are "
    "the mean of a frame's time, times cores, over pixels. On one core and by the article's program fewer "
    "frames are timed, from the first on; the table has how many. What the frames show drifts "
    "along the animation: compare programs by the mean of the frames that all rows have. They are measured "
    "one after the other here, not interleaved, and a mean of frames has no interval: what the machine did "
    f"meanwhile is in the quotients. {moving.NOTE}"
)


def case_rows(result: Row) -> list[Row]:
    """With `base_of`: the ratios whose base a row is. An older file has them of 1.00×, with an interval."""
    rows = result["rows"]
    names, floats = [row["case"] for row in rows], [r for r in rows if r["phase"] == "fixed_float"]
    bases = {"gain": names[:1], "over_float": [fixed.widest(names, "fixed_float")]}
    bases["over_like_float"] = [row["case"] for row in floats]
    said = {key for row in rows for key in row}
    return [
        row | {"base_of": [key for key, cases in bases.items() if key in said and row["case"] in cases]}
        for row in rows
    ]


def article_ns(result: Row) -> float:
    said = result["article"]
    return said["ms"] * 1e6 * said["cores"] / (said["width"] * said["height"])


def animation_rows(result: Row) -> list[Row]:
    """The article's program on its CPU, what it says of it, then ours; `per_article`: of core·ns a pixel."""
    said, theirs = result["article"], article_ns(result)
    own = {"phase": f"the article, {said['cpu']}", "shadows": False, "threads": said["cores"]}
    own |= {"ms": {"mean": said["ms"]}, "update_ms": None, "core_ns_per_pixel": theirs}
    own |= {"frames": said["frames"], "width": said["width"], "n": said["height"]}
    rows = fixed.with_common(result["animation"])
    return [row | {"per_article": moving.per_article(row, said)} for row in (own, *rows)]


def sentence(row: Row) -> str:
    """For a terminal."""
    psnr = _shown("psnr_db")(row)
    return f"{row['case']}, {row['width']}×{row['n']}: {_ms(row)} ms, {psnr} dB, {_wrong(row)} ppm wrong hits"


def _error(row: Row) -> str:
    psnr = f"{row['psnr_db']:.1f} dB" if row["psnr_db"] is not None else "none"
    return f"{psnr}, {row['wrong_ppm']:,.0f} ppm wrong hits"


def _still_error(row: Row) -> str:
    """For a row of another picture."""
    return f"{_error(row)} (the still at {row['width']}×{row['n']})"


def system_rows(result: Row) -> list[Row]:
    """Rows of the table of all systems: what the article says, what we measure, the ratio, the error."""
    if not result["rows"]:
        return []
    said = result["article"]
    cases = {row["case"]: row for row in result["rows"]}
    integers, floats = (fixed.widest(cases, phase) for phase in ("fixed_simd", "fixed_float"))
    of_still = [cases[case] for case in (integers, floats, next(iter(fixed.CASES))) if case in cases]
    errors = {row["phase"]: _still_error(row) for row in of_still}
    name = "integer ray tracer (P3)"
    rows = [
        {
            "system": name,
            "what": f"{_who(row)}, {fixed.MOVING} {row['width']}×{row['n']}, "
            f"{moving.processes_said(row)}, ms a frame, "
            f"{row['threads']} thread{'s' if row['threads'] > 1 else ''}"
            + (", no shadows" if row.get("shadows") is False else ""),
            "article": f"{said['ms']} (mean of {said['frames']} frames, no shadows; {said['cpu']})",
            "ours": moving.mean_said(row),
            "ratio": moving.per_article(row, said),
            "error": moving.error_said(row.get("error"))
            if row.get("error") or not row.get("shadows", True)
            else errors.get(row["phase"], show.NOTHING),
        }
        for row in fixed.with_common(result["animation"])
    ]
    for case in dict.fromkeys((integers, "16 lanes, 28 bits")):
        if case in cases and cases[case].get("over_float"):
            row = cases[case]
            rows.append(
                {
                    "system": name,
                    "what": f"{case} against the same in floats, ms",
                    "article": "no such comparison",
                    "ours": f"{_ms(row)}; floats {_ms(cases[floats])}",
                    "ratio": _ratio("over_float")(row) + " the floats' speed",
                    "error": f"{_error(row)}; floats {_error(cases[floats])}",
                }
            )
    return rows


def parts(result: Row) -> list[Part]:
    """The tables of fixed.json."""
    if not result["rows"]:
        return []
    tables = [
        ("fixed", "Rays in integers: lanes, floats", case_rows(result), CASES, ""),
        (
            "fixed-animation",
            "Rays in integers: the article's animation, beside what it says of its own CPU",
            animation_rows(result),
            ANIMATION,
            NOTE,
        ),
        ("fixed-clearing", "Rays in integers: which blocks are cleared", result["clearing"], CLEARING, ""),
        ("fixed-bits", "Rays in integers: bits of fraction × roots", result["sweep"], SWEEP, ""),
    ]
    return [
        one
        for name, caption, rows, columns, foot in tables
        for one in part(name, caption, rows, columns, foot)
    ]


def draw(result: Row) -> Figure:
    """PSNR and time over bits of fraction, a line for each kind of root; floats as a level."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = figure.subplots(1, 2)
    names = {"article": "the article's roots", "2": "two Newton steps", "3": "three Newton steps"}
    for panel, (key, label) in zip(
        panels, {"psnr_db": "PSNR to ground truth, dB", "ms": "ms a frame, one thread"}.items(), strict=True
    ):
        for colour, (roots, name) in zip(COLOURS, names.items(), strict=False):
            mine = [r for r in result["sweep"] if r["roots"] == roots and r.get(key)]
            at = [r["bits"] for r in mine], [r[key] for r in mine]
            panel.plot(*at, "o-", color=colour, label=name)
        floats = fixed.widest((r["case"] for r in result["rows"]), "fixed_float")
        level = next((r for r in result["rows"] if r["case"] == floats), None)
        if level and level[key]:
            panel.axhline(level[key], color="black", linestyle="--", label="the same in floats")
        panel.axvline(result["article"]["bits"], color="0.8", zorder=0)
        panel.set(xlabel="bits of fraction (grey: the article's)", ylabel=label)
        panel.set_ylim(bottom=0)
        panel.set_xticks(list(fixed.BITS))
    panels[0].legend(frameon=False, fontsize=9)
    return figure


def draw_frames(result: Row) -> Figure:
    """Frame times on every core: along the animation, and what share of the frames took at most so long."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    along, share = figure.subplots(1, 2, width_ratios=(3, 2))
    rows = [row for row in result["animation"] if row.get("all_ms")]
    most = max((row["threads"] for row in rows), default=0)
    said = result["article"]
    for colour, style, row in _lines(rows, most):
        ms = row["all_ms"]
        name = PROGRAMS.get(row.get("program"), row["phase"])
        name += ", no shadows" if row.get("shadows") is False else ""
        along.plot(
            ms, style, color=colour, linewidth=0.9, label=f"{name}: mean {show.number(sum(ms) / len(ms))}"
        )
        share.plot(sorted(ms), [100 * (i + 1) / len(ms) for i in range(len(ms))], style, color=colour)
    if all((row["width"], row["n"]) == (said["width"], said["height"]) for row in rows):
        label = f"the article's mean, {said['cores']} cores, no shadows: {said['ms']}"
        along.axhline(said["ms"], color="0.55", linewidth=1.5, zorder=1, label=label)
        share.axvline(said["ms"], color="0.55", linewidth=1.5, zorder=1)
    along.set(xlabel="frame of the animation", ylabel="ms a frame", yscale="log")
    share.set(xlabel="ms a frame", ylabel="frames that took at most so long, %", xscale="log", ylim=(0, 100))
    for axis in (along.yaxis, share.xaxis):
        plain_log(axis)
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    return figure


def _lines(rows: list[Row], threads: int) -> Iterator[tuple[str, str, Row]]:
    """Colour by program, dashes without shadows; of the rows on that many threads."""
    names = list(dict.fromkeys(row.get("program", row["phase"]) for row in rows))
    for row in rows:
        if row["threads"] == threads:
            place = names.index(row.get("program", row["phase"]))
            yield COLOURS[(5, 4, 3)[place % 3]], "--" if row.get("shadows") is False else "-", row


def drawings(result: Row) -> dict[str, Drawing]:
    """What fixed.json suffices for."""
    if not result["rows"]:
        return {}
    first = result["rows"][0]
    caption = "Bits of fraction against error (higher is better) and time (lower is better)"
    note = f"{fixed.SCENE}, {first['width']}×{first['n']}; lengths in the smallest unit that fits."
    found = {FIGURE: Drawing(caption, note, lambda: draw(result))}
    if any(row.get("all_ms") for row in result["animation"]):
        row = next(row for row in reversed(result["animation"]) if row.get("all_ms"))
        caption = "Frame times of the animation (lower is better): in order, and their distribution"
        note = (
            f"{fixed.MOVING}, {row['width']}×{row['n']}, on {row['threads']} cores, moving the spheres in "
            "each frame's time. A line that rises steeply on the right is a program whose frames take "
            "equally long. Lines that end early: fewer frames were timed, as the table says."
        )
        found[FRAMES] = Drawing(caption, note, lambda: draw_frames(result))
    return found
