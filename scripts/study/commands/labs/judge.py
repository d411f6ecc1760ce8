"""Judges a solution of one of docs/labs: picture, speed-up with interval, a hint.

A phase is first run by a build with AddressSanitizer and UndefinedBehaviorSanitizer. Speed is measured
against the lab's start, interleaved in one run. Of a lab that asks for a scene, the scene's pictures are
judged; of one that asks for answers, without --file the task is written.
"""

import argparse
import contextlib
import math
import re
import secrets
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from study.commands import try_
from study.core import cli, patches, registry, show, store, temporary
from study.core.build import build, build_together
from study.core.cli import Outcome, StudyError
from study.core.host import sandbox
from study.core.registry import Scene, Spec
from study.core.run import USABLE, render
from study.counting import cachegrind, flops
from study.counting.schema import Declared
from study.labs import answers, crowds, memory
from study.labs.lab import Lab, labs, measuring
from study.numbers import stats
from study.numbers.stats import Interval
from study.pictures import images
from study.pictures.gallery import Gallery

BASE = Spec("baseline", "baseline")
DOES_NOT_COMPILE = 4  # exit status
BEFORE = 3  # frames of other views, at most, before the one whose bits are compared: as in a timed launch
COUNTED = 3  # times as high as what cachegrind counts is the picture
FRACTAL = 45  # least height of a fractal's picture: in a smaller one the rounding of one pixel decides
COUNTED_HEIGHT = 60  # of what is counted block by block
ABSURD = 10  # times the goal: then something is not drawn, or not timed
UNSURE = "The interval holds the goal. Measure again: on a quieter machine, or with --launches 30."
ENDS = (".c", ".h")
LADDER = re.compile(r"baseline|opt\d+(_[a-z]+)?")  # the house's own phases, which nobody hands in
HINTS = {
    "start": "Hand in a phase of your own. Phases made from others are not judged, nor the ladder's:"
    " baseline, and names like opt4 and opt4_mine.",
    "unchanged": "It is the start as it was. Its page's line tells after each change what it gained: {}",
    "views": "A frame may keep nothing of another: what is kept must hang on the scene alone.",
} | {kind: advice for kind, (_, advice) in memory.ADVICE.items()}


@dataclass(frozen=True)
class Check:
    """`hint`: its key among the hints, where that is not the name; `text`: a tool's own, of several lines."""

    name: str
    passed: bool
    said: str
    hint: str = ""
    text: str = ""


def of_source(lab: Lab, name: str, root: Path = registry.ROOT) -> Check:
    """Whether the phase was made from the lab's start, and is not as it was."""
    base, start = (re.split("[@+]", one)[0] for one in (name, lab.start))
    made = [*patches.lineage(base, root), registry.parent_of(base, root)]
    if base != start and (LADDER.fullmatch(base) or start not in made):
        return Check("start", False, f"made by: make new-phase NAME=mine FROM={lab.start}")
    mine, theirs = (
        {
            file: re.sub(r"\A#line .*\n", "", text)
            for file, text in patches.tree(one, root).items()
            if file[-2:] in ENDS
        }
        for one in (name, lab.start)
    )
    return Check("unchanged", mine != theirs, f"its sources differ from {lab.start}'s")


def of_memory(spec: Spec, scene: Scene, height: int, threads: int) -> Check:
    """Whether the sanitizers find nothing."""
    said = "no fault of memory, by AddressSanitizer and UndefinedBehaviorSanitizer"
    if not (fault := memory.looked(spec, scene, height, threads)):
        return Check("memory", True, said)
    return Check("memory", False, f"{said} ({fault.said})", fault.kind, fault.text)


def own_folder() -> contextlib.AbstractContextManager[Path]:
    """A temporary one, where the sandbox lets a program write: others may judge the same phase meanwhile."""
    return temporary.folder(registry.ROOT / "build", ".judge.")


