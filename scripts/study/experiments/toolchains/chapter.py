"""The chapter of compilers and flags."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column, Row
from study.experiments.section import Section, part, reading
from study.experiments.toolchains import measure as toolchains
from study.pictures import dots
from study.pictures.draw import Drawing


def _number(name: str):
    return lambda row: show.NOTHING if row.get(name) is None else show.number(row[name])


def _psnr(row: Row) -> str:
    if row["psnr_to_shipped_db"] is not None:
        return show.number(row["psnr_to_shipped_db"])
    return "identical" if row["rmse_to_shipped"] == 0 else "not finite"  # JSON's null is either


CHAINS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "compiler", lambda r: r["compiler"]),
    Column("", "flags", lambda r: r["flags"]),
    Column("", "ms [95 %]", show.spread_of("ms")),
    Column("", "speed over gcc as shipped [95 %]", show.spread_of("speedup", "×")),
    Column("what changes", "pixels with any bit changed", lambda r: show.percent(r["changed_fraction"])),
    Column("what changes", "PSNR to shipped, dB", _psnr),
    Column("error to ground truth", "PSNR, dB", _number("truth_psnr_db")),
    Column("error to ground truth", "false hits, ppm", _number("truth_false_hits_ppm")),
    Column("error to ground truth", "false misses, ppm", _number("truth_false_misses_ppm")),
]


CHAINS_ABOUT = (
    "n = {n}, {launches} interleaved launches, every phase on one thread. Flags come behind the phase's own "
    "(-O3, its -m flags, -ffp-contract=off): “the CPU's -m flags” is -march=native, here {native}; “and "
    "contraction” lets a·b + c round once; “and fast-math” is -ffast-math on top."
)


def compilers(path: Path) -> Section:
    """Compilers and flags: time, pixels that change, error to ground truth."""
    file = path / "toolchains.json"
    parts, answer, drawn = [], "", {}
    with reading(file, f"scripts/stepwise toolchains --run {path}"):
        if file.exists():
            result = toolchains.read(file)
            native = "; ".join(f"{name}: {flags or 'not told'}" for name, flags in result["native"].items())
            note = CHAINS_ABOUT.format(**result | {"native": native})
            skipped = [
                f"skipped {one.get('compiler') or one['phase']}: {one['reason']}" for one in result["skipped"]
            ]
            rows = result["rows"]
            caption = f"Each phase by each compiler and set of flags, n = {result['n']}"
            parts = part("toolchains", caption, rows, CHAINS, "\n".join([note, *skipped]))
            answer = _answer(rows)
            if rows:
                caption = "Speed of each build over gcc's with the phase's own flags"
                drawn = {"toolchains": Drawing(caption, note, lambda: _draw(rows))}
    about = {"file": file, "script": "scripts/stepwise toolchains", "drawn": drawn}
    return Section("toolchains", "Compilers and flags", "make toolchains", parts, answer=answer, **about)


def _draw(rows: list[Row]) -> Figure:
    made = [
        dots.of(row["speedup"], f"{row['scene']}, {row['phase']}", f"{row['compiler']}, {row['flags']}",
                f"{_psnr(row)} to shipped", True)
        for row in rows
    ]  # fmt: skip
    return dots.draw(made, "What another compiler or other flags give", "speed over gcc as shipped", True)


def _answer(rows: list[Row]) -> str:
    """The largest gain and the largest loss against what is shipped, with what they do to the picture."""
    able = [row for row in rows if row["speedup"]["value"]]
    if not able:
        return ""
    best, worst = (pick(able, key=lambda row: row["speedup"]["value"]) for pick in (max, min))
    said = [
        f"{show.spread_of('speedup', '×')(row)}, {row['phase']} on {row['scene']} by {row['compiler']} with "
        f"{row['flags']} ({_psnr(row)} to the shipped picture)"
        for row in (best, worst)
    ]
    return f"Against gcc with the phase's own flags the most is {said[0]}, the least {said[1]}."
