"""The chapter of compilers and flags."""

from __future__ import annotations

from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.pareto.fronts import Row
from study.experiments.section import Section, part, reading
from study.experiments.toolchains import measure as toolchains


def _number(name: str):
    return lambda row: show.NOTHING if row.get(name) is None else show.number(row[name])


def _interval(name: str, unit: str = ""):
    def text(row: Row) -> str:
        found = row[name]
        return show.interval(
            {"v": found["value"], "v_low": found["low"], "v_high": found["high"]}, "v", 3, unit
        )

    return text


def _psnr(row: Row) -> str:
    if row["psnr_to_shipped_db"] is not None:
        return show.number(row["psnr_to_shipped_db"])
    return "identical" if row["rmse_to_shipped"] == 0 else "not finite"  # JSON's null is either


CHAINS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "compiler", lambda r: r["compiler"]),
    Column("", "flags", lambda r: r["flags"]),
    Column("", "ms [95 %]", _interval("ms")),
    Column("", "speed over gcc as shipped [95 %]", _interval("speedup", "×")),
    Column("what changes", "pixels with any bit changed", lambda r: show.percent(r["changed_fraction"])),
    Column("what changes", "PSNR to shipped, dB", _psnr),
    Column("error to truth", "PSNR, dB", _number("truth_psnr_db")),
    Column("error to truth", "false hits, ppm", _number("truth_false_hits_ppm")),
    Column("error to truth", "false misses, ppm", _number("truth_false_misses_ppm")),
]


CHAINS_ABOUT = (
    "n = {n}, {launches} interleaved launches, every phase on one thread. Flags come behind the phase's own "
    "(-O3, its -m flags, -ffp-contract=off): “the CPU's -m flags” is -march=native, here {native}; “and "
    "contraction” lets a·b + c round once; “and fast-math” is -ffast-math on top."
)


def compilers(path: Path) -> Section:
    """Compilers and flags: time, pixels that change, error to truth."""
    file = path / "toolchains.json"
    parts, remarks = [], []
    with reading(file, f"scripts/stepwise toolchains --run {path}"):
        if file.exists():
            result = toolchains.read(file)
            caption = f"Each phase by each compiler and set of flags, n = {result['n']}"
            parts = part("toolchains", caption, result["rows"], CHAINS)
            native = "; ".join(f"{name}: {flags or 'not told'}" for name, flags in result["native"].items())
            remarks = [CHAINS_ABOUT.format(**result | {"native": native})]
            remarks += [
                f"skipped {one.get('compiler') or one['phase']}: {one['reason']}" for one in result["skipped"]
            ]
    return Section("toolchains", "Compilers and flags", "make toolchains", parts, remarks)