def of_views(spec: Spec, scene: Scene, height: int, threads: int = 1) -> Check:
    """Whether a frame has the bits of a fresh process's after frames of near and of far views."""
    camera = scene.data["camera"]
    ahead = np.subtract(camera["look_at"], camera["position"], dtype=float)
    aside = np.cross(camera.get("up", [0, 1, 0]), ahead)
    aside *= 0.5 * np.linalg.norm(ahead) / np.linalg.norm(aside)
    path = {"type": "line", "to": list(camera["position"] + aside), "period": 0.4}
    far = {"animation": BEFORE + 1, "first_frame": BEFORE}
    wrong = []
    with own_folder() as folder:
        flown, out = folder / "flown.json", folder / "picture.exr"
        store.write_json(flown, scene.data | {"camera": camera | {"path": path}})
        for title, file, words in (("near", scene.path, {}), ("far", flown, far)):
            size, pictures = (height, scene.size(height)[0]), set()
            for before in range(BEFORE + 1):
                how = {"warmup": before, "threads": threads, "out": out} | words
                render(spec, file, *size, timed=False, **how)
                pictures.add(images.rgb(images.read(out)).tobytes())
            if len(pictures) > 1:
                wrong.append(title)
    said = f"after one to {BEFORE} frames of other views every bit as in a fresh process"
    return Check("views", not wrong, said + f" (not after {' and '.join(wrong)} views)" * bool(wrong))


def of_phase(lab: Lab, result: try_.Compared) -> list[Check]:
    """Checks of what stepwise try measured beside the lab's start."""
    start, mine = result.sides
    if lab.truth_db:
        shown = mine.truth.shown.psnr_db
        said = f"at least {lab.truth_db:g} dB to ground truth ({show.number(shown)})"
        picture = Check("picture", shown >= lab.truth_db, said)
    elif lab.same_bits:
        picture = Check("picture", result.same_bits, f"every bit as {lab.start}'s")
    else:
        fails = "; ".join(mine.fails)
        picture = Check("picture", not fails, f"within its tolerance{f' ({fails})' if fails else ''}")
    made = [picture]
    if lab.lanes:
        now, before = mine.lanes_at_work, start.lanes_at_work
        rises = bool(now and before and now - before >= lab.lanes)
        said = f"lanes at work: {100 * lab.lanes:.0f} points more than {lab.start}'s"
        if now and before:
            said += f" ({show.percent(before)} → {show.percent(now)})"
        made.append(Check("lanes", rises, said))
    if lab.calls:
        made.append(of_work(lab, [_calls(one, lab.calls) for one in (start, mine)]))
    if lab.libm:
        made.append(of_libm(lab, [Spec.parse(one.name) for one in (start, mine)]))
    return [*made, *of_ratio(lab, result.ratio)]


def of_work(lab: Lab, works: Sequence[int | None]) -> Check:
    """Check of the calls of start and solution."""
    less = bool(works[0] and works[1] is not None and works[1] <= lab.share * works[0])
    counts = " → ".join(f"{work:,}" if work is not None else "not counted" for work in works)
    what = lab.calls or ", ".join(lab.libm)
    said = f"calls of {what}: at most {show.percent(lab.share)} of {lab.start}'s ({counts})"
    return Check("work", less, said)


def of_libm(lab: Lab, both: Sequence[Spec]) -> Check:
    """Check of the calls that the programs execute, whatever their sources declare."""
    if lacking := flops.missing("blocks"):
        return Check("work", True, f"calls of {', '.join(lab.libm)}: not counted: {lacking}")
    scene = registry.find_scene(lab.scene)
    edges = [flops.measure("blocks", spec, scene, COUNTED_HEIGHT).edges for spec in both]
    counts = [sum(one.get(name, 0) for one in of.values() for name in lab.libm) for of in edges]
    return of_work(lab, counts)


