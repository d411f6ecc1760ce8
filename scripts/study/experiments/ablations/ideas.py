"""The ideas of a phase: what each gains, what it changes in the picture, and how many lines hold it.

An idea is an ablation whose head says `idea` (core.patches): the patch takes that idea out of its phase. All
ideas together are timed by `stepwise ablations --ideas`, into a run's ideas.json. The report shows all rows,
and the lesson of each phase (NOTES.md) has a table of its own, below a marker.
"""

import dataclasses
import re
import textwrap
from collections.abc import Sequence
from pathlib import Path

from study.core import generated_scenes, patches, registry, show, store
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene
from study.experiments.ablations import counted
from study.experiments.ablations.schema import IDEAS_FILE, Ideas, Row

REFERENCE = ROOT / "results" / "reference"
MADE = re.compile(rf"({'|'.join(generated_scenes.ARRANGEMENTS)})-(\d+)")  # scenes made to order
SEED = 1
BEGIN = "<!-- ideas: stepwise lessons -->"  # stands in a lesson before its table
WIDTH = 100  # columns of a lesson
HEADER = ("idea", "scene", "gain [95 %]", "PSNR of the two pictures", "lines of code")


def find_scene(name: str, root: Path = ROOT) -> Scene:
    """A scene of common/scenes, or one made to order, like scattered-256. Raises StudyError for neither."""
    if not (made := MADE.fullmatch(name)):
        return registry.find_scene(name, root)
    folder = store.writable(root / "build" / "ablations" / "scenes")
    scene = generated_scenes.of_shapes(made[1], int(made[2]), SEED, folder)
    return dataclasses.replace(scene, name=name)


def check_scene(name: str, root: Path = ROOT) -> None:
    """Raises StudyError for the name of no scene. Makes none."""
    if not MADE.fullmatch(name):
        registry.find_scene(name, root)


def function_lines(text: str, name: str) -> int:
    """Lines of the function's definition in a formatted C source, 0 if it has none."""
    lines = text.splitlines()
    for first, line in enumerate(lines):
        if not re.match(rf"[^\s/#].*\b{name}\(|{name}\(", line):
            continue
        for at in range(first, len(lines)):
            if lines[at].endswith(";"):  # a declaration
                break
            if lines[at].endswith("{"):
                return lines.index("}", at) - first + 1
    return 0


def code_lines(name: str, root: Path = ROOT) -> int:
    """Lines that hold the idea of NAME+TITLE: those of its head's `code`, else those that the patch changes.
    Raises StudyError for a file or function that the phase's tree does not have."""
    patch = patches.chain(name, root)[-1]
    if "code" not in patch.head:
        return sum(line[:1] in "+-" and line[:3] not in ("+++", "---") for line in patch.diff)
    files, count = patches.files(name.partition("+")[0], root), 0
    for place in patch.head["code"].split():
        file, _, function = place.partition(":")
        text = files[file].read_text(encoding="utf-8") if file in files else ""
        lines = function_lines(text, function) if function else len(text.splitlines())
        if not lines:
            raise StudyError(f"{patch.path}: code: the phase's tree has no '{place}'")
        count += lines
    return count


def of(phase: str, root: Path = ROOT) -> list[patches.Patch]:
    """The phase's patches that take out an idea, by title."""
    folder = patches.folder(phase, root) / "ablations"
    found = [patches.read(folder / f"{title}.patch") for title in patches.titles(phase, root)]
    return [patch for patch in found if "idea" in patch.head]


def change(row: Row) -> str:
    """What the idea does to the picture: how far the patched phase's picture is from the phase's own."""
    if row.change_psnr_db is None:
        return "identical" if row.change_max_abs == 0 else "undefined"
    return f"{row.change_psnr_db:.0f} dB"


def published(phase: str, folder: Path = REFERENCE) -> Path | None:
    """The newest published run that has a row for every idea of the phase. None if there is no such run."""
    wanted = {patch.name for patch in of(phase)}

    def date(run: Path) -> tuple[list[str], str]:
        return re.findall(r"\d{4}-\d\d-\d\d", run.name), run.name

    for run in sorted(folder.glob("*"), key=date, reverse=True):
        result = Ideas.load_if_there(run / IDEAS_FILE)
        if result and wanted <= {row.ablation for row in result.rows}:
            return run
    return None


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def table(phase: str, run: Path | None) -> list[str]:
    """The lines of a lesson's table: each idea on the first scene of its head, the largest gain first. `run`:
    the published run. None: the gains are not known, and a dash stands for each."""
    about = "Each idea taken out alone: time without it over time with it (`stepwise ablations --ideas`"
    rows: dict[tuple[str, str], Row] = {}
    if run:
        result = Ideas.load(run / IDEAS_FILE)
        rows = {(row.ablation, row.scene): row for row in result.rows}
        known = result.context and result.context.cpu and result.context.cpu.microarchitecture
        cpu = f"{known}, " if known else ""
        about += f", run `results/reference/{run.name}`; {cpu}one thread, height {result.n}"
    found = []
    for patch in of(phase):
        scene = patch.head["scenes"].split()[0]
        gain, told = 0.0, ["–", "–", "–"]
        if row := rows.get((patch.name, scene)):
            gain = row.gain.value or 0.0
            told = [show.spread(row.gain).replace("\u00a0", " "), change(row), str(row.lines)]
        found.append((-gain, _line([patch.head["idea"], scene, *told])))
    lines = textwrap.wrap(f"{about}).", WIDTH, break_long_words=False, break_on_hyphens=False)
    return [*lines, "", _line(HEADER), _line(["---"] * len(HEADER)), *(line for _, line in sorted(found))]


def filled(text: str, phase: str, run: Path | None) -> str:
    """The lesson with its table made anew: what stands between the marker and the table's last line. Raises
    StudyError for a lesson without the marker."""
    before, begin, rest = text.partition(f"{BEGIN}\n")
    if not begin:
        raise StudyError(f"{phase}: NOTES.md lacks the line {BEGIN}, below which its table stands")
    after = re.sub(r"\A([^|#!]*\n)?(\|.*\n)+", "", rest)
    return f"{before}{begin}{chr(10).join(table(phase, run))}\n{after}"


def lesson(phase: str, text: str) -> str | None:
    """`filled` from the newest published run, and what patches count; None for a phase without ideas."""
    run = published(phase)
    return counted.lesson(phase, filled(text, phase, run), run) if of(phase) else None
