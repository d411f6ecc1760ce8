"""Labs 10 and 12: questions to ceilings and phases of published runs, drawn by a student's number."""

import csv
import io
import math
from functools import cache
from pathlib import Path

import numpy as np

from study.bounds import ceilings, roof
from study.bounds.ceilings import Ceilings
from study.bounds.roof import Point
from study.core.registry import ROOT
from study.labs.answers import Question
from study.numbers import analysis

RUNS = sorted(path.parent for path in (ROOT / "results" / "reference").glob(f"*/{ceilings.FILE}"))
LEVELS, LINE, WIDTH = ("L1", "L2", "L3", "memory"), 64, 256  # bytes of a line; bits of an access
FAR = 1.25  # a working set is at least so much larger or smaller than each cache
Given = list[tuple[str, float | str, str]]  # name, value, unit


def _task(given: Given) -> dict[str, str]:
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows([("given", "value", "unit"), *given])
    return {"task.csv": table.getvalue()}


def _digits(value: float) -> float:
    """Rounds to six digits, as it stands in the task: keys are calculated from that."""
    return float(f"{value:.6g}")


@cache
def _points(run: Path) -> list[Point]:
    counted, limits, _ = roof.read(run)
    found = roof.headline(roof.points(analysis.load(run), counted, limits))
    return [one for one in found if one.bytes > 0 and one.fma_roof > 0 and one.L1_roof > 0]


def roofline(student: int) -> list[Question]:
    """Lab 12: one timed phase below the roofs of its machine."""
    rng = np.random.default_rng([12, student])
    run = RUNS[rng.integers(len(RUNS))]
    one = _points(run)[rng.integers(len(_points(run)))]
    flops, moved = _digits(one.flops), _digits(one.bytes)
    rate, fma = _digits(one.flops_per_core_cycle), _digits(one.fma_roof)
    band = _digits(one.L1_roof / one.intensity)
    given: Given = [
        ("run", run.name, ""),
        ("phase", one.phase, ""),
        ("scene", one.scene, ""),
        ("picture", f"{one.width}x{one.height}", "pixels"),
        ("flops", flops, "FLOP a frame"),
        ("bytes", moved, "bytes a frame, loaded and stored"),
        ("rate", rate, "FLOP a core cycle, measured"),
        ("fma", fma, "FLOP a core cycle, the ceiling of FMAs of this width"),
        ("L1", band, "bytes a core cycle, the ceiling of L1"),
    ]
    intensity = flops / moved
    least, halved = (min(fma, band * many * intensity) for many in (1, 2))
    bound = "fma" if fma < band * intensity else "L1"
    return [
        Question("intensity", number=intensity, files=_task(given)),
        Question("ridge", number=fma / band),
        Question("roof", ("fma", "L1"), bound, least),
        Question("share", number=100 * rate / least),
        Question("least-cycles", number=flops / least),
        Question("half-the-bytes", number=halved),
    ]


def _bytes(limits: Ceilings, level: str) -> float:
    return (limits.cache_bytes or {}).get(level) or math.inf


def _apart(limits: Ceilings, whole: int) -> bool:
    """Whether there is no doubt which level holds it."""
    return all(max(whole / size, size / whole) > FAR for size in (_bytes(limits, one) for one in LEVELS[:3]))


def caches(student: int) -> list[Question]:
    """Lab 10: an array of shapes that every step of every ray goes through."""
    rng = np.random.default_rng([10, student])
    limits = Ceilings.load(RUNS[rng.integers(len(RUNS))] / ceilings.FILE)
    while True:
        size, shapes = 8 * int(rng.integers(4, 33)), 2 ** int(rng.integers(8, 14))
        if _apart(limits, size * shapes) and size * shapes > FAR * _bytes(limits, "L1"):
            break
    whole, rays, latency, work = (
        size * shapes,
        *(int(rng.integers(*ends)) for ends in ((4, 33), (14, 90), (3, 13))),
    )
    level = next(one for one in LEVELS if whole < _bytes(limits, one))
    band = {one: _digits(limits.bandwidth_by(one, WIDTH)) for one in LEVELS}
    given: Given = [
        ("size", size, "bytes of a shape"),
        ("shapes", shapes, "in one array, all read at each step"),
        ("rays", rays, "marched together through a block of shapes"),
        ("latency", latency, "cycles until a fetched line is there"),
        ("work", work, "cycles of arithmetic a shape"),
        *((f"{one} size", _bytes(limits, one), "bytes") for one in LEVELS[:3]),
        *((f"{one} band", band[one], f"bytes a core cycle, by {WIDTH} bits at a time") for one in LEVELS),
    ]
    fetched = whole / band[level]
    return [
        Question("lines", number=whole / LINE, files=_task(given)),
        Question("level", LEVELS, level),
        Question("cycles", number=fetched),
        Question("block", number=_bytes(limits, "L1") / 2 // size),
        Question("blocked", number=fetched / rays + whole / band["L1"]),
        Question("ahead", number=math.ceil(latency / work)),
    ]