def of_ratio(lab: Lab, ratio: Interval) -> list[Check]:
    if not ratio.launches:
        return []
    fast = bool(ratio.sufficient and ratio.low >= lab.speedup)
    unsure = not fast and ratio.high >= lab.speedup
    said = f"at least {lab.speedup}× as fast as {lab.start}: {show.spread(ratio, 3, '×')}"
    if ratio.low > ABSURD * lab.speedup:
        said += "; no such change is known to gain that much: look for what is not drawn, or not timed"
    return [Check("unsure" if unsure else "speed", fast, said)]


def drawn(both: try_.Sides, scene: Scene, height: int, threads: int = 1) -> bool:
    """Whether the pictures of both, which are built, have the same bits."""
    shown = []
    with own_folder() as folder:
        for spec in both:
            out, width = folder / "picture.exr", scene.size(height)[0]
            render(spec, scene.path, height, width, threads=threads, out=out, timed=False)
            shown.append(images.rgb(images.read(out)).tobytes())
    return shown[0] == shown[1]


def of_others(lab: Lab, both: try_.Sides) -> list[Check]:
    """Checks of the bits on scenes that ask for more of the idea than the lab's own."""
    scenes = [registry.scene_at(registry.ROOT / place) for place in lab.also]
    said = f"every bit as {lab.start}'s on "
    return [Check(one.name, drawn(both, one, lab.height), said + one.name) for one in scenes]


