"""Holds every phase's picture against baseline's, by its tolerance. AOVs are held against each other, too."""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from study.core import cli, progress, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED
from study.experiments import running
from study.experiments.verify import columns
from study.numbers.schema import Pair, Skipped, Verify
from study.pictures import gate, images, panels
from study.pictures.gallery import Gallery, Size

TRUTH = "scripts/stepwise accuracy"  # what judges a phase that has no tolerance to the reference
FACTOR = 4  # of the anti-aliased comparison, each way


def pair_of(reference: Spec, spec: Spec, scene: Scene, size: Size, **found: Any) -> Pair:
    """A pair of verify.json with what was found of it."""
    about = {"phase": str(spec), "reference": str(reference), "scene": scene.name}
    about |= {"class": "fractal" if scene.fractal else "smooth"}
    return msgspec.convert({**about, "width": size[0], "height": size[1], **found}, Pair)


def judge(
    gallery: Gallery,
    reference: Spec,
    spec: Spec,
    scene: Scene,
    size: Size,
    large: Size | None,
    heatmaps: bool,
    beside: bool,
) -> Pair:
    """A pair, its pictures written. `large`: size of the pictures to be averaged."""
    both = reference, spec
    a, b = (images.read(gallery.path(who, scene, size)) for who in both)
    big = tuple(images.read(gallery.path(who, scene, large)) for who in both) if large else None
    metrics = images.compare(a, b, big)
    declared, left = {"identical": True}, False  # of the reference with itself
    if spec != reference:
        phase = registry.find_phase(spec.phase)
        left = gate.left_to_truth(phase)
        declared = {} if left else gate.tolerance(phase, scene)
    failed = gate.failures(metrics, declared)
    why, below = [f"{name}: {text}" for name, text in failed.items()], gallery.folder.name
    files: dict[str, str] = {}
    for prefix, who, index in (("reference_", reference, 0), ("", spec, 1)):
        png = gallery.png(gallery.stem(who, scene, size), images.rgb((a, b)[index]))
        made = {"binary_sha256": gallery.hashes[who], "png": png}
        made["image"] = f"{below}/{gallery.path(who, scene, size).name}"
        if large:
            name = gallery.stem(who, scene, (large[0] // FACTOR, large[1] // FACTOR)) + "-antialiased"
            made["antialiased_png"] = gallery.png(name, images.box_average(images.rgb(big[index]), FACTOR))
        files |= {f"{prefix}{name}": value for name, value in made.items()}
    if failed or heatmaps:
        name = f"{gallery.stem(spec, scene, size)}-against-{reference}.png"
        title = f"{scene.name}, {size[0]}×{size[1]} pixels: {spec} against {reference}"
        notes = "", "", "\n".join(why) or "within its tolerance"
        figure = panels.pair((a, b), (str(reference), str(spec)), title, metrics, notes, bad=bool(failed))
        panels.save(figure, gallery.folder / name)
        files |= {"heatmap": f"{below}/{name}"}
    return pair_of(
        *(reference, spec, scene, size),
        **metrics,
        **files,
        tolerance=declared,
        failed=list(failed),
        why=why,
        within_tolerance=None if left and not failed else not failed,
        left_to=TRUTH if left else None,
        beside=beside,
    )


def with_parents(names: list[str], reference: Spec) -> tuple[list[Spec], set[Spec]]:
    """Each phase behind its parent, and those that were not asked for: rows to compare with, not judged."""
    asked = [Spec.parse(name) for name in names]
    both: list[Spec] = []
    for spec in asked:
        parent = registry.parent_of(str(spec))
        both += [Spec.parse(parent), spec] if parent and parent != str(reference) else [spec]
    return list(dict.fromkeys(both)), set(both) - set(asked)


STATUSES = {cli.FAILED: "a pair is outside its tolerance", cli.CANNOT_RUN: "no phase could run on this CPU"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--reference", default="baseline", metavar="PHASE", help="default: baseline")
    about = "e.g. opt4, or opt2@opt4; default: all. The row of its parent stands beside, not judged"
    add("--phase", nargs="+", metavar="PHASE", help=about)
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    about = "of phases that ground truth judges; default: those of --scene"
    add("--left-scene", nargs="+", metavar="SCENE", help=about)
    add("-n", type=cli.at_least(1), default=720, metavar="HEIGHT", help="height in pixels; default: 720")
    add(
        "-w", type=cli.at_least(1), metavar="WIDTH", help="width in pixels; default: 16:9, two_spheres square"
    )
    about = f"height of fractal scenes' means of {FACTOR}x{FACTOR} pixels; default: 180"
    add("--antialias-n", type=cli.at_least(1), default=180, metavar="HEIGHT", help=about)
    add("--run", type=Path, metavar="DIR", help="for verify.json and images/; default: build/verify")
    about = "pictures rendered at a time; default: CPUs"
    add("--jobs", type=cli.at_least(1), default=len(run.USABLE), help=about)
    parser.set_defaults(home="verify")
    add("--heatmaps", action="store_true", help="of every pair, not only of failing ones")


def measure(args: argparse.Namespace) -> Outcome:
    asked = args.phase or [phase.name for phase in registry.ladder().values() if phase.parent]
    reference = Spec.parse(args.reference)
    specs, extra = with_parents(asked, reference)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]
    for spec in specs:
        gate.check(registry.find_phase(spec.phase))
    lacking = {spec: " ".join(registry.missing_isa(spec)) for spec in (reference, *specs)}
    if lacking[reference]:
        raise StudyError(f"{reference} cannot run: this CPU lacks {lacking[reference]}", cli.CANNOT_RUN)
    able = [spec for spec in specs if not lacking[spec]]
    unable = [spec for spec in specs if lacking[spec]]
    skipped = [Skipped(phase=str(s), reason=f"this CPU lacks {lacking[s]}") for s in unable]

    folder = running.folder(args, "verify.json", gallery="images")
    using = list(dict.fromkeys([reference, *able])) if able else []
    gallery = Gallery(folder / "images", using)
    sizes: dict[str, tuple[Size, Size | None]] = {}  # of a scene's pictures, and of those to be averaged
    for scene in scenes:
        width, height = scene.size(args.antialias_n)
        large = (width * FACTOR, height * FACTOR) if scene.fractal else None
        sizes[scene.name] = scene.size(args.n, args.w), large
    few = [registry.find_scene(name).name for name in args.left_scene or sizes]
    drawn = [
        (who, scene)
        for scene, who in product(scenes, using)
        if scene.name in few or not gate.left_to_truth(registry.find_phase(who.phase))
    ]
    if able and not any(who in able and who not in extra for who, _ in drawn):
        raise StudyError(f"{TRUTH} judges all of --phase, and --left-scene names no scene of theirs")
    tasks = [(who, scene, size) for who, scene in drawn for size in sizes[scene.name] if size]
    refused = gallery.render_all(tasks, args.jobs)

    pairs: list[Pair] = []
    for spec, scene in progress.each([pair for pair in drawn if pair[0] in able], "compare"):
        error = refused.get((reference, scene.name)) or refused.get((spec, scene.name))
        if error is None:
            pairs.append(
                judge(gallery, reference, spec, scene, *sizes[scene.name], args.heatmaps, spec in extra)
            )
        elif error.status in (NO_ISA, UNSUPPORTED):
            skipped.append(Skipped(phase=str(spec), scene=scene.name, reason=error.message))
        else:
            why = {"failed": ["render"], "why": [f"could not be rendered: {error.message}"]}
            about = {**why, "within_tolerance": False, "beside": spec in extra}
            pairs.append(pair_of(reference, spec, scene, sizes[scene.name][0], **about))
    tools = {"flip_tool": images.FLIP_TOOL, "picture_tool": images.PICTURE_TOOL}
    result = Verify(schema=1, reference=str(reference), **tools, pairs=pairs, skipped=skipped)
    store.write_json(folder / "verify.json", result)
    return told(result, folder)


def told(result: Verify, folder: Path) -> Outcome:
    """A table; what was skipped and what failed."""
    pairs = result.pairs or []
    said = [
        f"skipped {s.phase}{' on ' + s.scene if s.scene else ''}: {s.reason}" for s in result.skipped or []
    ]
    if left := dict.fromkeys(pair.phase for pair in pairs if pair.left_to):
        said.append(f"{' '.join(left)}: judged by {TRUTH}, and here for samples that are not finite alone")
    judged = [pair for pair in pairs if not pair.beside]
    failed = [
        f"{pair.phase} on {pair.scene}: {'; '.join(pair.why or [])}"
        + (f" (heat map: {folder / pair.heatmap})" if pair.heatmap else "")
        for pair in judged
        if pair.within_tolerance is False
    ]
    lines = [
        show.markdown(show.table(columns.rows(pairs), columns.VERIFICATION)),
        f"FLIP: {images.FLIP_TOOL}. Pictures: {folder}/images",
    ]
    status = None if judged else cli.CANNOT_RUN
    return Outcome(result, lines if pairs else [], folder, said, failed, status)
