"""A lab's questions with their keys, the folder that a student gets, and the judging of an answers file."""

import dataclasses
import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from study.core import json_files, registry, store
from study.core.cli import StudyError

TEMPLATE = "answers.json"
ROUNDED = 0.000501  # what three digits behind the point lose


@dataclass(frozen=True)
class Question:
    """`word`: the right one of `words`. `number`: the right one, to the share `within` of its distance from
    `about`, or to ROUNDED where `about` is not 0. None: not asked for. `hint`: the key of a wrong number's
    hint; without it the name. `files`: what the student gets, by name."""

    name: str
    words: Sequence[str] = ()
    word: str | None = None
    number: float | None = None
    within: float = 0.02
    about: float = 0.0
    hint: str = ""
    files: dict[str, str] = dataclasses.field(default_factory=dict)

    def holds(self, number: float | None) -> bool:
        """Whether it is near enough to the right one; not if it is NaN."""
        if number is None or self.number is None:
            return False
        least = ROUNDED if self.about else 0.0
        return abs(number - self.number) <= max(self.within * abs(self.number - self.about), least)

    @property
    def precision(self) -> str:
        share = f"{100 * self.within:g} %"
        return f"{share} of its distance from {self.about:g}" if self.about else share


class Answer(msgspec.Struct, forbid_unknown_fields=True):
    word: str | None = None
    number: float | None = None


@dataclass(frozen=True)
class Judged:
    """`fails`: nothing, or the key of the hint: “word”, or that of the number."""

    name: str
    fails: str
    said: str


def questions(kind: str, student: int) -> list[Question]:
    """Questions of the lab that the function study.labs.MODULE.NAME draws. Raises StudyError."""
    module, _, name = kind.rpartition(".")
    made: list[Question] = getattr(importlib.import_module(f"study.labs.{module}"), name)(student)
    return made


def write(asked: Sequence[Question], number: int, student: int) -> Path:
    """Writes the task's files and an answers file to be filled in, which is left if it is there. Returns the
    folder."""
    folder = registry.ROOT / "build" / "labs" / f"{number}-student-{student}"
    for name, text in [item for one in asked for item in one.files.items()]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        store.write_text(folder / name, text)
    blank = {
        one.name: {
            key: None for key, wanted in (("word", one.word), ("number", one.number)) if wanted is not None
        }
        for one in asked
    }
    if not (folder / TEMPLATE).exists():
        folder.mkdir(parents=True, exist_ok=True)
        store.write_json(folder / TEMPLATE, blank)
    return folder


def read(path: Path, asked: Sequence[Question]) -> dict[str, Answer]:
    """Answers by their questions. Raises StudyError with the place of what is no answer."""
    try:
        found = msgspec.convert(json_files.read_json(path), dict[str, Answer])
    except msgspec.ValidationError as error:
        raise StudyError(f'{path}: {error}; an answer is like {{"word": "drift", "number": 1.2}}') from None
    known = {one.name: one for one in asked}
    for name, answer in found.items():
        if name not in known:
            raise StudyError(f"{path}: $.{name}: no such question; there are {', '.join(known)}")
        words = known[name].words
        if answer.word is not None and answer.word not in words:
            raise StudyError(
                f"{path}: $.{name}.word: '{answer.word}' is none of {', '.join(words) or 'none'}"
            )
    return found


def judged(asked: Sequence[Question], answers: dict[str, Answer]) -> list[Judged]:
    """What is said never has the key in it."""
    made = []
    for one in asked:
        answer, fails = answers.get(one.name, Answer()), ""
        said = f"{one.name}: the number to {one.precision}" if one.number is not None else one.name
        if one.word is not None and answer.word != one.word:
            fails, said = "word", f"{one.name}: the word" + (" is missing" if answer.word is None else "")
        elif one.number is not None and not one.holds(answer.number):
            fails = one.hint or one.name
            said = f"{one.name}: {'the word is right, ' if one.word else ''}the number is over "
            said += f"{one.precision} off"
        made.append(Judged(one.name, fails, said))
    return made
