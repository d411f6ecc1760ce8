"""The figure of each phase's NOTES.md: phases/NAME/lesson.svg, made from a published run.

A figure is data first (`figure`: panels of rows, rounded to five digits), and a drawing of that data second
(`lessons_svg`). The SVG carries the data as JSON: a test compares that with the run, and not the drawing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from study.bounds import work
from study.core import machine, registry, store
from study.core.cli import StudyError
from study.core.store import Run
from study.counting.schema import Counts
from study.numbers import analysis, ladder

REFERENCE = registry.ROOT / "results" / "reference"
RUN = REFERENCE / "zen5-2026-11-25"  # the study that the figures are of
LARGE = REFERENCE / "zen4-2026-11-27-720p"  # the ladder at 1280×720
THREADS = REFERENCE / "zen5-2026-11-25-threads"  # one thread beside two
NAME = "lesson.svg"
METADATA = "{http://www.w3.org/2000/svg}metadata"
STEPS = {  # ablations by the step that they are
    "baseline+1_precomputed": "sin and cos once",
    "baseline+2_zero_skip": "zero angles skipped",
    "baseline+3_inlined": "transform inlined",
    "opt1+pointers": "vectors by pointer",
    "opt1+scene_by_value": "scene by pointer",
}
Value = list[float | None]  # value, lower and upper end of its 95 % interval (none: null)
Row = dict[str, Any]
Panel = dict[str, Any]


def _rounded(value: float | None) -> float | None:
    """To five significant digits; None for what is no number."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.5g}")


def _value(value: float | None, low: float | None = None, high: float | None = None) -> Value:
    return [_rounded(value), _rounded(low), _rounded(high)]


def _ms(row: Mapping[str, Any], name: str = "ms") -> Value:
    return _value(row[name], row.get(f"{name}_low"), row.get(f"{name}_high"))


def _found(found: Mapping[str, Any]) -> Value:
    """Of a statistic as the run's files have it: value, low, high."""
    return _value(found["value"], found["low"], found["high"])


@cache
def _ladder(run: Path) -> list[Row]:
    return ladder.rows(analysis.load(run)).to_dict("records")


@cache
def _file(name: str) -> Any:
    return store.read_json(store.stored(RUN / name))


def _panel(kind: str, title: str, unit: str, series: Sequence[str], rows: Iterable[Row]) -> Panel:
    return {"kind": kind, "title": title, "unit": unit, "series": list(series), "rows": list(rows)}


def headline_times(phase: registry.Phase, run: Path = RUN) -> Panel:
    """Frame time of the parent and of the phase, on the scenes and at the size of the run's ladder."""
    own = [row for row in _ladder(run) if row["headline"] and row["threads"] == 1]
    times = {(row["phase"], row["scene"]): row for row in own}
    scenes = dict.fromkeys(row["scene"] for row in own)
    rows = [
        {"label": scene, "values": [_ms(times[phase.parent, scene]), _ms(times[phase.name, scene])]}
        for scene in scenes
        if (phase.parent, scene) in times and (phase.name, scene) in times
    ]
    size = f"{own[0]['width']}×{own[0]['height']}"
    return _panel("pairs", f"time of a frame, {size}", "ms", [phase.parent or "", phase.name], rows)


def large_times(phase: registry.Phase) -> Panel:
    """The same at 1280×720."""
    return headline_times(phase, LARGE)


def to_ideal(phase: registry.Phase) -> Panel:
    """How near the pictures of the parent and of the phase are to the one with the ideal soft shadow."""
    both = [phase.parent or "", phase.name]
    found = store.read_json(store.stored(LARGE / "accuracy.json"))["rows"]
    near = {(one["phase"], one["scene"]): one.get("antialiased", one)["psnr_ideal_db"] for one in found}
    scenes = dict.fromkeys(one["scene"] for one in found)
    rows = [{"label": scene, "values": [_value(near[name, scene]) for name in both]} for scene in scenes]
    title = f"PSNR to the ideal picture, height {found[0]['height']}"
    return _panel("bars", title, "dB", both, rows)


