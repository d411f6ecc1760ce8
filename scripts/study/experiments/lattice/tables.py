"""CPU-RTRM's scene as a table, made from lattice.json alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.lattice import measure as lattice
from study.experiments.lattice.measure import Row
from study.experiments.section import Claim, System, part

COLUMNS = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "size", lambda r: f"{r['width']}×{r['n']}"),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "ms a frame [95 %]", lambda r: show.interval(r, "ms", 3)),
    Column("", "CPU-RTRM, ms", show.plain("program_ms")),
    Column(
        "",
        "that over ours: two machines, no interval",
        lambda r: show.times(r["program"]),
    ),
    Column("", "shading's share of the FLOPs", lambda r: counted(r)),
    Column("", "time less without the light [95 %]", lambda r: share(r)),
    Column("to ground truth", "PSNR, dB", show.plain("psnr_db")),
    Column("to ground truth", "wrong hits, ppm", show.plain("wrong_ppm")),
    Column("to ground truth", "|Δt| 99 %", show.plain("dt_p99", 2)),
]


def counted(row: Row) -> str:
    """A lower bound; files of earlier runs lack it."""
    return show.NOTHING if row.get("shading") is None else f"≥ {show.percent(row['shading'])}"


def share(row: Row) -> str:
    if row["light"] is None:
        return show.NOTHING
    return show.interval({k: row[k] and 100 * row[k] for k in ("light", "light_low", "light_high")}, "light",
                         2, " %")  # fmt: skip


def foot(rows: Sequence[Row]) -> str:
    """What shading takes: where time does not tell it, the FLOPs alone do. "" for rows without either."""
    timed = [row for row in rows if row["light"] is not None]
    told = [row["phase"] for row in timed if row["light_low"] is not None and row["light_low"] > 0]
    least = [row["shading"] for row in rows if row.get("shading") is not None]
    words = []
    if timed and not told:
        words.append(
            "What share of the time is our shading cannot be told from times here: no interval is above 0."
        )
    elif timed:
        words.append(
            f"What share of the time is our shading can be told from times of {', '.join(told)} alone: the "
            "other intervals are not above 0."
        )
    below = [row["phase"] for row in timed if row["light_high"] is not None and row["light_high"] < 0]
    if below:
        words.append(
            f"Of {', '.join(below)} the frame without its light was the slower one; why is not known."
        )
    if timed and least:
        low, high = (show.percent(end) for end in (min(least), max(least)))
        shares = low if low == high else f"{low} to {high}, by phase"
        words.append(f"The figure is its share of the FLOPs: at least {shares}.")
    return " ".join(words)


def sentence(row: Row) -> str:
    """For a terminal."""
    than = (
        ""
        if row["program"] is None
        else f", {show.times(row['program'])} CPU-RTRM's figure of another machine"
    )
    return (
        f"{row['phase']} {row['width']}×{row['n']}, threads {row['threads']}: "
        f"{show.interval(row, 'ms', 3)} ms{than}; {show.number(row['psnr_db'])} dB to ground truth, "
        f"{show.number(row['wrong_ppm'])} ppm wrong hits"
    )


def claims(result: Row) -> list[Claim]:
    """Our fastest beside CPU-RTRM's own figures, and beside the paper's claim."""
    made = []
    for threads in (1, 2):
        row = lattice.best(result, threads)
        if row is None:
            continue
        error = f"{show.number(row['psnr_db'])} dB, {show.number(row['wrong_ppm'])} ppm wrong hits"
        what = f"{lattice.SCENE} {row['width']}×{row['n']}, {row['phase']}, threads {threads}, ms"
        times = row["program"]
        ours = show.interval(row, "ms", 3)
        made.append(Claim("CPU-RTRM", what, f"{row['program_ms']:g}", ours, show.times(times), error, times))
        if threads > 1:
            ratio = f"{show.number(times / result['paper'])}×"
            what = "times as fast as CPU-RTRM, with threads"
            made.append(Claim("CPU-RTRM", what, f"{result['paper']}×", show.times(times), ratio, error))
    return made


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = lattice.read(run / lattice.FILE)
    if not result["rows"]:
        return None
    lines = f"{foot(result['rows'])}\n{note(result)}".strip()
    parts = part("lattice", "CPU-RTRM's scene by every phase of the ladder", result["rows"], COLUMNS, lines)
    about = f"CPU-RTRM: its own program and shading, on {result['program']['machine']}; not measured here."
    return System(claims(result), parts, about)


def note(result: Row) -> str:
    said, size = result["program"], result["error_size"]
    figures = " and ".join(f"{ms:g} ms on {count}" for count, ms in said["ms"].items())
    return (
        "The scene is made anew from a description of CPU-RTRM's. Its own program takes "
        f"{figures} threads on {said['machine']}, with its own shading (diffuse, Blinn-Phong highlight, no "
        "shadows); it was not measured on this machine, so the ratio is between machines, too. Our rays end "
        "where the scene says (64 steps, a hit within .005), but opt9_convex and opt10_scene hit solids "
        "where they are. Shading's share is of counted FLOPs in the functions of normals, light and colours "
        "alone: what they call that the march calls, too (up to opt3 distances of normals), is not in it, "
        "and of baseline and opt1, whose functions are of vectors, it cannot be told. Without the "
        f"light: moved far behind all that is seen, where {show.percent(result['still_lit'])} of the hits "
        "still face it, and normals and colours are still found; an interval with 0 in it tells nothing. "
        f"Errors are of pictures of {size[0]}×{size[1]}."
    )
