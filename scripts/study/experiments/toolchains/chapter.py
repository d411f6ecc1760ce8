"""The chapter of compilers and flags."""

from functools import partial

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.section import Found, chapters, part
from study.experiments.toolchains.schema import FILE, Row, Toolchains
from study.pictures import dots
from study.pictures.draw import Drawing


def psnr(row: Row) -> str:
    if row.psnr_to_shipped_db is not None:
        return show.number(row.psnr_to_shipped_db)
    return "identical" if row.rmse_to_shipped == 0 else "not finite"  # JSON's null is either


CHAINS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "compiler", show.word("compiler")),
    Column("", "flags", show.word("flags")),
    Column("", "ms [95 %]", show.spread_of("ms")),
    Column("", "speed over gcc as shipped [95 %]", show.spread_of("speedup", "×")),
    Column("what changes", "pixels with any bit changed", lambda row: show.percent(row.changed_fraction)),
    Column("what changes", "PSNR to shipped, dB", psnr),
    Column("error to ground truth", "PSNR, dB", show.plain("truth_psnr_db")),
    Column("error to ground truth", "false hits, ppm", show.plain("truth_false_hits_ppm")),
    Column("error to ground truth", "false misses, ppm", show.plain("truth_false_misses_ppm")),
]


CHAINS_ABOUT = (
    "n = {n}, {launches} interleaved launches, every phase on one thread. Flags come behind the phase's own "
    "(-O3, its -m flags, -ffp-contract=off): “the CPU's -m flags” is -march=native, here {native}; “and "
    "contraction” lets a·b + c round once; “and fast-math” is -ffast-math on top."
)


def natives(found: Toolchains) -> str:
    return "; ".join(f"{name}: {flags or 'not told'}" for name, flags in found.native.items())


def left_out(found: Toolchains) -> list[str]:
    return [f"skipped {one.compiler or one.phase}: {one.reason}" for one in found.skipped]


def found(result: Toolchains) -> Found:
    """Compilers and flags: time, pixels that change, error to ground truth."""
    note = CHAINS_ABOUT.format(n=result.n, launches=result.launches, native=natives(result))
    caption = f"Each phase by each compiler and set of flags, n = {result.n}"
    parts = part("toolchains", caption, result.rows, CHAINS, "\n".join([note, *left_out(result)]))
    caption = "Speed of each build over gcc's with the phase's own flags"
    drawn = {"toolchains": Drawing(caption, note, partial(_draw, result.rows))}
    return Found(parts, _answer(result.rows), drawn)


section = chapters("toolchains", "Compilers and flags", FILE, Toolchains, found)


def _draw(rows: list[Row]) -> Figure:
    made = [
        dots.of(
            row.speedup,
            f"{row.scene}, {row.phase}",
            f"{row.compiler}, {row.flags}",
            f"{psnr(row)} to shipped",
            True,
        )
        for row in rows
    ]
    return dots.draw(made, "What another compiler or other flags give", "speed over gcc as shipped", True)


def _answer(rows: list[Row]) -> str:
    """The largest gain and the largest loss against what is shipped, with what they do to the picture."""
    able = [row for row in rows if row.speedup.value]
    if not able:
        return ""
    best, worst = (pick(able, key=lambda row: row.speedup.value) for pick in (max, min))
    said = [
        f"{show.spread(row.speedup, unit='×')}, {row.phase} on {row.scene} by {row.compiler} with "
        f"{row.flags} ({psnr(row)} to the shipped picture)"
        for row in (best, worst)
    ]
    return f"Against gcc with the phase's own flags the most is {said[0]}, the least {said[1]}."
