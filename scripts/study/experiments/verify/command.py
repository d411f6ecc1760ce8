"""Equivalence of phases: pictures and AOVs compared, judged by tolerance (study/numbers/schema.py)."""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path

from study.core import cli, progress, registry, run, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED
from study.pictures import gate, images, panels
from study.pictures.gallery import Gallery, Size

TRUTH = "scripts/stepwise accuracy"  # what judges a rung that has no tolerance to the reference
FACTOR = 4  # of the anti-aliased comparison, each way


def subject(reference: Spec, spec: Spec, scene: Scene, size: Size) -> dict:
    """What a pair is about: the first keys of its object in verify.json."""
    about = {"phase": str(spec), "reference": str(reference), "scene": scene.name}
    return {**about, "class": "fractal" if scene.fractal else "smooth", "width": size[0], "height": size[1]}


def judge(
    gallery: Gallery,
    reference: Spec,
    spec: Spec,
    scene: Scene,
    size: Size,
    large: Size | None,
    heatmaps: bool,
) -> dict:
    """One pair of verify.json, its pictures written. `large`: size of the pictures to be averaged."""
    a, b = (images.read(gallery.path(who, scene, size)) for who in (reference, spec))
    big = tuple(images.read(gallery.path(who, scene, large)) for who in (reference, spec)) if large else None
    metrics = images.compare(a, b, big)
    declared, left = {"identical": True}, False  # of the reference with itself
    if spec != reference:
        phase = registry.find_phase(spec.phase)
        left = gate.left_to_truth(phase)
        declared = {} if left else gate.tolerance(phase, scene)
    failed = gate.failures(metrics, declared)
    found = {
        **subject(reference, spec, scene, size),
        **metrics,
        "tolerance": declared,
        "failed": list(failed),
        "why": [f"{name}: {text}" for name, text in failed.items()],
        "within_tolerance": None if left and not failed else not failed,
    }
    if left:
        found["left_to"] = TRUTH
    for prefix, who, index in (("reference_", reference, 0), ("", spec, 1)):
        found[f"{prefix}binary_sha256"] = gallery.hashes[who]
        found[f"{prefix}image"] = f"{gallery.folder.name}/{gallery.path(who, scene, size).name}"
        found[f"{prefix}png"] = gallery.png(gallery.stem(who, scene, size), images.rgb((a, b)[index]))
        if large:
            name = gallery.stem(who, scene, (large[0] // FACTOR, large[1] // FACTOR)) + "-antialiased"
            mean = images.box_average(images.rgb(big[index]), FACTOR)
            found[f"{prefix}antialiased_png"] = gallery.png(name, mean)
    if failed or heatmaps:
        name = f"{gallery.stem(spec, scene, size)}-against-{reference}.png"
        title = f"{scene.name}, {size[0]}×{size[1]} pixels: {spec} against {reference}"
        notes = "", "", "\n".join(found["why"]) or "within its tolerance"
        figure = panels.pair((a, b), (str(reference), str(spec)), title, metrics, notes, bad=bool(failed))
        panels.save(figure, gallery.folder / name)
        found["heatmap"] = f"{gallery.folder.name}/{name}"
    return found


def with_parents(names: list[str], reference: Spec) -> tuple[list[Spec], set[Spec]]:
    """Each phase behind its parent, and those that were not asked for: rows to compare with, not judged."""
    asked = [Spec.parse(name) for name in names]
    both: list[Spec] = []
    for spec in asked:
        parent = registry.parent_of(str(spec))
        both += [Spec.parse(parent), spec] if parent and parent != str(reference) else [spec]
    return list(dict.fromkeys(both)), set(both) - set(asked)


COLUMNS = (  # head, metric, format, factor
    ("mask ppm", "mask_mismatch_ppm", "{:.0f}", 1),
    ("id ppm", "id_mismatch_ppm", "{:.0f}", 1),
    ("dt p99", "dt_p99", "{:.1e}", 1),
    ("dt max", "dt_max", "{:.1e}", 1),
    ("normal p99 °", "normal_p99_degrees", "{:.1e}", 1),
    ("depth agrees %", "depth_agree_fraction", "{:.2f}", 100),
    ("PSNR dB", "psnr_db", "{:.1f}", 1),
    (">1/255 %", "fraction_over_1_255", "{:.3f}", 100),
    ("display dB", "psnr_display_db", "{:.1f}", 1),
    (">1/255 %", "fraction_over_1_255_display", "{:.3f}", 100),
    ("FLIP", "flip_mean", "{:.1e}", 1),
    ("4x4 dB", "antialiased.psnr_db", "{:.1f}", 1),
    (">1/255 %", "antialiased.fraction_over_1_255", "{:.3f}", 100),
)


def table(pairs: list[dict]) -> str:
    """One line a pair, columns without values left out. Linear RGB where no space is named."""
    rows = [["scene", "phase", "size", "verdict", *(head for head, *_ in COLUMNS)]]
    for pair in pairs:
        values = gate.flatten(pair)
        verdict = "identical" if pair.get("identical") else "by truth" if pair.get("left_to") else "ok"
        row = [pair["scene"], pair["phase"], f"{pair['width']}x{pair['height']}"]
        row.append("FAIL" if pair["within_tolerance"] is False else verdict)
        rows.append(row + [f.format(values[key] * by) if key in values else "" for _, key, f, by in COLUMNS])
    columns = [column for column in zip(*rows, strict=True) if any(column[1:])]
    sides = ["<"] * 4 + [">"] * (len(columns) - 4)
    form = "  ".join(f"{{:{s}{max(map(len, c))}}}" for s, c in zip(sides, columns, strict=True))
    return "\n".join(form.format(*row).rstrip() for row in zip(*columns, strict=True))


STATUSES = {cli.FAILED: "a pair is outside its tolerance", cli.CANNOT_RUN: "no phase could run on this CPU"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--reference", default="baseline", metavar="PHASE", help="default: baseline")
    about = "e.g. opt4, or opt2@opt4; default: all. The row of its parent stands beside, not judged"
    add("--phase", nargs="+", metavar="PHASE", help=about)
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    add("-n", type=cli.at_least(1), default=720, metavar="HEIGHT", help="height in pixels; default: 720")
    add(
        "-w", type=cli.at_least(1), metavar="WIDTH", help="width in pixels; default: 16:9, two_spheres square"
    )
    about = f"height of fractal scenes' means of {FACTOR}x{FACTOR} pixels; default: 180"
    add("--antialias-n", type=cli.at_least(1), default=180, metavar="HEIGHT", help=about)
    add("--run", type=Path, metavar="DIR", help="for verify.json and images/; default: build/verify")
    about = "pictures rendered at a time; default: CPUs"
    add("--jobs", type=cli.at_least(1), default=len(run.USABLE), help=about)
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
    skipped = [{"phase": str(s), "scene": None, "reason": f"this CPU lacks {lacking[s]}"} for s in unable]

    folder = args.run or registry.ROOT / "build" / "verify"
    using = list(dict.fromkeys([reference, *able])) if able else []
    gallery = Gallery(folder / "images", using)
    sizes: dict[str, tuple[Size, Size | None]] = {}  # of a scene's pictures, and of those to be averaged
    for scene in scenes:
        width, height = scene.size(args.antialias_n)
        large = (width * FACTOR, height * FACTOR) if scene.fractal else None
        sizes[scene.name] = scene.size(args.n, args.w), large
    tasks = [(who, scene, size) for scene in scenes for who in using for size in sizes[scene.name] if size]
    refused = gallery.render_all(tasks, args.jobs)

    pairs = []
    for scene, spec in progress.each(list(product(scenes, able)), "compare"):
        about = {**subject(reference, spec, scene, sizes[scene.name][0]), "beside": spec in extra}
        error = refused.get((reference, scene.name)) or refused.get((spec, scene.name))
        if error is None:
            found = judge(gallery, reference, spec, scene, *sizes[scene.name], args.heatmaps)
            pairs.append({**about, **found})
        elif error.status in (NO_ISA, UNSUPPORTED):
            skipped.append({"phase": str(spec), "scene": scene.name, "reason": error.message})
        else:
            why = {"failed": ["render"], "why": [f"could not be rendered: {error.message}"]}
            pairs.append({**about, **why, "within_tolerance": False})
    tools = {"flip_tool": images.FLIP_TOOL, "picture_tool": images.PICTURE_TOOL}
    result = {"schema": 1, "reference": str(reference), **tools, "pairs": pairs, "skipped": skipped}
    store.write_json(folder / "verify.json", result)
    return told(result, folder)


def told(result: dict, folder: Path) -> Outcome:
    """A table; what was skipped and what failed."""
    pairs = result["pairs"]
    lines: list[object] = [
        table(pairs) if pairs else "",
        f"Linear RGB in [0, 1] where not called display; FLIP: {images.FLIP_TOOL}.",
        f"Pictures: {folder}/images",
    ]
    said = [
        f"skipped {item['phase']}{' on ' + item['scene'] if item['scene'] else ''}: {item['reason']}"
        for item in result["skipped"]
    ]
    by_truth: dict[str, list[str]] = {}
    for pair in pairs:
        if pair.get("left_to"):
            by_truth.setdefault(pair["phase"], []).append(pair["scene"])
    for phase, scenes in by_truth.items():
        said.append(
            f"{phase}: {TRUTH} judges its error to ground truth; here only that all samples are finite"
        )
        said.append(f"  on {' '.join(scenes)}")
    failed = [
        f"{pair['phase']} on {pair['scene']}: {'; '.join(pair['why'])}"
        + (f" (heat map: {folder / pair['heatmap']})" if "heatmap" in pair else "")
        for pair in pairs
        if pair["within_tolerance"] is False and not pair["beside"]
    ]
    judged = [pair for pair in pairs if not pair["beside"]]
    return Outcome(result, lines if pairs else [], folder, said, failed, None if judged else cli.CANNOT_RUN)
