"""The figure of each phase's NOTES.md: phases/NAME/lesson.svg, made from a published run.

A figure is data first (`figure`: panels of rows, rounded to five digits), and a drawing of that data second
(`lessons_draw`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from study.bounds import work
from study.core import machine, registry
from study.core.store import Run
from study.experiments import experiment
from study.numbers import accuracy, analysis, ladder

REFERENCE = registry.ROOT / "results" / "reference"
RUN = REFERENCE / "zen5-2026-11-30"  # the study that the figures are of
LARGE = REFERENCE / "zen5-2026-11-30-720p"  # the ladder at 1280×720
THREADS = REFERENCE / "zen5-2026-11-30-threads"  # one thread beside two
SYSTEMS = ("rods.json", "throttle.json", "fixed.json", "packets.json")  # what make systems writes
NAME = "lesson.svg"
STEPS = {  # ablations by the step that they are
    "baseline+1_precomputed": "sin and cos once",
    "baseline+2_zero_skip": "zero angles skipped",
    "baseline+3_inlined": "transform inlined",
    "opt1+pointers": "vectors by pointer",
    "opt1+scene_by_value": "scene by pointer",
}


@dataclass(frozen=True)
class Value:
    """A number to five digits, with its 95 % interval; None: not known."""

    value: float | None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Row:
    label: str
    values: list[Value]  # one a series


@dataclass(frozen=True)
class Panel:
    """`kind`: pairs (before and after, logarithmic), bars or lines."""

    kind: str
    title: str
    unit: str
    series: Sequence[str]
    rows: list[Row]


@dataclass(frozen=True)
class Figure:
    phase: str
    title: str
    caption: str
    panels: list[Panel]


def _value(*ends: float | None) -> Value:
    return Value(*(None if end is None or not math.isfinite(end) else float(f"{end:.5g}") for end in ends))


def _found(found: Any) -> Value:
    return _value(found.value, found.low, found.high)


def _ms(row: Any) -> Value:
    return _value(row.ms, row.ms_low, row.ms_high)


@cache
def _ladder(run: Path) -> list[Any]:
    return list(ladder.rows(analysis.load(run)).itertuples(index=False))


@cache
def systems(reference: Path = REFERENCE) -> Path:
    """The newest published run that has all of SYSTEMS."""
    runs = [file.parent for file in reference.glob(f"*/{SYSTEMS[0]}")]
    found = [run for run in runs if all((run / name).exists() for name in SYSTEMS)]
    return max(found, key=lambda run: Run(run).context.time or "")


@cache
def _file(name: str) -> Any:
    return experiment.load(systems() if name in SYSTEMS else RUN, name)


def _both(phase: registry.Phase) -> list[str]:
    return [phase.parent or "", phase.name]


def headline_times(phase: registry.Phase, run: Path = RUN) -> Panel:
    """Frame time of the parent and of the phase, on the scenes and at the size of the run's ladder."""
    own, both = [row for row in _ladder(run) if row.headline and row.threads == 1], _both(phase)
    times = {(row.phase, row.scene): row for row in own}
    rows = [
        Row(scene, [_ms(times[name, scene]) for name in both])
        for scene in dict.fromkeys(row.scene for row in own)
        if all((name, scene) in times for name in both)
    ]
    return Panel("pairs", f"time of a frame, {own[0].width}×{own[0].height}", "ms", both, rows)


def large_times(phase: registry.Phase) -> Panel:
    """The same at 1280×720."""
    return headline_times(phase, LARGE)


def to_ideal(phase: registry.Phase) -> Panel:
    """How near the pictures of the parent and of the phase are to the one with the ideal soft shadow."""
    both, found = _both(phase), accuracy.rows(LARGE)
    near = {(one.phase, one.scene): one.colours.psnr_ideal_db for one in found}
    scenes = dict.fromkeys(one.scene for one in found)
    rows = [Row(scene, [_value(near[name, scene]) for name in both]) for scene in scenes]
    return Panel("bars", f"PSNR to the ideal picture, height {found[0].height}", "dB", both, rows)


def scene_times(phase: registry.Phase) -> Panel:
    """The same on every scene, at the size of the run's views."""
    views, both = _file("views.json"), _both(phase)
    own = [row for row in views.rows if row.view == "own"]
    times = {(row.phase, row.scene): _found(row.ms) for row in own}
    rows = [
        Row(scene, [times[name, scene] for name in both])
        for scene in sorted(row.scene for row in own if row.phase == phase.name)
        if (phase.parent, scene) in times
    ]
    return Panel("pairs", f"time of a frame, height {views.n}", "ms", both, rows)


def _counted(phase: registry.Phase, name: str, scale: float, title: str, unit: str) -> Panel:
    declared, rows = _file("counts.json").declared, []
    for scene in ("scene0", "mandelbulb"):
        height = next(row.height for row in _ladder(RUN) if row.scene == scene and row.headline)
        both = [work.counted(declared, one, scene, height) for one in _both(phase)]
        if all(both):
            rows.append(Row(scene, [_value(scale * getattr(one, name)) for one in both]))
    return Panel("bars", title, unit, _both(phase), rows)


