"""Our phases beside Dr.Jit as a table, made from drjit.json alone."""

from __future__ import annotations

import math

from study.core import machine, show
from study.core.show import Column
from study.experiments.drjit.measure import DRJIT, GOALS, SAME, Row
from study.numbers.verdicts import MET, MISSED


def _interval(name: str, unit: str = "") -> object:
    def text(row: Row) -> str:
        found = row[name]
        if found is None:
            return show.NOTHING
        some = found if isinstance(found, dict) else vars(found)
        flat = {"v": some["value"], "v_low": some["low"], "v_high": some["high"]}
        return show.interval({k: math.nan if v is None else v for k, v in flat.items()}, "v", 3, unit)

    return text


def _psnr(row: Row) -> str:
    if row["rmse"] is None:
        return "not finite"
    value = (
        "identical" if row["psnr_db"] is None or math.isinf(row["psnr_db"]) else show.number(row["psnr_db"])
    )
    return value + (" (4×4 means)" if row["averaged"] else "")


def _verdict(row: Row) -> str:
    if row["verdict"] is None:
        return show.NOTHING
    return f"≥ {row['goal']:g}×: {row['verdict']}"


def _published(row: Row) -> str:
    return show.plain("published_ms")(row) if row["program"] == DRJIT else show.NOTHING


COLUMNS = [
    Column("", "scene, no shadows", lambda r: r["scene"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "program", lambda r: r["program"]),
    Column("", "limits of the march", lambda r: r["limits"]),
    Column("", "ms [95 %]", _interval("ms")),
    Column("", f"times as fast as {DRJIT} [95 %]", _interval("ratio", "×")),
    Column("", "goal", _verdict, lambda r: {MET: "good", MISSED: "bad"}.get(r["verdict"], "")),
    Column("", f"{DRJIT} as published, ms", _published),
    Column("error by the same limits", "to", lambda r: r["reference"]),
    Column("error by the same limits", "PSNR, dB", _psnr),
    Column("error by the same limits", "depth agrees", lambda r: show.share(r["depth_agree_fraction"])),
    Column("error by the scene's own", "PSNR, dB ", lambda r: _psnr(r["to_own"])),
    Column("error by the scene's own", "wrong hit, ppm", lambda r: show.number(r["to_own"]["wrong_ppm"])),
]  # fmt: skip


def note(result: Row) -> str:
    cpu = machine.name(result.get("context"))
    figures = "; ".join(f"{name} {one:g} and {two:g} ms" for name, (_, (one, two)) in GOALS.items())
    return (
        f"{cpu}; n = {result['n']}, {result['launches']} interleaved launches; drjit {result['drjit']} on "
        f"{result['llvm']}. Dr.Jit marches in float, {SAME}, normals by six evaluations, in one frozen "
        "kernel, with early ends of rays and of the Mandelbulb's iterations; compiling is not in its time. "
        "The goals are for our phases with the scene's own limits, which are harder; by Dr.Jit's they are "
        f"shown beside. Published (Zen 5, 4.27 GHz, LLVM 19, one and two threads): {figures}. Errors are in "
        "linear RGB, to the fastest double-precision phase."
    )