def scene_times(phase: registry.Phase) -> Panel:
    """The same on every scene, at the size of the run's views."""
    own = [row for row in _file("views.json")["rows"] if row["view"] == "own"]
    times = {(row["phase"], row["scene"]): _found(row["ms"]) for row in own}
    scenes = [row["scene"] for row in own if row["phase"] == phase.name]
    rows = [
        {"label": scene, "values": [times[phase.parent, scene], times[phase.name, scene]]}
        for scene in sorted(scenes)
        if (phase.parent, scene) in times
    ]
    height = _file("views.json")["n"]
    return _panel("pairs", f"time of a frame, height {height}", "ms", [phase.parent or "", phase.name], rows)


def _counted(phase: registry.Phase, name: str, scale: float, title: str, unit: str) -> Panel:
    declared = Counts.load(RUN / "counts.json").declared
    rows = []
    for scene in ("scene0", "mandelbulb"):
        height = next(row["height"] for row in _ladder(RUN) if row["scene"] == scene and row["headline"])
        both = [work.counted(declared, one, scene, height) for one in (phase.parent or "", phase.name)]
        if all(both):
            values = [_value(scale * getattr(one, name)) for one in both]
            rows.append({"label": scene, "values": values})
    return _panel("bars", title, unit, [phase.parent or "", phase.name], rows)


def evaluations(phase: registry.Phase) -> Panel:
    """Evaluations of a distance a pixel, of the parent and of the phase."""
    return _counted(phase, "evals_per_pixel", 1, "distance evaluations", "a pixel")


def lanes(phase: registry.Phase) -> Panel:
    """Share of the FLOPs whose lane was in use, of the parent and of the phase."""
    return _counted(phase, "lane_efficiency", 100, "lanes in use", "% of the FLOPs")


def flops(phase: registry.Phase) -> Panel:
    """FLOPs of a pixel, of the parent and of the phase."""
    found = Counts.load(RUN / "counts.json")
    shipped = (one for one in found.measured if one.variant == "shipped")
    counts = [(one, one.flops.machine) for one in found.declared if one.flops]
    counts += [(one, one.total.machine) for one in shipped]

    def a_pixel(name: str, scene: str) -> float | None:
        """Declared; where there are no costs, as measured."""
        mine = (n / (one.width * one.height) for one, n in counts if (one.phase, one.scene) == (name, scene))
        return next(mine, None)

    rows = [
        {
            "label": scene,
            "values": [_value(a_pixel(name or "", scene)) for name in (phase.parent, phase.name)],
        }
        for scene in ("scene0", "mandelbulb")
    ]
    return _panel("bars", "operations (FLOPs)", "a pixel", [phase.parent or "", phase.name], rows)


def hottest(phase: registry.Phase) -> Panel:
    """Share of the frame's samples in each function of the shipped build."""
    (profile,) = [
        one
        for one in _file("hotspots.json")["profiles"]
        if (one["phase"], one["variant"], one["scene"]) == (phase.name, "shipped", "scene0")
    ]
    found = sorted(profile["functions"], key=lambda one: -one["share"])[:8]
    rows = [
        {
            "label": one["function"],
            "values": [_value(100 * one["share"], 100 * one["share_low"], 100 * one["share_high"])],
        }
        for one in found
    ]
    return _panel("bars", "where a frame of scene0 goes", "% of the samples", [phase.name], rows)


def steps(phase: registry.Phase) -> Panel:
    """Gain of each single step between the parent and the phase, on scene0."""

    def between(one: Row) -> bool:
        of = one["ablation"].partition("+")[0]
        return of == phase.parent or (of == phase.name and (one["against"] != of or one["step"] == "removed"))

    rows = [
        {"label": STEPS.get(one["ablation"], one["ablation"]), "values": [_found(one["gain"])]}
        for one in _file("ablations.json")["rows"]
        if one["scene"] == "scene0" and between(one)
    ]
    return _panel("bars", "gain of each step, scene0", "× over the step before", [phase.name], rows)