def lanes(phase: registry.Phase) -> Panel:
    """Share of the FLOPs whose lane was in use, of the parent and of the phase."""
    return _counted(phase, "lane_efficiency", 100, "lanes in use", "% of the FLOPs")


def flops(phase: registry.Phase) -> Panel:
    found = _file("counts.json")
    counts = [(one, one.flops.machine) for one in found.declared if one.flops]
    counts += [(one, one.total.machine) for one in found.measured if one.variant == "shipped"]

    def a_pixel(name: str, scene: str) -> float | None:
        """Declared; where there are no costs, as measured."""
        mine = (n / (one.width * one.height) for one, n in counts if (one.phase, one.scene) == (name, scene))
        return next(mine, None)

    scenes = ("scene0", "mandelbulb")
    rows = [Row(scene, [_value(a_pixel(name, scene)) for name in _both(phase)]) for scene in scenes]
    return Panel("bars", "operations (FLOPs)", "a pixel", _both(phase), rows)


def hottest(phase: registry.Phase) -> Panel:
    """Share of the frame's samples in each function of the shipped build."""
    wanted = (phase.name, "shipped", "scene0")
    profiles = _file("hotspots.json").profiles
    (profile,) = [one for one in profiles if (one.phase, one.variant, one.scene) == wanted]
    found = sorted(profile.functions, key=lambda one: -one.share)[:8]
    rows = [
        Row(one.function, [_value(100 * one.share, 100 * one.share_low, 100 * one.share_high)])
        for one in found
    ]
    return Panel("bars", "where a frame of scene0 goes", "% of the samples", [phase.name], rows)


def steps(phase: registry.Phase) -> Panel:
    """Gain of each single step between the parent and the phase, on scene0."""

    def between(one: Any) -> bool:
        of = one.ablation.partition("+")[0]
        return of == phase.parent or (of == phase.name and (one.against != of or one.step == "removed"))

    found = [one for one in _file("ablations.json").rows if one.scene == "scene0" and between(one)]
    rows = [Row(STEPS.get(one.ablation, one.ablation), [_found(one.gain)]) for one in found]
    return Panel("bars", "gain of each step, scene0", "× over the step before", [phase.name], rows)


def threads(phase: registry.Phase) -> Panel:
    mine = [row for row in _ladder(THREADS) if row.phase == phase.name]
    times = {(row.scene, row.threads): _ms(row) for row in mine}
    rows = [
        Row(scene, [times[scene, 1], times[scene, 2]]) for scene in dict.fromkeys(row.scene for row in mine)
    ]
    size = f"{mine[0].width}×{mine[0].height}"
    return Panel("pairs", f"time of a frame, {size}", "ms", ["one thread", "two threads"], rows)


def paid(_: registry.Phase) -> Panel:
    """Frames until the time of compiling a kernel is won back."""
    found = [one for one in _file("breakeven.json").rows if one.break_even_frames]
    rows = [Row(one.scene, [_found(one.break_even_frames)]) for one in found if one.break_even_frames.value]
    return Panel("bars", "compiling is paid after", "frames at height 720", ["opt10_scene"], rows)


def to_truth(_: registry.Phase) -> Panel:
    """How near each phase's picture is to the exact one, on two scenes of solids."""
    scenes, every = ("scene0", "trio"), accuracy.rows(RUN)
    found = {(one.phase, one.scene): one for one in every}
    rows = [
        Row(name, [_value(found[name, scene].psnr_db) for scene in scenes])
        for name in registry.ladder()
        if all((name, scene) in found for scene in scenes)
    ]
    return Panel("bars", f"PSNR to ground truth, height {every[0].height}", "dB", scenes, rows)


def _rods() -> list[Any]:
    return sorted(_file("rods.json").rows, key=lambda row: row.scene)


def rods_times(_: registry.Phase) -> Panel:
    rows = [Row(row.scene, [_ms(row.pixels), _ms(row.rods)]) for row in _rods()]
    return Panel("pairs", f"the march alone, height {_rods()[0].n}", "ms", ["per pixel", "rods"], rows)


def rods_errors(_: registry.Phase) -> Panel:
    rows = [Row(row.scene, [_value(row.pixels.psnr_db), _value(row.rods.psnr_db)]) for row in _rods()]
    return Panel("bars", "PSNR to ground truth", "dB", ["per pixel", "rods"], rows)


def throttled(_: registry.Phase) -> Panel:
    found = sorted((row for row in _file("throttle.json").rows if row.large), key=lambda row: row.scene)
    rows = [Row(row.scene, [_ms(row.large.plain), _ms(row.large.chosen)]) for row in found]
    series = ["packets alone", "rods, then packets"]
    return Panel("pairs", f"time of a frame, height {found[0].large.n}", "ms", series, rows)


