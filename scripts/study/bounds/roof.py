"""The roofline: every timed configuration against what its machine can do (Tables 5 and 6, Figure 6).

Cache-aware: bytes are those the core loads and stores, whatever level they are in (A. Ilic, F. Pratas and
L. Sousa, IEEE Computer Architecture Letters 13(1), 2014, after S. Williams, A. Waterman and D. Patterson,
CACM 52(4), 2009).

What the roofs are: study.bounds.roof_shares.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from study.bounds import ceilings, peaks
from study.bounds.ceilings import Ceilings
from study.bounds.roof_shares import ELEMENT, SHARES, Clocks, Roofs, below, under_load
from study.core import registry, store
from study.core.cli import StudyError
from study.core.run_schema import Cpu
from study.counting import flops, paper_rule, schema
from study.counting.counts import Counts
from study.counting.flops import LIBM_INSIDE, stated_operations
from study.counting.schema import Measurement, Picture
from study.numbers import paper
from study.numbers.analysis import GENERATED, Cell, Data

COUNTS = "counts.json"
ORDER = ("blocks", "sde", "ptrace", "pmu")  # of two that counted the same picture, the first
DECLARED = "declared"
SECTION = {"baseline": "table5"}  # of the paper; every other phase is in Table 6
P = TypeVar("P", bound=Picture)
nan = math.nan


def read(folder: Path, strict: bool = True) -> tuple[schema.Counts, Ceilings | None, list[str]]:
    """A run's counts and ceilings. Unless strict, a file that is not there is empty and named in the notes.

    Raises StudyError for a broken file, strict or not.
    """
    limits, notes = Ceilings.load_if_there(folder / ceilings.FILE), []
    if not store.stored(folder / COUNTS).exists():
        again = f"scripts/stepwise flops --measure --run {folder}"
        notes.append(f"{folder / COUNTS} is missing: no counts; run {again}")
    if limits is None:
        again = f"scripts/stepwise ceilings --run {folder}"
        notes.append(f"{folder / ceilings.FILE} is missing: no ceilings; run {again}")
    if notes and strict:
        raise StudyError(notes[0])
    return flops.read(folder / COUNTS), limits, notes


@dataclass(frozen=True, kw_only=True)
class Point(Roofs, Clocks):
    """A timed configuration of one thread that has counts.

    Rates are FLOPs of the machine convention per core (or timer) cycle, their ends the interval of the cycles
    over launches. `scaled_from_n`: the counts are another height's, per pixel. `paper_…`: the paper's own
    figure and percent; `paper_rule_…`: calls × FLOPs of each function. NaN: not counted, or no ceiling.
    `foreign_counts`: why they are not of what was timed.
    """

    phase: str
    scene: str
    height: int
    width: int
    threads: int
    precision: str
    bits: int
    backend: str
    calibrated: bool | None
    scaled_from_n: int | None
    foreign_counts: str | None
    libm_counted: bool
    flops: float
    load_bytes: float
    store_bytes: float
    bytes: float
    intensity: float
    flops_per_core_cycle: float
    flops_per_core_cycle_low: float
    flops_per_core_cycle_high: float
    flops_per_tsc_cycle: float
    paper_rule_scaled_from_n: int | None
    paper_rule_flops: float
    paper_rule_flops_per_core_cycle: float
    paper_rule_flops_per_tsc_cycle: float
    paper_rule_share_of_avx2_roof: float
    paper_rule_share_of_avx2_peak: float
    paper_flops_per_cycle: float
    paper_share: float
    section: str

    @property
    def pixels(self) -> int:
        return self.width * self.height


def remarks(points: Sequence[Point]) -> list[str]:
    """What must stand beside every share of a roof: counts of other code, points above."""
    said = []
    if points and all(one.backend == DECLARED for one in points):
        said.append("Counts are declared (costs.def), not measured: without bytes no cache has a roof.")
    for text in dict.fromkeys(one.foreign_counts for one in points if one.foreign_counts):
        phases = ", ".join(dict.fromkeys(one.phase for one in points if one.foreign_counts == text))
        said.append(f"Counts that are not of what was timed ({phases}): {text}.")
    above = [one for one in points if any(getattr(one, name) > 1 for name in SHARES)]
    if names := ", ".join(dict.fromkeys(f"{one.phase} on {one.scene}" for one in above)):
        said.append(
            f"Above a roof, which cannot be ({names}): the ceiling was measured too low, "
            "the time on a faster clock, or the counts are of other code."
        )
    return said


def _nearest(pictures: Iterable[P], cell: Cell) -> tuple[float, int | None, P] | None:
    """Counts of the first picture of the cell's size, else of the nearest, as factor of pixels,
    height they are scaled from (None: they are its own), counts.
    """

    def apart(one: P) -> tuple[bool, float]:
        other = one.size != (cell.width, cell.height)
        return other, abs(math.log(one.width * one.height / cell.pixels))

    if (best := min(pictures, key=apart, default=None)) is None:
        return None
    same = best.size == (cell.width, cell.height)
    return (1.0, None, best) if same else (cell.pixels / (best.width * best.height), best.height, best)


def _origin(one: Picture, cell: Cell, cpu: str | None) -> str | None:
    """What else than the timed program's compiler, flags or CPU something was counted; None: no such."""
    counted_on = one.cpu if isinstance(one, Measurement) else None
    pairs = [("compiler", one.compiler, cell.facts.compiler), ("flags", one.flags, cell.facts.flags)]
    pairs.append(("cpu", counted_on, cpu))
    other = [
        f"{name} {own} instead of {timed}" for name, own, timed in pairs if own and timed and own != timed
    ]
    if one.kernel and cell.facts.kernel == GENERATED:
        other.append("of its general code instead of the kernel generated for the scene")
    return "; ".join(other) or None