def threads(phase: registry.Phase) -> Panel:
    """Frame time on one and on two threads."""
    mine = [row for row in _ladder(THREADS) if row["phase"] == phase.name]
    times = {(row["scene"], row["threads"]): row for row in mine}
    rows = [
        {"label": scene, "values": [_ms(times[scene, 1]), _ms(times[scene, 2])]}
        for scene in dict.fromkeys(row["scene"] for row in mine)
    ]
    size = f"{mine[0]['width']}×{mine[0]['height']}"
    return _panel("pairs", f"time of a frame, {size}", "ms", ["one thread", "two threads"], rows)


def paid(_: registry.Phase) -> Panel:
    """Frames until the time of compiling a kernel is won back."""
    rows = [
        {"label": row["scene"], "values": [_found(row["break_even_frames"])]}
        for row in _file("breakeven.json")["rows"]
        if row.get("break_even_frames") and row["break_even_frames"]["value"]
    ]
    return _panel("bars", "compiling is paid after", "frames at height 720", ["opt10_scene"], rows)


def to_truth(_: registry.Phase) -> Panel:
    """How near each phase's picture is to the exact one, on two scenes of solids."""
    scenes = ("scene0", "trio")
    found = {(one["phase"], one["scene"]): one for one in _file("accuracy.json")["rows"]}
    rows = [
        {"label": name, "values": [_value(found[name, scene]["psnr_db"]) for scene in scenes]}
        for name in registry.ladder()
        if all((name, scene) in found for scene in scenes)
    ]
    height = next(iter(found.values()))["height"]
    return _panel("bars", f"PSNR to ground truth, height {height}", "dB", scenes, rows)


def rods_times(_: registry.Phase) -> Panel:
    rows = [
        {"label": row["scene"], "values": [_ms(row["pixels"]), _ms(row["rods"])]}
        for row in sorted(_file("rods.json")["rows"], key=lambda row: row["scene"])
    ]
    height = _file("rods.json")["rows"][0]["n"]
    return _panel("pairs", f"the march alone, height {height}", "ms", ["per pixel", "rods"], rows)


def rods_errors(_: registry.Phase) -> Panel:
    rows = [
        {"label": row["scene"], "values": [_value(row[one]["psnr_db"]) for one in ("pixels", "rods")]}
        for row in sorted(_file("rods.json")["rows"], key=lambda row: row["scene"])
    ]
    return _panel("bars", "PSNR to ground truth", "dB", ["per pixel", "rods"], rows)


def throttled(_: registry.Phase) -> Panel:
    found = sorted(_file("throttle.json")["rows"], key=lambda row: row["scene"])
    rows = [
        {"label": row["scene"], "values": [_ms(row["large"]["plain"]), _ms(row["large"]["chosen"])]}
        for row in found
    ]
    height = found[0]["large"]["n"]
    series = ["packets alone", "rods, then packets"]
    return _panel("pairs", f"time of a frame, height {height}", "ms", series, rows)


def rates(_: registry.Phase) -> Panel:
    names = {
        "primary": "camera",
        "shadow": "to the light",
        "mirror": "mirrored",
        "scattered": "any direction",
    }
    rows = []
    for row in _file("packets.json")["rays"]:
        own = next(one for one in row["variants"] if one["name"] == "own")
        ways = [row[way] for way in ("embree16", "embree1", "embree_stream") if row.get(way)]
        embree = max(ways, key=lambda way: way["mrays"])
        rows.append(
            {
                "label": f"{row['scene']}, {names.get(row['kind'], row['kind'])}",
                "values": [_ms(embree, "mrays"), _ms(own, "mrays")],
            }
        )
    series = ["Embree 3, its fastest way", "packets"]
    return _panel("pairs", "rays traced", "million a second", series, rows)


def bits(_: registry.Phase) -> Panel:
    names = {"article": "the article's roots", "2": "two Newton steps", "3": "three Newton steps"}
    found = _file("fixed.json")["sweep"]
    rows = []
    for count in sorted({row["bits"] for row in found}):
        of = {str(row["roots"]): row.get("psnr_db") for row in found if row["bits"] == count}
        rows.append({"label": str(count), "values": [_value(of.get(name)) for name in names]})
    return _panel("lines", "bits of fraction", "PSNR to ground truth, dB", list(names.values()), rows)


