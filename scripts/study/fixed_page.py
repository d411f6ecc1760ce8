"""The integer ray tracer as tables and a figure: from fixed.json and the pictures it names."""

from __future__ import annotations

from matplotlib.figure import Figure

from study import fixed, moving, show
from study.draw import COLOURS, Drawing
from study.fixed import Row
from study.sections import Part, part
from study.show import Column

FIGURE = "fixed-bits"


def _ms(row: Row) -> str:
    return show.interval(row, "ms", 3) if row.get("ms") else show.NOTHING


def _ratio(key: str):
    def say(row: Row) -> str:
        one = {name: row.get(name) for name in (key, f"{key}_low", f"{key}_high")}
        return show.interval(one, key, 3, "×") if one[key] else show.NOTHING

    return say


def _shown(key: str, digits: int = 3):
    return lambda row: show.number(row[key], digits) if row.get(key) is not None else show.NOTHING


def _wrong(row: Row) -> str:
    return show.number(row["wrong_ppm"]) if "wrong_ppm" in row else show.NOTHING


CASES = [
    Column("", "case", lambda r: r["case"]),
    Column("", "settings", lambda r: r["settings"]),
    Column("", "ms [95 %]", _ms),
    Column("", "× the article's on one lane [95 %]", _ratio("gain")),
    Column("", "× float in as many lanes as run [95 %]", _ratio("over_float")),
    Column("to truth", "wrong hits, ppm", _wrong),
    Column("to truth", "|Δt| 99 %", _shown("dt_p99", 2)),
    Column("to truth", "PSNR, dB", _shown("psnr_db")),
]
SWEEP = [
    Column("", "bits of fraction", lambda r: str(r["bits"])),
    Column(
        "", "roots", lambda r: "the article's" if r["roots"] == "article" else f"{r['roots']} Newton steps"
    ),
    Column("", "ms [95 %]", _ms),
    Column("to truth", "wrong hits, ppm", _wrong),
    Column("to truth", "|Δt| 50 %", _shown("dt_p50", 2)),
    Column("to truth", "99 %", _shown("dt_p99", 2)),
    Column("to truth", "PSNR, dB", _shown("psnr_db")),
    Column("", "refused", lambda r: r.get("refused", show.NOTHING)),
]
MEANING = {
    "never": "none is cleared",
    "corners": "the article's four corners",
    "safe": "planes against spheres",
    "lists": "the same, and a list of spheres for each block",
}
CLEARING = [
    Column("", "picture", lambda r: f"{r['width']}×{r['n']}"),
    Column("", "blocks", lambda r: MEANING[r["clear"]]),
    Column("", "ms [95 %]", _ms),
    Column("", "cleared, % of the pixels", lambda r: show.number(100 * r["cleared"])),
    Column("", "wrongly cleared, ppm", lambda r: show.number(r["wrongly_cleared_ppm"])),
    Column("to truth", "PSNR, dB", _shown("psnr_db")),
]
NOTE = (
    "The article's program shades otherwise (no shadow, no falloff, mirrors of full weight) and moves its "
    "spheres otherwise; here is this house's shading, so that truth can judge it. Its time is of 35 cores of "
    "a CPU without vectors: core·ns a pixel are the frame's time, times cores, over pixels."
)


def article_ns(result: Row) -> float:
    said = result["article"]
    return said["ms"] * 1e6 * said["cores"] / (said["width"] * said["height"])


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
    said, theirs = result["article"], article_ns(result)
    cases = {row["case"]: row for row in result["rows"]}
    integers, floats = (fixed.widest(cases, phase) for phase in ("fixed_simd", "fixed_float"))
    of_still = [cases[case] for case in (integers, floats, "1 lane") if case in cases]
    errors = {row["phase"]: _still_error(row) for row in of_still}
    name = "integer ray tracer (P3)"
    rows = [
        {
            "system": name,
            "what": f"{row['phase']}, {fixed.MOVING} {row['width']}×{row['n']}, ms a frame, "
            f"{row['threads']} thread{'s' if row['threads'] > 1 else ''}",
            "article": f"{said['ms']} ({said['cpu']})",
            "ours": f"{show.number(row['ms']['p50'])} "
            f"(95 % of frames under {show.number(row['ms']['p95'])} ms)",
            "ratio": f"{show.number(theirs / row['core_ns_per_pixel'])}× its pixels per core and second",
            "error": errors.get(row["phase"], show.NOTHING),
        }
        for row in result["animation"]
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
        ("fixed", "Rays in integers: lanes, floats", result["rows"], CASES, False),
        (
            "fixed-animation",
            "Rays in integers: an animation, frame by frame",
            result["animation"],
            moving.COLUMNS,
            False,
        ),
        ("fixed-clearing", "Rays in integers: which blocks are cleared", result["clearing"], CLEARING, False),
        ("fixed-bits", "Rays in integers: bits of fraction × roots", result["sweep"], SWEEP, True),
    ]
    return [
        one
        for name, caption, rows, columns, folded in tables
        for one in part(name, caption, rows, columns, folded=folded)
    ]


def draw(result: Row) -> Figure:
    """PSNR and time over bits of fraction, a line for each kind of root; floats as a level."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = figure.subplots(1, 2)
    names = {"article": "the article's roots", "2": "two Newton steps", "3": "three Newton steps"}
    for panel, (key, label) in zip(
        panels, {"psnr_db": "PSNR to truth, dB", "ms": "ms a frame, one thread"}.items(), strict=True
    ):
        for colour, (roots, name) in zip(COLOURS, names.items(), strict=False):
            mine = [r for r in result["sweep"] if r["roots"] == roots and r.get(key)]
            panel.plot([r["bits"] for r in mine], [r[key] for r in mine], "o-", color=colour, label=name)
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


def drawings(result: Row) -> dict[str, Drawing]:
    """What fixed.json suffices for."""
    if not result["rows"]:
        return {}
    first = result["rows"][0]
    caption = "Bits of fraction against error (higher is better) and time (lower is better)"
    note = f"{fixed.SCENE}, {first['width']}×{first['n']}; lengths in the smallest unit that fits."
    return {FIGURE: Drawing(caption, note, lambda: draw(result))}