def own_bits(cell: Cell, cpu: Cpu) -> tuple[str, int]:
    """Precision (double, single) and width of the cell's phase: the element's where it is scalar."""
    precision = "single" if cell.facts.precision == "float" else "double"
    return precision, min(int(cell.facts.lanes or 1) * ELEMENT[precision], peaks.widest(cpu))


def _same(one: Picture, cell: Cell, scene_hash: str | None) -> bool:
    known = None in (scene_hash, one.scene_hash) or one.scene_hash == scene_hash
    return (one.spec, one.scene) == (cell.spec, cell.scene) and known


def _point(
    cell: Cell, counted: schema.Counts, limits: Ceilings | None, data: Data, stated: Any
) -> Point | None:
    """None without counts. `stated`: the paper's figures."""
    cpu, hashes = data.context.cpu, data.frames[data.frames.scene == cell.scene].scene_hash
    scene_hash = str(hashes.iloc[-1]) if len(hashes) else None
    model, (precision, bits) = cpu.model, own_bits(cell, cpu)
    core, tsc = cell.median("core_cycles"), cell.median("tsc_cycles")
    fitting = [m for m in counted.measured if m.variant == "shipped" and _same(m, cell, scene_hash)]
    fitting.sort(
        key=lambda m: (_origin(m, cell, model) is not None, m.calibrated is not True, ORDER.index(m.backend))
    )
    found = _nearest(fitting, cell)
    paced = _nearest((d for d in counted.declared if _same(d, cell, scene_hash)), cell)
    if found:
        factor, scaled, one = found
        # With libm's inside, where the back end sees it: its time is in the cycles.
        whole = Counts.total(Counts.of(each) for each in (one.total, *(one.outside or {}).values()))
        flops, loads, stores = (factor * x for x in (whole.machine, whole.load, whole.store))
        backend, calibrated, operations = one.backend, one.calibrated, whole.lanes
        libm, origin = one.outside is not None or backend in LIBM_INSIDE, _origin(one, cell, model)
    elif paced and paced[2].flops:
        factor, scaled, declared = paced
        flops, loads, stores = factor * declared.flops.machine, nan, nan
        backend, calibrated = DECLARED, None
        operations = stated_operations(declared, precision, bits, ELEMENT[precision])
        libm, origin = False, _origin(declared, cell, model)
    else:
        return None
    if not loads + stores > 0:  # a back end that counts none
        loads = stores = nan
    rate, low, high = (flops / end if end > 0 else nan for end in (core.value, core.high, core.low))
    intensity = flops / (loads + stores)
    roofs = below(rate, intensity, precision, bits, operations, limits, cpu)
    rule = paper_rule.flop(paced[2]) if paced else None
    theirs = paced[0] * rule if paced and rule is not None else nan
    ruled = theirs / core.value
    return Point(
        phase=cell.spec,
        scene=cell.scene,
        height=cell.height,
        width=cell.width,
        threads=cell.threads,
        precision=precision,
        bits=bits,
        backend=backend,
        calibrated=calibrated,
        scaled_from_n=scaled,
        foreign_counts=origin,
        libm_counted=libm,
        flops=flops,
        load_bytes=loads,
        store_bytes=stores,
        bytes=loads + stores,
        intensity=intensity,
        flops_per_core_cycle=rate,
        flops_per_core_cycle_low=low,
        flops_per_core_cycle_high=high,
        flops_per_tsc_cycle=flops / tsc.value,
        **vars(roofs),
        **vars(under_load(rate, bits, roofs, cell, limits)),
        paper_rule_scaled_from_n=paced[1] if paced else None,
        paper_rule_flops=theirs,
        paper_rule_flops_per_core_cycle=ruled,
        paper_rule_flops_per_tsc_cycle=theirs / tsc.value,
        paper_rule_share_of_avx2_roof=ruled / roofs.avx2_fma_roof,
        paper_rule_share_of_avx2_peak=ruled / roofs.avx2_fma_peak,
        paper_flops_per_cycle=stated.get(("performance", cell.scene, cell.spec), nan),
        paper_share=stated.get(("share_of_peak", cell.scene, cell.spec), nan) / 100,
        section=SECTION.get(cell.spec, "table6"),
    )


def _apart(cell: Cell, run: Path) -> bool:
    """Whether a kernel ran that is other code than the general one, of which the counts are."""
    phase = registry.phases().get(cell.phase)
    if cell.facts.kernel != GENERATED or phase is None or not phase.kernel_apart:
        return False
    own = run / store.OWN_SCENES / f"{cell.scene}.json"  # of a scene that was given as a file
    return not (registry.scene_at(own) if own.exists() else registry.find_scene(cell.scene)).fractal


def points(data: Data, counted: schema.Counts, limits: Ceilings | None) -> list[Point]:
    """One per timed configuration of one thread that has counts, in the order of the cells."""
    stated = paper.read("performance").set_index(["metric", "scene", "phase"])["value"]
    made = [
        _point(cell, counted, limits, data, stated)
        for cell in data.cells
        if cell.threads == 1 and not _apart(cell, data.path)
    ]
    return [one for one in made if one is not None]


def headline(points: Iterable[Point]) -> list[Point]:
    """The largest picture of each scene and phase, scenes and phases as they come."""
    best: dict[tuple[str, str], Point] = {}
    for one in points:
        best[one.scene, one.phase] = max(best.get((one.scene, one.phase), one), one, key=lambda p: p.pixels)
    return list(best.values())
