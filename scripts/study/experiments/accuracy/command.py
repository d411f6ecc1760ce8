"""Error of every phase to the exact picture, scene by scene."""

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from study.core import cli, progress, registry
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED, DriverError
from study.experiments import running, shards
from study.experiments.accuracy import tables
from study.numbers.accuracy import FILE, Accuracy, Left, Row
from study.pictures import gate, images
from study.pictures.gallery import Gallery
from study.truth import judging
from study.truth.subject import BASE, FLOAT, Subject

DESCRIPTION = """\
Each phase's picture is held against truth's, below the picture first. Phases behind opt4 are gated: on no
metric may one be further from truth than baseline (from the ideal shadow: than baseline or the estimator in
exact arithmetic; from a fractal's march in exact arithmetic: than baseline or opt4), but for what its
phase.json grants (tolerance.truth, with a reason); in |Δt| over as many of the true hits as baseline has.
A phase that draws the ideal shadow (tolerance.ideal) is judged by that and not by the estimator's picture.
baseline to opt4, and what is not on the ladder, are shown; scripts/stepwise verify has their gate. A
Mandelbulb's exact surface is proved, too: how far each phase is from it is shown and gates none."""
STATUSES = {
    1: "a gated phase is further from truth than baseline, or a picture is not finite or not there",
    3: "no phase could run on this CPU",
}
FAMILY = "truth"  # of the phases that are what the others are held against
Refused = Mapping[tuple[Spec, str], DriverError]  # by program and scene


def options(parser: argparse.ArgumentParser) -> None:
    add, whole = parser.add_argument, cli.at_least(1)
    cores = len(os.sched_getaffinity(0))
    add("--phase", nargs="+", metavar="PHASE", help="e.g. opt4, or opt2@opt4; default: all")
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    add("-n", type=whole, default=720, metavar="HEIGHT", help="height in pixels; default: 720")
    add("-w", type=whole, metavar="WIDTH", help="width in pixels; default: 16:9, two_spheres square")
    add("--run", type=Path, metavar="DIR", help="for accuracy.json and images/; default: build/accuracy")
    add("--jobs", type=whole, default=cores, help="pictures rendered at a time; default: CPUs")
    parser.set_defaults(home="accuracy")
    shards.option(parser, "pairs of scene and phase")


def units(args: argparse.Namespace) -> list[tuple[Scene, Spec]]:
    """What is to be measured, in order. Raises StudyError for names that there are not."""
    specs = specs_of(args.phase)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]
    return [(scene, spec) for scene in scenes for spec in specs]


def specs_of(names: list[str] | None) -> list[Spec]:
    """The specs asked for, or every phase but truth itself. Raises StudyError."""
    specs = [Spec.parse(name) for name in dict.fromkeys(names or list(registry.ladder()))]
    for spec in specs:
        phase = registry.find_phase(spec.phase)
        gate.check(phase)
        if phase.family == FAMILY:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be held against it")
    return specs


def judge(subject: Subject, specs: list[Spec], refused: Refused) -> tuple[list[Row], list[Left]]:
    rows, missing = [], []
    for spec in progress.each(specs, f"compare {subject.scene.name}"):
        if error := _trouble(refused, spec, subject.scene, subject.plain):
            missing.append(_left(spec, subject.scene, error))
        else:
            rows.append(subject.row(spec))
    return rows, missing


def _trouble(refused: Refused, spec: Spec, *scenes: Scene) -> DriverError | None:
    return next((refused[spec, scene.name] for scene in scenes if (spec, scene.name) in refused), None)


def _left(spec: Spec, scene: Scene, error: DriverError, who: str = "") -> Left:
    failed = error.status not in (NO_ISA, UNSUPPORTED)
    return Left(phase=str(spec), scene=scene.name, reason=f"{who}{error.message}", failed=failed)


def compared(
    args: argparse.Namespace, chosen: list[tuple[Scene, Spec]], gated: bool, folder: Path
) -> tuple[list[Row], list[Left]]:
    """Pictures of all that is chosen, rendered together; then rows, and what could not be had."""
    mine: dict[str, list[Spec]] = {}
    for scene, spec in chosen:
        mine.setdefault(scene.name, []).append(spec)
    scenes = list({scene.name: scene for scene, _ in chosen}.values())
    # Every row of a fractal is held against it: if any of all phases is gated, whatever the shard has.
    beside = [FLOAT] if gated or any(spec == FLOAT for _, spec in chosen) else []
    drawn = {
        scene.name: dict.fromkeys([BASE, *(beside if scene.fractal else []), *mine[scene.name]])
        for scene in scenes
    }
    using = dict.fromkeys(spec for some in drawn.values() for spec in some)
    gallery = Gallery(folder / "images", list(using))
    plain = {scene.name: judging.without_shadows(scene, folder / "scenes") for scene in scenes}
    sizes = {scene.name: scene.size(args.n, args.w) for scene in scenes}
    tasks = [
        (who, one, sizes[scene.name])
        for scene in scenes
        for who in drawn[scene.name]
        for one in (scene, plain[scene.name])
    ]
    refused = gallery.render_all(tasks, args.jobs)
    rows: list[Row] = []
    skipped: list[Left] = []
    for scene in scenes:
        bare = plain[scene.name]
        if error := _trouble(refused, BASE, scene, bare):
            skipped += [_left(spec, scene, error, "baseline: ") for spec in mine[scene.name]]
            continue
        known = scene.fractal and FLOAT in gallery.hashes and not _trouble(refused, FLOAT, scene, bare)
        subject = Subject(gallery, scene, bare, sizes[scene.name], [FLOAT] if known else [])
        found, missing = judge(subject, mine[scene.name], refused)
        rows, skipped = rows + found, skipped + missing
    return rows, skipped


def measure(args: argparse.Namespace) -> Outcome:
    everything = units(args)
    specs = list(dict.fromkeys(spec for _, spec in everything))
    lacking = {spec: " ".join(registry.missing_isa(spec)) for spec in specs}
    gated = any(gate.by_truth(registry.find_phase(spec.phase)) for spec in specs if not lacking[spec])
    chosen = [(scene, spec) for scene, spec in shards.part(everything, args.shard) if not lacking[spec]]
    folder = running.folder(args, FILE, gallery="images")
    rows, left = compared(args, chosen, gated, folder)
    unable = [Left(phase=str(s), reason=f"this CPU lacks {what}") for s, what in lacking.items() if what]
    result = Accuracy(
        flip_tool=images.FLIP_TOOL, picture_tool=images.PICTURE_TOOL, rows=rows, skipped=[*unable, *left]
    )
    shards.write(folder, FILE, result, args.shard)
    return _told(result, folder, drawn=not args.shard)


def _told(result: Accuracy, folder: Path, drawn: bool) -> Outcome:
    lines: list[Any] = []
    if result.rows:
        lines = [*tables.lines(result), f"FLIP: {images.FLIP_TOOL}.", f"Pictures: {folder}/images"]
    if result.rows and drawn:
        lines += running.draw(folder, tables.drawings(result))
    remarks: list[str] = []
    failed: list[str] = []
    for one in result.skipped:
        text = f"{one.phase}{f' on {one.scene}' if one.scene else ''}: {one.reason}"
        (failed if one.failed else remarks).append(text if one.failed else f"skipped {text}")
    failed += [
        f"{row.phase} on {row.scene}: {'; '.join(row.why)} (picture: {folder / str(row.picture)})"
        for row in result.rows
        if row.failed
    ]
    status = None if result.rows or failed else cli.CANNOT_RUN
    return Outcome(result, lines, folder, remarks, failed, status)
