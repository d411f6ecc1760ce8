"""Contact sheet of all scenes and phases, and heat maps of the evaluations per pixel, from a verified run."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from study.core import cli, store
from study.core.cli import StudyError
from study.core.registry import phases
from study.numbers import accuracy
from study.pictures import images, panels

THUMBNAIL = 320  # pixels across, at most


def caption(pair: dict) -> tuple[str, str]:
    """What stands under a picture, and its colour."""
    colour = panels.BAD if pair["within_tolerance"] is False else panels.GOOD
    if "psnr_db" not in pair:
        return "could not be rendered", colour
    if pair["non_finite"]:
        return f"{pair['non_finite']} samples not finite", colour
    text = "identical" if pair["identical"] else f"PSNR {decibels(pair['psnr_db'])}"
    if "antialiased" in pair and not pair["identical"]:
        text += f"\n4×4 averaged {decibels(pair['antialiased']['psnr_db'])}"
    return text + ("\noutside its tolerance" if pair["within_tolerance"] is False else ""), colour


def decibels(psnr: float | None) -> str:
    return "∞ dB" if psnr is None else f"{psnr:.1f} dB"


def thumbnail(path: Path) -> np.ndarray:
    """Display picture of at most about THUMBNAIL pixels across, averaged in linear light."""
    linear = images.rgb(images.read(path))
    return images.to_display(images.box_average(linear, max(1, linear.shape[1] // THUMBNAIL)))


def chosen(verified: dict, scenes: Sequence[str] | None, specs: Sequence[str] | None) -> dict:
    """Of these scenes and phases alone. Raises StudyError for one that was not verified."""
    made = dict(verified)
    for key, wanted in (("scene", scenes), ("phase", specs)):
        known = {pair[key] for pair in verified["pairs"]} | (
            {verified["reference"]} if key == "phase" else set()
        )
        for name in wanted or ():
            if name not in known:
                raise StudyError(f"no {key} '{name}' was verified; there are {', '.join(sorted(known))}")
        if wanted:
            made["pairs"] = [pair for pair in made["pairs"] if pair[key] in wanted]
            made["skipped"] = [one for one in made["skipped"] if one[key] in wanted]
    return made


def to_truth(folder: Path) -> dict[tuple[str, str], str]:
    """(scene, phase) → its error to ground truth in words, where the run has accuracy.json."""
    return {
        (r.scene, r.phase): f"to ground truth {decibels(r.colours.psnr_db)}{' (4×4)' * r.converged_only}"
        for r in accuracy.rows(folder)
    }


def contact_sheet(folder: Path, verified: dict) -> Figure:
    """Scenes down, phases across; the reference first. Red: outside the phase's tolerance."""
    truth = to_truth(folder)
    pairs = {(p["scene"], p["phase"]): p for p in verified["pairs"]}
    why = {(s["scene"], s["phase"]): s["reason"] for s in verified["skipped"]}
    rows = list(dict.fromkeys(scene for scene, _ in pairs))
    specs = list(dict.fromkeys([verified["reference"], *(spec for _, spec in [*pairs, *why])]))
    figure = Figure(figsize=(3.1 * len(specs) + 0.4, 2.15 * len(rows) + 1.3), dpi=100, layout="constrained")
    title = f"Scenes by phases: PSNR of linear RGB against {verified['reference']}"
    figure.suptitle(title, fontsize=16)
    grid = figure.subplots(len(rows), len(specs), squeeze=False)
    for scene, line in zip(rows, grid, strict=True):
        first = max((p for (s, _), p in pairs.items() if s == scene), key=lambda p: "reference_image" in p)
        line[0].set_ylabel(f"{scene}\n{first['width']}×{first['height']}", fontsize=12)
        for spec, axes in zip(specs, line, strict=True):
            if spec == verified["reference"]:
                path, text, colour = first.get("reference_image"), "reference", panels.GOOD
            elif (scene, spec) in pairs:
                path, (text, colour) = pairs[scene, spec].get("image"), caption(pairs[scene, spec])
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


def evaluation_planes(folder: Path, verified: dict) -> dict[str, np.ndarray]:
    """Scene → evaluations of the reference's camera rays (height × width)."""
    paths = {p["scene"]: folder / p["reference_image"] for p in verified["pairs"] if "reference_image" in p}
    return {scene: images.read(path)["evals"] for scene, path in paths.items()}


def main() -> int:
    parser = cli.parser(__doc__)
    parser.add_argument(
        "--run", type=Path, metavar="DIR", help="what scripts/stepwise verify wrote; default: the latest run"
    )
    parser.add_argument("-o", "--out", type=Path, metavar="PATH", help="default: RUN/figures")
    parser.add_argument("--scene", nargs="+", metavar="SCENE", help="of the contact sheet; default: all")
    parser.add_argument("--phase", nargs="+", metavar="PHASE", help="of the contact sheet; default: all")
    args = parser.parse_args()
    folder = args.run or store.latest().path
    if not (folder / "verify.json").is_file():
        raise StudyError(f"{folder}: has no verify.json; make it with scripts/stepwise verify --run {folder}")
    verified = store.read_json(folder / "verify.json")
    if not any("reference_image" in pair for pair in verified["pairs"]):
        raise StudyError(f"{folder}/verify.json: has no picture", cli.CANNOT_RUN)
    out = args.out or folder / "figures"
    heat = panels.evaluations(evaluation_planes(folder, verified), verified["reference"])
    made = {
        "contact_sheet": panels.save(
            contact_sheet(folder, chosen(verified, args.scene, args.phase)), out / "contact-sheet.png"
        ),
        "evaluations": panels.save(heat, out / "evaluations.png"),
    }
    if args.json:
        cli.emit(made, folder)
    else:
        print("\n".join(map(str, made.values())))
    return cli.OK
