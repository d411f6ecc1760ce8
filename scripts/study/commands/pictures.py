"""Contact sheet and heat maps of evaluations per pixel, from a verified run."""

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from matplotlib.figure import Figure

from study.core import cli, store
from study.core.cli import Outcome, StudyError
from study.core.registry import BASE, phases
from study.numbers import accuracy
from study.numbers.schema import Pair, Verify
from study.pictures import images, panels

THUMBNAIL = 320  # pixels across, at most


def caption(pair: Pair) -> tuple[str, str]:
    outside = pair.within_tolerance is False
    colour = panels.BAD if outside else panels.GOOD
    if not pair.image:
        return "could not be rendered", colour
    if pair.non_finite:
        return f"{pair.non_finite} samples not finite", colour
    text = "identical" if pair.identical else f"PSNR {decibels(pair.psnr_db or None)}"
    if pair.antialiased and not pair.identical:
        text += f"\n4×4 averaged {decibels(pair.antialiased.psnr_db)}"
    return text + "\noutside its tolerance" * outside, colour


def decibels(psnr: float | None) -> str:
    return "∞ dB" if psnr is None else f"{psnr:.1f} dB"


def thumbnail(path: Path) -> np.ndarray:
    """Display picture of at most about THUMBNAIL pixels across, averaged in linear light."""
    linear = images.rgb(images.read(path))
    return images.to_display(images.box_average(linear, max(1, linear.shape[1] // THUMBNAIL)))


def chosen(verified: Verify, scenes: Sequence[str] | None, specs: Sequence[str] | None) -> Verify:
    """What was verified of these scenes and phases alone. Raises StudyError for one that was not verified."""
    made = verified
    for key, wanted in (("scene", scenes), ("phase", specs)):
        known = {getattr(pair, key) for pair in verified.pairs or []}
        known |= {verified.reference} if key == "phase" else set()
        for name in wanted or ():
            if name not in known:
                raise StudyError(f"no {key} '{name}' was verified; there are {', '.join(sorted(known))}")
        if wanted:
            pairs = [pair for pair in made.pairs or [] if getattr(pair, key) in wanted]
            skipped = [one for one in made.skipped or [] if getattr(one, key) in wanted]
            made = msgspec.structs.replace(made, pairs=pairs, skipped=skipped)
    return made


def to_truth(folder: Path) -> dict[tuple[str, str], str]:
    """(scene, phase) → its error to ground truth in words, where the run has accuracy.json."""
    return {
        (r.scene, r.phase): f"to ground truth {decibels(r.shown.psnr_db)}{r.of}"
        for r in accuracy.rows(folder)
    }


def contact_sheet(folder: Path, verified: Verify) -> Figure:
    """Scenes down, phases across; the reference first. Red: outside the phase's tolerance."""
    truth, reference = to_truth(folder), verified.reference or BASE
    pairs = {(pair.scene, pair.phase): pair for pair in verified.pairs or []}
    why = {(one.scene, one.phase): one.reason for one in verified.skipped or []}
    rows = list(dict.fromkeys(scene for scene, _ in pairs))
    specs = list(dict.fromkeys([reference, *(spec for _, spec in [*pairs, *why])]))
    figure = Figure(figsize=(3.1 * len(specs) + 0.4, 2.15 * len(rows) + 1.3), dpi=100, layout="constrained")
    figure.suptitle(f"Scenes by phases: PSNR of linear RGB against {reference}", fontsize=16)
    grid = figure.subplots(len(rows), len(specs), squeeze=False)
    for scene, line in zip(rows, grid, strict=True):
        first = max(
            (pair for (s, _), pair in pairs.items() if s == scene), key=lambda p: bool(p.reference_image)
        )
        line[0].set_ylabel(f"{scene}\n{first.width}×{first.height}", fontsize=12)
        for spec, axes in zip(specs, line, strict=True):
            if spec == reference:
                path, text, colour = first.reference_image, "reference", panels.GOOD
            elif pair := pairs.get((scene, spec)):
                path, (text, colour) = pair.image, caption(pair)
            else:
                reason = why.get((scene, spec)) or why.get((None, spec)) or "not verified"
                path, text, colour = None, textwrap.fill(f"skipped: {reason}", 36), panels.QUIET
            shown = thumbnail(folder / path) if path else np.full((9, 16, 3), 225, np.uint8)
            panels.show(axes, shown)
            text += f"\n{truth[scene, spec]}" if (scene, spec) in truth else ""
            axes.set_xlabel(text, color=colour, fontsize=11)
    for spec, axes in zip(specs, grid[0], strict=True):
        phase = phases().get(spec)
        axes.set_title(textwrap.fill(f"{spec}: {phase.title}" if phase else spec, 34), fontsize=12)
    return figure


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--run", type=Path, metavar="DIR", help="what scripts/stepwise verify wrote; default: the latest run")
    add("-o", "--out", type=Path, metavar="PATH", help="default: RUN/figures")
    add("--scene", nargs="+", metavar="SCENE", help="of the contact sheet; default: all")
    add("--phase", nargs="+", metavar="PHASE", help="of the contact sheet; default: all")


def run(args: argparse.Namespace) -> Outcome:
    folder = args.run or store.latest().path
    verified = Verify.load_if_there(folder / "verify.json")
    if verified is None:
        raise StudyError(f"{folder}: has no verify.json; make it with scripts/stepwise verify --run {folder}")
    drawn = {p.scene: folder / p.reference_image for p in verified.pairs or [] if p.reference_image}
    if not drawn:
        raise StudyError(f"{folder}/verify.json: has no picture", cli.CANNOT_RUN)
    out = args.out or folder / "figures"
    planes = {scene: images.read(path)["evals"] for scene, path in drawn.items()}
    heat = panels.evaluations(planes, verified.reference or BASE)
    sheet = contact_sheet(folder, chosen(verified, args.scene, args.phase))
    made = {
        "contact_sheet": panels.save(sheet, out / "contact-sheet.png"),
        "evaluations": panels.save(heat, out / "evaluations.png"),
    }
    return Outcome(made, made.values(), folder)
