"""CPU-RTRM's scene as a table, made from lattice.json alone."""

from __future__ import annotations

from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.lattice.schema import FILE, SCENE, Lattice
from study.experiments.section import Claim, Part, System, part

COLUMNS = [
    Column("", "phase", lambda r: r.phase),
    Column("", "size", lambda r: f"{r.width}×{r.n}"),
    Column("", "threads", lambda r: str(r.threads)),
    Column("", "ms a frame [95 %]", lambda r: show.interval(r, "ms", 3)),
    Column("", "CPU-RTRM, ms", show.plain("program_ms")),
    Column("", "that over ours: two machines, no interval", lambda r: show.times(r.program)),
    Column("to ground truth", "PSNR, dB", show.plain("psnr_db")),
    Column("to ground truth", "wrong hits, ppm", show.plain("wrong_ppm")),
    Column("to ground truth", "|Δt| 99 %", show.plain("dt_p99", 2)),
]


def claims(result: Lattice) -> list[Claim]:
    """Our fastest beside CPU-RTRM's own figures, and beside the paper's claim."""
    made = []
    for threads in (1, 2):
        row = result.best(threads)
        if row is None or row.program is None:
            continue
        error = f"{show.number(row.psnr_db)} dB, {show.number(row.wrong_ppm)} ppm"
        what = f"{SCENE} {row.width}×{row.n}, {row.phase}, threads {threads}, ms"
        times, ours = row.program, show.interval(row, "ms", 3)
        made.append(Claim("CPU-RTRM", what, f"{row.program_ms:g}", ours, show.times(times), error, times))
        if threads > 1:
            ratio = f"{show.number(times / result.paper)}×"
            what = "times as fast as CPU-RTRM, with threads"
            made.append(Claim("CPU-RTRM", what, f"{result.paper:g}×", show.times(times), ratio, error))
    return made


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = Lattice.load_if_there(run / FILE)
    if result is None or not result.rows:
        return None
    about = f"CPU-RTRM: its own program and shading, on {result.program.machine}; not measured here."
    return System(claims(result), parts(result), about)


def parts(result: Lattice) -> list[Part]:
    caption = "CPU-RTRM's scene by every phase of the ladder"
    return part("lattice", caption, result.rows, COLUMNS, note(result))


def note(result: Lattice) -> str:
    figures = " and ".join(f"{ms:g} ms on {count}" for count, ms in result.program.ms.items())
    size = "×".join(map(str, result.error_size))
    return (
        "The scene is made anew from a description of CPU-RTRM's. Its own program takes "
        f"{figures} threads on {result.program.machine}, with its own shading (diffuse, Blinn-Phong "
        "highlight, no shadows); it was not measured on this machine, so the ratio is between machines, too. "
        "Our rays end where the scene says (64 steps, a hit within .005), but phases with closed forms hit "
        f"solids where they are. Errors are of pictures of {size}."
    )
