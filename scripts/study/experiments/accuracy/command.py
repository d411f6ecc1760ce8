"""Error of every phase to truth, per scene: hits, shapes, distances, normals, shadows, colours, and where."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import matplotlib

from study.core import cli, progress, registry, store
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED
from study.experiments import shards
from study.experiments.accuracy import converge
from study.experiments.accuracy import tables as accuracy_page
from study.numbers import accuracy
from study.pictures import draw, gate, images
from study.pictures.gallery import Gallery, Size
from study.truth import judging
from study.truth.subject import BASE, FLOAT, Subject

DESCRIPTION = """\
Each phase's picture is held against truth's, below the picture first. Rungs behind opt4 are gated: on no
metric may one be further from truth than baseline (from the ideal shadow: than baseline or the estimator in
exact arithmetic; from a truth that is converged only: than baseline or opt4), but for what its phase.json
grants (tolerance.truth, with a reason); in |Δt| over as many of the true hits as baseline has. A phase that
draws the ideal shadow (tolerance.ideal) is judged by that and not by the estimator's picture. baseline to
opt4, and what is not on the ladder, are shown; scripts/stepwise verify has their gate."""
FAMILY = "truth"  # of the phases that are what the others are held against


def arguments() -> argparse.Namespace:
    cores = len(os.sched_getaffinity(0))
    about = "a gated phase is further from truth than baseline, or a picture is not finite or not there"
    parser = cli.parser(DESCRIPTION, {1: about, 3: "no phase could run on this CPU"})
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="e.g. opt4, or opt2@opt4; default: all")
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    add("-n", type=cli.at_least(1), default=720, metavar="HEIGHT", help="height in pixels; default: 720")
    add(
        "-w", type=cli.at_least(1), metavar="WIDTH", help="width in pixels; default: 16:9, two_spheres square"
    )
    add("--run", type=Path, metavar="DIR", help="for accuracy.json and images/; default: build/accuracy")
    add(
        "--jobs",
        type=cli.at_least(1),
        default=cores,
        help="pictures rendered at a time; default: CPUs",
    )
    add("--convergence", action="store_true", help="the Mandelbulb's table too: precision × hit distance")
    add("--convergence-n", type=cli.at_least(1), default=90, metavar="HEIGHT", help="its height; default: 90")
    shards.option(parser, "pairs of scene and phase")
    return parser.parse_args()


def pairs(args: argparse.Namespace) -> list[tuple[Scene, Spec]]:
    """What is to be measured, in order. Raises StudyError for names that there are not."""
    specs = specs_of(args.phase)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]
    return [(scene, spec) for scene in scenes for spec in specs]


def units(args: argparse.Namespace) -> list[tuple[Scene, Spec]]:
    """What is parted for shards. Raises StudyError."""
    if args.convergence:
        raise StudyError("--convergence is no part of a shard: measure it in a run without --shard")
    return pairs(args)


def specs_of(names: list[str] | None) -> list[Spec]:
    """The specs asked for, or every phase but truth itself. Raises StudyError."""
    wanted = names or list(registry.ladder())
    specs = [Spec.parse(name) for name in dict.fromkeys(wanted)]
    for spec in specs:
        phase = registry.find_phase(spec.phase)
        gate.check(phase)
        if phase.family == FAMILY:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be held against it")
    return specs


def judge(
    gallery: Gallery, scene: Scene, plain: Scene, size: Size, specs: list[Spec], refused: dict
) -> tuple:
    """Rows of a scene, and what could not be had: with its reason, and whether that is a failure."""
    rows, missing = [], []

    def missed(spec: Spec, reason: str, failed: bool = False) -> None:
        missing.append({"phase": str(spec), "scene": scene.name, "reason": reason, "failed": failed})

    def trouble(spec: Spec):
        return refused.get((spec, scene.name)) or refused.get((spec, plain.name))

    if error := trouble(BASE):
        for spec in specs:
            missed(spec, f"baseline: {error.message}", error.status not in (NO_ISA, UNSUPPORTED))
        return rows, missing
    known = scene.fractal and FLOAT in gallery.hashes and not trouble(FLOAT)
    subject = Subject(gallery, scene, plain, size, [FLOAT] if known else [])
    for spec in progress.each(specs, f"compare {scene.name}"):
        if error := trouble(spec):
            missed(spec, error.message, error.status not in (NO_ISA, UNSUPPORTED))
        else:
            rows.append(subject.row(spec))
    return rows, missing


def main() -> int:
    args = arguments()
    everything = units(args) if args.shard else pairs(args)
    chosen = shards.part(everything, args.shard)
    specs = list(dict.fromkeys(spec for _, spec in everything))
    lacking = {spec: " ".join(registry.missing_isa(spec)) for spec in specs}
    able = [spec for spec in specs if not lacking[spec]]
    skipped = [
        {"phase": str(s), "scene": None, "reason": f"this CPU lacks {lacking[s]}", "failed": False}
        for s in specs
        if lacking[s]
    ]
    folder = args.run or registry.ROOT / "build" / "accuracy"
    mine = {
        scene.name: [spec for other, spec in chosen if other.name == scene.name and spec in able]
        for scene, _ in chosen
    }
    scenes = [scene for scene in {s.name: s for s, _ in chosen}.values() if mine[scene.name]]
    gated = any(gate.by_truth(registry.find_phase(spec.phase)) for spec in able)
    # Every row of a fractal is held against it: if any of all phases is gated, whatever the shard has.
    beside = [FLOAT] if gated or FLOAT in able else []
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
    rows: list[dict] = []
    for scene in scenes:
        name = scene.name
        found, missing = judge(gallery, scene, plain[name], sizes[name], mine[name], refused)
        rows, skipped = rows + found, skipped + missing
    tools = {"flip_tool": images.FLIP_TOOL, "picture_tool": images.PICTURE_TOOL}
    result = {"schema": 1, **tools, "rows": rows, "skipped": skipped, "convergence": None}
    if args.convergence:
        result["convergence"] = converge.study(args.convergence_n, folder / "convergence")
    name = shards.file_name(accuracy.FILE, args.shard)
    store.write_json(folder / name, shards.marked(result, args.shard))
    report(args, result, folder)
    if not rows:
        return cli.CANNOT_RUN if not any(item["failed"] for item in skipped) else cli.FAILED
    return cli.FAILED if any(item["failed"] for item in (*rows, *skipped)) else cli.OK


def report(args: argparse.Namespace, result: dict, folder: Path) -> None:
    """JSON or tables; then what was skipped and what failed."""
    figures = []
    if result["rows"] and not args.shard:
        with matplotlib.rc_context(draw.STYLE):
            for name, make in accuracy_page.drawings(result).items():
                figures += draw.save(make(), folder / "figures" / name, accuracy_page.note(result))
    if args.json:
        cli.emit(result, folder)
    elif result["rows"]:
        print(accuracy_page.text(result))
        places = f"Pictures: {folder}/images" + ("" if args.shard else f", figures: {folder}/figures")
        print(f"FLIP: {images.FLIP_TOOL}.\n{places}")
    for item in result["skipped"]:
        word = "FAIL" if item["failed"] else "skipped"
        cli.say(f"{word} {item['phase']}{' on ' + item['scene'] if item['scene'] else ''}: {item['reason']}")
    for row in result["rows"]:
        if row["failed"]:
            picture = folder / row["picture"]
            cli.say(f"FAIL {row['phase']} on {row['scene']}: {'; '.join(row['why'])} (picture: {picture})")
