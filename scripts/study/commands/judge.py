"""Judges a solution of one of the labs of docs/labs: its picture, its speed-up with interval, and a hint.

Speed is measured against the lab's start, interleaved in one run. Of a lab that asks for a scene, the scene's
pictures are judged.
"""

from __future__ import annotations

import argparse
import math
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.commands import try_
from study.core import cli, json_files, registry, run, show
from study.core.build import build_together
from study.core.cli import StudyError
from study.core.registry import Spec
from study.pictures import images
from study.pictures.gallery import Gallery

FILE = registry.ROOT / "docs" / "labs" / "labs.json"
BASE = Spec("baseline", "baseline")
UNSURE = "The interval holds the goal. Measure again: on a quieter machine, or with --launches 30."


@dataclass(frozen=True)
class Lab:
    """An entry of labs.json.

    Of a lab that asks for a phase: `speedup` over `start` on `scene`, `lanes`: by how much the share of lanes
    at work must rise, `same_bits`: the picture of `start`, else one within the phase's tolerance. Of one that
    asks for a scene: PSNR to baseline there of `breaks` (at most `below_db`) and of `start` (at least
    `exact_db`). `hints`: what is said, by the check that fails.
    """

    number: int
    title: str
    page: str
    minutes: int
    start: str
    scene: str
    hints: dict[str, str]
    speedup: float = 1.0
    same_bits: bool = False
    lanes: float = 0.0
    breaks: str = ""
    below_db: float = 0.0
    exact_db: float = 0.0


@dataclass(frozen=True)
class Check:
    name: str
    passed: bool
    said: str


def labs() -> dict[int, Lab]:
    return {one["number"]: Lab(**one) for one in json_files.read_json(FILE)["labs"]}


def of_phase(lab: Lab, result: dict[str, Any]) -> list[Check]:
    """Of what stepwise try measured beside the lab's start."""
    start, mine = result["sides"]
    if lab.same_bits:
        picture = Check("picture", result["same_bits"], f"every bit as {lab.start}'s")
    else:
        fails = "; ".join(mine["fails"])
        picture = Check("picture", not fails, f"within its tolerance{f' ({fails})' if fails else ''}")
    made = [picture]
    if lab.lanes:
        now, before = mine["lanes_at_work"], start["lanes_at_work"]
        rises = bool(now and before and now - before >= lab.lanes)
        said = f"lanes at work: {100 * lab.lanes:.0f} points more than {lab.start}'s"
        if now and before:
            said += f" ({show.percent(before)} → {show.percent(now)})"
        made.append(Check("lanes", rises, said))
    ratio = result["ratio"]
    fast = bool(ratio.sufficient and ratio.low >= lab.speedup)
    unsure = not fast and ratio.high >= lab.speedup
    said = f"at least {lab.speedup}× as fast as {lab.start}: {show.spread(ratio, 3, '×')}"
    return [*made, Check("unsure" if unsure else "speed", fast, said)]


def of_scene(lab: Lab, path: Path, height: int) -> list[Check]:
    """Of the pictures of a scene. Raises StudyError for a scene that a phase cannot draw."""
    scene = registry.scene_at(path)
    specs = [BASE, Spec.parse(lab.start), Spec.parse(lab.breaks)]
    build_together([(spec, "render") for spec in specs], len(run.USABLE))
    gallery = Gallery(try_.FOLDER / "images", specs)
    size = scene.size(height)
    if refused := gallery.render_all([(spec, scene, size) for spec in specs], len(run.USABLE)):
        raise StudyError(str(next(iter(refused.values()))))
    base, exact, broken = (images.read(gallery.path(spec, scene, size)) for spec in specs)
    to_base = [images.compare(base, picture)["psnr_db"] for picture in (exact, broken)]
    shown = ["the same picture" if value == math.inf else f"{value:.1f} dB" for value in to_base]
    return [
        Check("shape", not scene.fractal, "no fractal in the scene"),
        Check("exact", to_base[0] >= lab.exact_db, f"{lab.start} at {lab.exact_db} dB or more: {shown[0]}"),
        Check("breaks", to_base[1] <= lab.below_db, f"{lab.breaks} at {lab.below_db} dB or less: {shown[1]}"),
    ]


def arguments() -> argparse.Namespace:
    parser = cli.parser(__doc__, {1: "a check of the lab fails"})
    add = parser.add_argument
    add("lab", type=int, choices=sorted(labs()), metavar="LAB", help="its number in docs/labs")
    add("--phase", metavar="PHASE", help="your phase, or an ablation")
    add("--file", type=Path, metavar="FILE", help="your scene, where the lab asks for one")
    add("-n", type=cli.at_least(16), default=180, metavar="HEIGHT", help="of the pictures; default: 180")
    add("--launches", type=cli.at_least(6), default=12, help="process launches of each; default: 12")
    add("--seed", type=int, help="of order and padding; default: random")
    options = parser.parse_args()
    lab = labs()[options.lab]
    if lab.breaks and not options.file:
        parser.error(
            f"lab {lab.number} asks for a scene: --file FILE (make judge LAB={lab.number} SCENE=FILE)"
        )
    if not lab.breaks and not options.phase:
        parser.error(
            f"lab {lab.number} asks for a phase: --phase NAME (make judge LAB={lab.number} NAME=mine)"
        )
    return options


def main() -> int:
    options = arguments()
    lab = labs()[options.lab]
    told = None
    if lab.breaks:
        checks = of_scene(lab, options.file, options.n)
    else:
        seed = secrets.randbelow(2**32) if options.seed is None else options.seed
        told = try_.measure(
            argparse.Namespace(
                name=options.phase,
                against=lab.start,
                scene=lab.scene,
                n=options.n,
                launches=options.launches,
                seed=seed,
            )
        )
        checks = of_phase(lab, told)
    failing = next((one for one in checks if not one.passed), None)
    hint = lab.hints.get(failing.name, UNSURE) if failing else None
    if options.json:
        cli.emit({"lab": lab.number, "checks": checks, "hint": hint, "try": told})
    else:
        if told:
            print(try_.text(told), end="\n\n")
        print(f"Lab {lab.number}, {lab.title}")
        for one in checks:
            print(f"  {'reached' if one.passed else 'MISSED '}  {one.said}")
        print(f"Hint: {hint}" if hint else "All of it reached.")
    return cli.FAILED if failing else cli.OK