def _fixed(names: Sequence[str], key: str) -> list[Row]:
    found = {row["case"]: row for row in _file("fixed.json")["rows"]}
    return [
        {
            "label": name
            if "float" in name
            else f"integers, {name}".replace("integers, article", "the article"),
            "values": [_ms(found[name]) if key == "ms" else _value(found[name][key])],
        }
        for name in names
    ]


def fixed_lanes(_: registry.Phase) -> Panel:
    rows = _fixed(["article, 1 lane", "1 lane", "8 lanes", "16 lanes"], "ms")
    return _panel("bars", "time of a frame, spheres40, height 180", "ms", ["integers"], rows)


FIXED_CASES = ("8 lanes", "16 lanes", "16 lanes, 28 bits", "float, 8 lanes", "float, 16 lanes")


def fixed_times(_: registry.Phase) -> Panel:
    return _panel("bars", "time of a frame, spheres40", "ms", ["time"], _fixed(FIXED_CASES, "ms"))


def fixed_errors(_: registry.Phase) -> Panel:
    return _panel("bars", "PSNR to ground truth", "dB", ["error"], _fixed(FIXED_CASES, "psnr_db"))


PANELS: dict[str, tuple[str, list[Callable[[registry.Phase], Panel]]]] = {
    "baseline": ("Most of the frame is not geometry", [hottest]),
    "opt1": ("Work that depends on the scene alone is done once", [headline_times, steps]),
    "opt2": ("Fewer operations, and no calls between them", [headline_times, flops]),
    "opt3": ("Four rays in the lanes of one register", [headline_times, lanes]),
    "opt4": ("Eight rays in single precision", [scene_times, lanes]),
    "opt5_threads": ("Tiles for every core", [threads]),
    "opt6_wide": ("Wider registers, and shapes that sleep", [scene_times, evaluations]),
    "opt7_tiles": ("Cones find what a tile can see", [scene_times, evaluations]),
    "opt8_streams": ("Rays that wait fill whole packets", [scene_times, evaluations, lanes]),
    "opt9_convex": ("Closed forms where a march is not needed", [scene_times, evaluations]),
    "opt10_scene": ("A kernel compiled for the scene", [scene_times, paid]),
    "opt11_ideal": ("The shadow of the scene, not of the march", [large_times, to_ideal]),
    "truth": ("How far each phase is from the exact picture", [to_truth]),
    "rods": ("Neighbours share their early steps", [rods_times, rods_errors]),
    "rods_simd": ("Rods hand over to packets", [throttled]),
    "packets": ("Rays by packets, beside Embree", [rates]),
    "fixed": ("How many bits a picture needs", [bits]),
    "fixed_simd": ("Integers in lanes", [fixed_lanes]),
    "fixed_float": ("The same rays in floats", [fixed_times, fixed_errors]),
}


def figure(name: str) -> Row | None:
    """What the figure of a phase shows; None for a phase that the published run does not have."""
    phase = registry.find_phase(name)
    if name not in PANELS:
        return None
    title, panels = PANELS[name]
    made = [panel(phase) for panel in panels]
    run = {threads: THREADS, large_times: LARGE}.get(panels[0], RUN)
    said = [machine.name(Run(run).context)]
    if any(panel["unit"] in ("ms", "million a second") for panel in made) and run != THREADS:
        said[0] += ", one thread"
    if any(value[1] is not None for panel in made for row in panel["rows"] for value in row["values"]):
        said.append("bars: 95 % intervals")
    if any(panel["kind"] == "pairs" for panel in made):
        said.append("×: ratio of the medians")
    caption = f"{'; '.join(said)}. {run.relative_to(registry.ROOT)}"
    return {"phase": name, "title": title, "caption": caption, "panels": made}


def embedded(path: Path) -> Row:
    """The data in a figure's file. Raises StudyError for another file."""
    try:
        found = ElementTree.parse(path).getroot().find(METADATA)
        return json.loads((found.text or "") if found is not None else "")
    except (OSError, ElementTree.ParseError, json.JSONDecodeError) as error:
        raise StudyError(f"{path}: no figure of scripts/stepwise lessons ({error})") from None