def rates(_: registry.Phase) -> Panel:
    names = {
        "primary": "camera",
        "shadow": "to the light",
        "mirror": "mirrored",
        "scattered": "any direction",
    }
    rows = []
    for row in _file("packets.json").rays:
        own = next(one for one in row.variants if one.name == "own")
        embree = max(filter(None, (row.embree16, row.embree1, row.embree_stream)), key=lambda way: way.mrays)
        values = [_value(one.mrays, one.mrays_low, one.mrays_high) for one in (embree, own)]
        rows.append(Row(f"{row.scene}, {names.get(row.kind, row.kind)}", values))
    series = ["Embree 3, its fastest way", "packets"]
    return Panel("pairs", "rays traced", "million a second", series, rows)


def bits(_: registry.Phase) -> Panel:
    names = {"article": "the article's roots", "2": "two Newton steps", "3": "three Newton steps"}
    found = _file("fixed.json").sweep
    rows = []
    for count in sorted({row.bits for row in found}):
        of = {str(row.roots): row.psnr_db for row in found if row.bits == count}
        rows.append(Row(str(count), [_value(of.get(name)) for name in names]))
    return Panel("lines", "bits of fraction", "PSNR to ground truth, dB", list(names.values()), rows)


def _fixed(names: Sequence[str], value: Callable[[Any], Value]) -> list[Row]:
    found = {row.case: row for row in _file("fixed.json").rows}
    labels = {"article, 1 lane": "the article, 1 lane"}
    return [
        Row(labels.get(name) or (name if "float" in name else f"integers, {name}"), [value(found[name])])
        for name in names
    ]


def fixed_lanes(_: registry.Phase) -> Panel:
    rows = _fixed(["article, 1 lane", "1 lane", "8 lanes", "16 lanes"], _ms)
    return Panel("bars", "time of a frame, spheres40, height 180", "ms", ["integers"], rows)


FIXED_CASES = ("8 lanes", "16 lanes", "16 lanes, 28 bits", "float, 8 lanes", "float, 16 lanes")


def fixed_times(_: registry.Phase) -> Panel:
    return Panel("bars", "time of a frame, spheres40", "ms", ["time"], _fixed(FIXED_CASES, _ms))


def fixed_errors(_: registry.Phase) -> Panel:
    rows = _fixed(FIXED_CASES, lambda row: _value(row.psnr_db))
    return Panel("bars", "PSNR to ground truth", "dB", ["error"], rows)


PANELS: dict[str, tuple[str, list[Callable[[registry.Phase], Panel]]]] = {
    "baseline": ("Most of the frame is not geometry", [hottest]),
    "opt1": ("Work that depends on the scene alone is done once", [headline_times, steps]),
    "opt2": ("Fewer operations, and no calls between them", [headline_times, flops]),
    "opt3": ("Four rays in the lanes of one register", [headline_times, lanes]),
    "opt4": ("Eight rays in single precision", [scene_times, lanes]),
    "opt5_threads": ("Tiles for every core", [threads]),
    "opt6_wide": ("Wider registers, and shapes that sleep", [scene_times, flops]),
    "opt7_tiles": ("Cones find what a tile can see", [scene_times, flops]),
    "opt8_streams": ("Rays that wait fill whole packets", [scene_times, flops, lanes]),
    "opt9_convex": ("Closed forms where a march is not needed", [scene_times, flops]),
    "opt10_scene": ("A kernel compiled for the scene", [scene_times, paid]),
    "opt11_ideal": ("The shadow of the scene, not of the march", [large_times, to_ideal]),
    "opt12_fused": ("Rows in registers, from direction to store", [large_times]),
    "truth": ("How far each phase is from the exact picture", [to_truth]),
    "rods": ("Neighbours share their early steps", [rods_times, rods_errors]),
    "rods_simd": ("Rods hand over to packets", [throttled]),
    "packets": ("Rays by packets, beside Embree", [rates]),
    "fixed": ("How many bits a picture needs", [bits]),
    "fixed_simd": ("Integers in lanes", [fixed_lanes]),
    "fixed_float": ("The same rays in floats", [fixed_times, fixed_errors]),
}


def figure(name: str) -> Figure | None:
    """What the figure of a phase shows; None for a phase that the published run does not have."""
    phase = registry.find_phase(name)
    if name not in PANELS:
        return None
    title, makers = PANELS[name]
    made = [make(phase) for make in makers]
    study = systems() if phase.family == registry.SYSTEMS else RUN
    run = {threads: THREADS, large_times: LARGE}.get(makers[0], study)
    said = [machine.name(Run(run).context)]
    if any(panel.unit in ("ms", "million a second") for panel in made) and run != THREADS:
        said[0] += ", one thread"
    if any(value.low is not None for panel in made for row in panel.rows for value in row.values):
        said.append("bars: 95 % intervals")
    if any(panel.kind == "pairs" for panel in made):
        said.append("×: ratio of the medians")
    caption = f"{'; '.join(said)}. {run.relative_to(registry.ROOT)}"
    return Figure(name, title, caption, made)