def of_pair(lab: Lab, scene: Scene, args: argparse.Namespace) -> list[Check]:
    """Checks of start and solution alone: bits, events and time. Raises StudyError."""
    both = try_.sides(args.phase, lab.start)
    build_together([(spec, "render") for spec in both], len(USABLE))
    same = drawn(both, scene, lab.height, lab.threads)
    made = [Check("picture", same, f"every bit as {lab.start}'s")]
    if lab.events:
        what, share = cachegrind.EVENTS[lab.events][1], show.percent(lab.share)
        counts = [cachegrind.counted(spec, scene, max(lab.height // COUNTED, 4)) for spec in both]
        before, now = (one[lab.events] if one else None for one in counts)
        said = f"{before:,} → {now:,}" if now is not None else f"not counted: {cachegrind.TOOL} is missing"
        less = now is None or before is None or now <= lab.share * before
        made.append(Check("work", less, f"{what}: at most {share} of {lab.start}'s ({said})"))
    if lab.calls:
        found = [try_.counted(spec, scene, lab.height) for spec in both]
        made.append(of_work(lab, [_calls(one, lab.calls) if one else None for one in found]))
    if args.untimed:
        return made
    if lab.threads > len(USABLE):
        why = f"lab {lab.number} needs {lab.threads} CPUs, of which {len(USABLE)} may be used; or --untimed"
        raise StudyError(why, cli.CANNOT_RUN)
    ms = try_.times(both, scene, lab.height, args.launches, args.seed, lab.threads)
    return made + of_ratio(lab, stats.ratio_interval(*(ms[spec] for spec in both)))


def _calls(side: try_.Side | Declared, pattern: str) -> int | None:
    """Calls of the functions whose whole name fits the pattern; None where they are not counted."""
    if isinstance(side, Declared):
        return sum(one.calls for name, one in side.by_function.items() if re.fullmatch(pattern, name))
    if side.calls is None:
        return None
    return sum(count for name, count in side.calls.items() if re.fullmatch(pattern, name))


def of_scene(lab: Lab, path: Path, height: int) -> list[Check]:
    """Checks of a scene's pictures. Raises StudyError for a scene that a phase cannot draw."""
    scene = registry.scene_at(path)
    specs = [BASE, Spec.parse(lab.start), Spec.parse(lab.breaks)]
    build_together([(spec, "render") for spec in specs], len(USABLE))
    gallery = Gallery(try_.FOLDER / "images", specs)
    size = scene.size(height)
    if refused := gallery.render_all([(spec, scene, size) for spec in specs], len(USABLE)):
        raise StudyError(str(next(iter(refused.values()))))
    base, exact, broken = (images.read(gallery.path(spec, scene, size)) for spec in specs)
    to_base = [images.compare(base, picture)["psnr_db"] for picture in (exact, broken)]
    shown = ["the same picture" if value == math.inf else f"{value:.1f} dB" for value in to_base]
    return [
        Check("shape", not scene.fractal, "no fractal in the scene"),
        Check("exact", to_base[0] >= lab.exact_db, f"{lab.start} at {lab.exact_db} dB or more: {shown[0]}"),
        Check("breaks", to_base[1] <= lab.below_db, f"{lab.breaks} at {lab.below_db} dB or less: {shown[1]}"),
    ]


def of_answers(lab: Lab, path: Path | None, student: int) -> list[Check] | Outcome:
    """Checks of an answers file; without one the task is written. Raises StudyError for any other file."""
    asked = answers.questions(lab.answers, student)
    if path is None:
        folder = answers.write(asked, lab.number, student).relative_to(registry.ROOT)
        file = folder / answers.TEMPLATE
        lines = [f"The task of student {student} is in {folder}. Fill in {file}, then:"]
        words = f"--student {student} " * bool(student)
        lines.append(f'  make judge LAB={lab.number} ARGS="{words}--file {file}"')
        return Outcome({"lab": lab.number, "folder": folder}, lines)
    named = re.fullmatch(rf"{lab.number}-student-(\d+)", path.resolve().parent.name)
    if named and int(named[1]) != student:
        raise StudyError(f"{path}: the task of student {named[1]}, not {student}: give --student {named[1]}")
    judged = answers.judged(asked, answers.read(path, asked))
    return [Check(one.name, not one.fails, one.said, one.fails) for one in judged]


STATUSES = {
    cli.FAILED: "a check of the lab fails",
    DOES_NOT_COMPILE: "it does not compile: the compiler's text",
}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("lab", type=int, choices=sorted(labs()), metavar="LAB", help="its number in docs/labs")
    add("--phase", metavar="PHASE", help="your phase, or an ablation")
    add("--file", type=Path, metavar="FILE", help="your scene or your answers, where the lab asks for them")
    about = "whose task or scene, of a lab that draws one by it; default: 0"
    add("--student", type=cli.at_least(0), default=0, metavar="NUMBER", help=about)
    about = "of the pictures, where the lab has none of its own; default: 180"
    add("-n", type=cli.at_least(16), default=180, metavar="HEIGHT", help=about)
    add("--launches", type=cli.at_least(6), default=12, help="process launches of each; default: 12")
    about = "pictures and work alone, on a machine whose times mean nothing"
    add("--untimed", action="store_true", help=about)
    about = "also writes Gradescope's results.json: a point a check"
    add("--gradescope", type=Path, metavar="FILE", help=about)
    about = "no network, limits, and nothing written but in build/; default with --json and --gradescope"
    add("--sandbox", action=argparse.BooleanOptionalAction, help=about)
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of order and padding; default: random")


def gradescope(path: Path, checks: Sequence[Check], hint: str) -> None:
    """Gradescope's form (gradescope-autograders.readthedocs.io, “Output format”). Raises StudyError."""
    tests = [
        {
            "name": one.name,
            "score": int(one.passed),
            "max_score": 1,
            "output": f"{one.said}\n{one.text}".strip(),
        }
        for one in checks
    ]
    store.write_json(path, {"tests": tests, "output": hint, "visibility": "visible"})


@contextlib.contextmanager
def sandboxed(wanted: bool) -> Iterator[None]:
    """Meanwhile what is built and run is in the sandbox, or where that fails, under its limits: a line says
    so."""
    with contextlib.ExitStack() as stack:
        if wanted and (lacking := stack.enter_context(sandbox.entered(registry.ROOT / "build"))):
            cli.say(f"no sandbox, limits of time and memory alone: {lacking}")
        yield


def run(args: argparse.Namespace) -> Outcome:
    wanted = bool(args.json or args.gradescope) if args.sandbox is None else args.sandbox
    try:
        with sandboxed(wanted and not labs()[args.lab].answers):
            outcome = judged(args)
    except StudyError as error:
        if args.gradescope:
            gradescope(args.gradescope, [Check("runs", False, str(error))], "")
        raise
    told = outcome.result
    if args.gradescope and "checks" in told:
        checks = told["checks"] or [Check("compiles", False, told["compiler"])]
        gradescope(args.gradescope, checks, told["hint"] or "")
    return outcome


def judged(args: argparse.Namespace) -> Outcome:
    lab = labs()[args.lab]
    hints, told = lab.hints | HINTS, None
    if lab.answers:
        made = of_answers(lab, args.file, args.student)
        if isinstance(made, Outcome):
            return made
        checks = made
    elif lab.breaks:
        if not args.file:
            raise StudyError(f"lab {lab.number} asks for a scene: make judge LAB={lab.number} SCENE=FILE")
        checks = of_scene(lab, args.file, args.n)
    else:
        scene = crowds.scene(lab.crowd, lab.shapes, args.student) if lab.crowd else None
        if not args.phase:
            asks = f"lab {lab.number} asks for a phase: make judge LAB={lab.number} NAME=mine"
            if not scene:
                raise StudyError(asks)
            place = scene.path.relative_to(registry.ROOT)
            return Outcome({"lab": lab.number, "scene": place}, [f"Its scene is {place}; {asks}"])
        scene = scene or registry.find_scene(lab.scene)
        if scene.fractal and not lab.height and args.n < FRACTAL:
            raise StudyError(f"so small a picture of a fractal is judged by luck: -n {FRACTAL} or more")
        spec = Spec.parse(args.phase)
        if not lab.start:
            lab = replace(lab, start=registry.parent_of(args.phase) or "")
        line = measuring(lab, args.phase, scene if lab.crowd else None)
        hints["unchanged"] = HINTS["unchanged"].format(line)
        checks = [of_source(lab, args.phase)]
        try:
            build(spec)
        except StudyError as error:
            if error.exit_status == cli.CANNOT_RUN:  # a tool is missing, which is no fault of the phase
                raise
            compiler = str(error)
            result = {"lab": lab.number, "checks": [], "hint": None, "try": None, "compiler": compiler}
            return Outcome(result, [compiler], status=DOES_NOT_COMPILE)
        if checks[0].passed:
            checks.append(of_memory(spec, scene, lab.height or args.n, lab.threads))
        sound = all(one.passed for one in checks)
        if sound and lab.height:
            views = of_views(spec, scene, lab.height, lab.threads)
            picture, *rest = of_pair(lab, scene, args)
            others = of_others(lab, try_.sides(args.phase, lab.start)) if picture.passed else []
            checks += [views, picture, *others, *rest]
        elif sound:
            named = registry.given(str(scene.path)) if lab.crowd else lab.scene
            what = {"name": args.phase, "against": lab.start, "scene": named}
            told = try_.compared(argparse.Namespace(**vars(args) | what))
            checks += [of_views(spec, scene, args.n), *of_phase(lab, told)]
    failing = next((one for one in checks if not one.passed), None)
    hint = hints.get(failing.hint or failing.name, UNSURE) if failing else None
    lines = [try_.text(told), ""] if told and not args.untimed else []
    lines += [
        f"Lab {lab.number}, {lab.title}",
        *(f"  {'reached' if one.passed else 'MISSED '}  {one.said}" for one in checks),
        *(f"    {line}" for one in checks for line in one.text.splitlines()),
        f"Hint: {hint}" if hint else f"All of it reached{'; speed was not judged' * args.untimed}.",
    ]
    result = {"lab": lab.number, "checks": checks, "hint": hint, "try": told}
    return Outcome(result, lines, status=cli.FAILED if failing else cli.OK)
