"""The lessons, phases/NAME/NOTES.md: their form, their excerpts of code, and their figures."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from study import lessons, lessons_svg, patches, registry, store
from study.cli import StudyError

PARTS = ["Bottleneck", "Idea", "Prediction", "Result", "Limits", "Read next"]
LINES, COLUMNS, EXCERPT = 60, 100, 15
PHASES = sorted(registry.phases())


def notes(name: str) -> str:
    return (registry.find_phase(name).path / "NOTES.md").read_text(encoding="utf-8")


def parts(text: str) -> dict[str, str]:
    """Heading → what stands below it. A heading is a line `## Idea`, or begins with **Idea**."""
    found = re.split(r"^(?:## +|\*\*)(" + "|".join(PARTS) + r")\b", text, flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def excerpts(text: str) -> list[list[str]]:
    """The blocks of C: the last is the phase's own, one before it its parent's."""
    return [block.splitlines() for block in re.findall(r"^```c\n(.*?)^```", text, re.MULTILINE | re.DOTALL)]


def normal(line: str) -> str:
    """Without blanks that say nothing and without a comment."""
    return " ".join(re.sub(r"//.*|/\*.*?\*/", "", line).split())


def missing(excerpt: list[str], sources: dict[str, str]) -> list[str]:
    """Lines of an excerpt that stand in none of the sources. A line of dots, a comment or a brace is free."""
    there = {normal(line) for text in sources.values() for line in text.splitlines()}
    own = [normal(line) for line in excerpt]
    return [line for line in own if line not in ("", "...", "…") and line not in there]


def sources(name: str) -> dict[str, str]:
    return {file: path.read_text(encoding="utf-8") for file, path in patches.files(name).items()}


@pytest.mark.parametrize("name", PHASES)
def test_a_lesson_is_short_and_has_its_parts_in_order(name: str) -> None:
    text = notes(name)
    lines = text.splitlines()
    assert len(lines) <= LINES
    assert [f"{number}: {line}" for number, line in enumerate(lines, 1) if len(line) > COLUMNS] == []
    assert lines[0].startswith(f"# {name}: ")
    assert list(parts(text)) == PARTS
    assert "|" in parts(text)["Result"], "no table"


@pytest.mark.parametrize("name", PHASES)
def test_its_excerpts_stand_in_the_code(name: str) -> None:
    found = excerpts(parts(notes(name))["Idea"])
    assert found, "no excerpt of code"
    assert all(len(block) <= EXCERPT for block in found)
    assert missing(found[-1], sources(name)) == []
    parent = registry.find_phase(name).parent
    for before in found[:-1]:
        assert parent and missing(before, sources(parent)) == []


@pytest.mark.parametrize("name", sorted(lessons.PANELS))
def test_its_figure_is_what_the_published_run_says(name: str) -> None:
    path = registry.find_phase(name).path / lessons.NAME
    assert f"]({lessons.NAME})" in notes(name), "NOTES.md does not show its figure"
    assert path.stat().st_size < 20_000
    assert lessons.embedded(path) == lessons.figure(name), "scripts/lessons.py draws it again"


def test_every_phase_of_the_published_run_has_a_figure() -> None:
    measured = set(store.read_json(lessons.RUN / "plan.json")["phases"])
    assert measured & set(PHASES) <= set(lessons.PANELS) <= set(PHASES)


def test_a_stale_excerpt_is_seen() -> None:
    own = {"a.c": "int f(int x) {\n    return  x + 1; // one more\n}\n"}
    assert missing(["int f(int x) {", "    // why", "    ...", "  return x + 1;", "}"], own) == []
    assert missing(["    return x + 2;"], own) == ["return x + 2;"]


def test_a_figure_holds_its_data(tmp_path: Path) -> None:
    row = {"label": "a < b", "values": [[2.0, 1.9, 2.1], [1.0, None, None]]}
    panel = {"kind": "pairs", "title": "time", "unit": "ms", "series": ["x", "y"], "rows": [row]}
    data = {"phase": "p", "title": "t & u", "caption": "c", "panels": [panel, panel | {"kind": "bars"}]}
    path = tmp_path / "lesson.svg"
    path.write_text(lessons_svg.svg(data), encoding="utf-8")
    assert lessons.embedded(path) == data and "2.00×" in path.read_text(encoding="utf-8")
    path.write_text("<svg xmlns='http://www.w3.org/2000/svg'/>", encoding="utf-8")
    with pytest.raises(StudyError, match=r"lesson\.svg: no figure of scripts/lessons\.py"):
        lessons.embedded(path)


@pytest.mark.parametrize(("value", "said"), [(1234.5, "1,234"), (0.0123, "0.0123"), (9.96, "9.96"), (0, "0")])
def test_numbers_have_three_digits(value: float, said: str) -> None:
    assert lessons_svg.number(value) == said
