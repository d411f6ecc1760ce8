"""What stands in the files of a run: schemas, by which a file is checked where it is read.

A schema is a class of keys, each with its type, unit and meaning. The pages of keys are made from
them (study.experiments.keys).
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, get_args, get_origin, get_type_hints

import msgspec

from study.core import json_files
from study.core.cli import StudyError


def key(unit: str, meaning: str, **bounds: Any) -> msgspec.Meta:
    """What a key is: its unit ("" for none), its meaning in a few words, and bounds as msgspec has them."""
    return msgspec.Meta(description=meaning, extra={"unit": unit}, **bounds)


class Record(msgspec.Struct):
    """An object in a file. A key that it does not know is no fault: a newer version may have written it."""


class File(Record):
    """The object of a JSON file, or of a line of it. `made_by`: the command that writes it."""

    made_by: ClassVar[str]

    @classmethod
    def current(cls, data: Any) -> Any:
        """`data` of an older version as this one writes it: keys by their names of today."""
        return data

    @classmethod
    def load(cls, path: Path) -> Self:
        """The content of `path`, or of the packed file in its place. Raises StudyError: a line with the file,
        the key and the command that makes it again."""
        path = json_files.stored(path)
        try:
            return cls.of(json_files.read_json(path), str(path))
        except StudyError as error:
            raise StudyError(f"{error}; make it again with scripts/stepwise {cls.made_by}") from None

    @classmethod
    def load_if_there(cls, path: Path) -> Self | None:
        """`load`, None without that file. Raises StudyError."""
        return cls.load(path) if json_files.stored(path).exists() else None

    @classmethod
    def of(cls, data: Any, where: str) -> Self:
        """`data`, the content of the file `where`. Raises StudyError."""
        with contextlib.suppress(LookupError, TypeError, AttributeError):  # no such file: said below
            data = cls.current(data)
        try:
            return msgspec.convert(data, cls)
        except msgspec.ValidationError as error:
            raise StudyError(f"{where}: {error}") from None


def fields(kind: type[Record]) -> Iterator[tuple[str, Any, msgspec.Meta]]:
    """Each key's name in the file, its type and what it is. Raises TypeError where it does not say."""
    hints = get_type_hints(kind, include_extras=True)
    for one in msgspec.structs.fields(kind):
        hint = hints[one.name]
        found = [each for each in get_args(hint)[1:] if isinstance(each, msgspec.Meta)]
        if get_origin(hint) is not Annotated or not found:
            raise TypeError(f"{kind.__name__}.{one.name} does not say its unit and meaning")
        yield one.encode_name, get_args(hint)[0], found[0]


def is_record(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Record)
