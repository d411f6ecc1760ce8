"""Our phases beside Dr.Jit as a table, made from drjit.json alone."""

from __future__ import annotations

from matplotlib.figure import Figure

from study.core import machine, show
from study.core.show import Column
from study.experiments.drjit.measure import DRJIT, GOALS, OWN, SAME, Row
from study.pictures import dots


def _published(row: Row) -> str:
    return show.plain("published_ms")(row) if row["program"] == DRJIT else show.NOTHING


COLUMNS = [
    Column("", "scene, no shadows", lambda r: r["scene"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "program", lambda r: r["program"]),
    Column("", "limits of the march", lambda r: r["limits"]),
    Column("", "ms [95 %]", show.spread_of("ms")),
    Column("", f"times as fast as {DRJIT} [95 %]", show.spread_of("ratio", "×")),
    Column("", f"{DRJIT} as published, ms", _published),
    Column("error by the same limits", "to", lambda r: r["reference"]),
    Column("error by the same limits", "PSNR, dB", show.error_psnr),
    Column("error by the same limits", "depth agrees", lambda r: show.share(r["depth_agree_fraction"])),
    Column("error by the scene's own", "PSNR, dB ", lambda r: show.error_psnr(r["to_own"])),
    Column("error by the scene's own", "wrong hit, ppm", lambda r: show.number(r["to_own"]["wrong_ppm"])),
]  # fmt: skip


def _own(result: Row) -> list[Row]:
    """Our phases by the scene's own limits, beside Dr.Jit by its."""
    return [row for row in result["rows"] if row["ratio"] and row["limits"] == OWN]


def _wrong(row: Row) -> str:
    return show.decibels(show.error_psnr(row["to_own"]))


def draw(result: Row) -> Figure:
    rows = []
    for row in _own(result):
        panel = f"{row['scene']}, {row['threads']} thread{'s' * (row['threads'] > 1)}"
        rows.append(dots.of(row["ratio"], panel, row["program"], _wrong(row), True))
    return dots.draw(rows, "Our phases over Dr.Jit, and their PSNR", "times as fast as Dr.Jit", True)


def answer(result: Row) -> str:
    """Of each scene the fastest phase on most threads: how many times as fast as Dr.Jit, both errors."""
    said = []
    rows = _own(result)
    threads = max((row["threads"] for row in rows), default=0)
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = [row for row in rows if row["scene"] == scene and row["threads"] == threads]
        best = max(mine, key=lambda row: row["ratio"]["value"], default=None)
        theirs = [row for row in result["rows"] if (row["scene"], row["program"]) == (scene, DRJIT)]
        if best and theirs:
            said.append(
                f"{best['program']} is {show.spread(best['ratio'], 3, '×')} as fast as Dr.Jit on {scene} "
                f"({_wrong(best)} to the reference, Dr.Jit {_wrong(theirs[0])})"
            )
    return f"On {threads} thread{'s' * (threads > 1)}, {'; '.join(said)}." if said else ""


def note(result: Row) -> str:
    cpu = machine.name(result.get("context"))
    figures = "; ".join(f"{name} {one:g} and {two:g} ms" for name, (_, (one, two)) in GOALS.items())
    return (
        f"{cpu}; n = {result['n']}, {result['launches']} interleaved launches; drjit {result['drjit']} on "
        f"{result['llvm']}. Dr.Jit marches in float, {SAME}, normals by six evaluations, in one frozen "
        "kernel, with early ends of rays and of the Mandelbulb's iterations; compiling is not in its time. "
        "Our phases keep the scene's own limits, which are harder; by Dr.Jit's they are shown in the table. "
        f"Published (Zen 5, 4.27 GHz, LLVM 19, one and two threads): {figures}. Errors are in "
        "linear RGB, to the fastest double-precision phase."
    )
