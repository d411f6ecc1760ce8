"""The labs of docs/labs: what labs.json says of each, and what its page does."""

import re
from dataclasses import dataclass

from study.core import json_files, registry
from study.core.registry import Scene

FILE = registry.ROOT / "docs" / "labs" / "labs.json"


@dataclass(frozen=True)
class Lab:
    """An entry of labs.json.

    Of a lab that asks for a phase: `speedup` over `start` on `scene`, `lanes`: by how much the share of
    lanes at work must rise, `calls`: a pattern of functions whose calls may be at most `share` of the
    start's, `libm`: functions of libm, of which the same is asked, `same_bits`: the picture of `start`, else
    one within the phase's tolerance. Of one that asks for a scene: PSNR to baseline there of `breaks` (at
    most `below_db`) and of `start` (at least `exact_db`). Of one with a `height`, where baseline and truth
    would take too long: the start's bits there, and on the scenes in the files of `also`, which have hints
    by their names; and at most `share` of the start's calls or `events` (counting.cachegrind), by `threads`;
    of a scene of a `crowd`, so many `shapes` of its kinds, where it names none. Of one without a `start`
    that is the phase's parent, and the picture must be within `truth_db` of ground truth. `answers`: the
    function of study.labs that asks for words and numbers. `hints`: what is said, by the check that fails.
    """

    number: int
    title: str
    page: str
    minutes: int
    hints: dict[str, str]
    start: str = ""
    scene: str = ""
    answers: str = ""
    height: int = 0
    crowd: tuple[str, ...] = ()
    shapes: int = 0
    events: str = ""
    threads: int = 1
    truth_db: float = 0.0
    speedup: float = 1.0
    same_bits: bool = False
    also: tuple[str, ...] = ()
    lanes: float = 0.0
    calls: str = ""
    libm: tuple[str, ...] = ()
    share: float = 1.0
    breaks: str = ""
    below_db: float = 0.0
    exact_db: float = 0.0


def labs() -> dict[int, Lab]:
    return {one["number"]: Lab(**one) for one in json_files.read_json(FILE)["labs"]}


def measuring(lab: Lab, name: str, scene: Scene | None = None) -> str:
    """The command of the lab's page that builds and measures `name` beside the start. `scene`: of a crowd."""
    page = (FILE.parent / lab.page).read_text(encoding="utf-8")
    line = r"^(?:make try|(?:make phase-.*\n)?scripts/stepwise time) (?:.*\\\n)*.*"
    found = re.search(line, page, re.MULTILINE)
    lines = re.sub(r"\s*\\\n\s*", " ", found[0]).splitlines() if found else []
    line = " && ".join(one.partition(" #")[0].rstrip() for one in lines)
    if scene:
        place = str(scene.path.relative_to(registry.ROOT))
        line = re.sub(r"\bSCENE(?= )|build/labs/scenes/\S+", place, line)
    return re.sub(r"\bmine\b", name, line)
