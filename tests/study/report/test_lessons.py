"""The lessons, phases/NAME/NOTES.md: their form, their excerpts of code, and their figures."""

import re
from functools import cache
from pathlib import Path

import complete
import matplotlib
import pytest

from study.core import patches, registry, store
from study.core.cli import StudyError
from study.experiments.ablations import ideas
from study.pictures.draw import STYLE
from study.report import lesson_times, lessons, lessons_draw

PARTS = ["Bottleneck", "Idea", "Prediction", "Result", "Limits", "Read next"]
LINES, COLUMNS, EXCERPT = 59, 100, 15
GAP = 9  # lines of the source that an excerpt may leave out without a line of dots
DOTS = ("...", "…")
PHASES = sorted(registry.phases())


def notes(name: str) -> str:
    return (registry.find_phase(name).path / "NOTES.md").read_text(encoding="utf-8")


def parts(text: str) -> dict[str, str]:
    """Heading → what stands below it. A heading is a line `## Idea`, or begins with **Idea**."""
    found = re.split(r"^(?:## +|\*\*)(" + "|".join(PARTS) + r")\b", text, flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def excerpts(text: str) -> list[list[str]]:
    """The blocks of C: the last is the phase's own, one before it its parent's (or its own)."""
    return [block.splitlines() for block in re.findall(r"^```c\n(.*?)^```", text, re.MULTILINE | re.DOTALL)]


def normal(line: str) -> str:
    """Without blanks that say nothing and without a comment."""
    return " ".join(re.sub(r"//.*|/\*.*?\*/", "", line).split())


def follows(excerpt: list[str], source: list[str]) -> int:
    """How many lines of the excerpt stand in the source in order, each at most GAP lines behind the last;
    a line of dots stands for any number of lines."""
    furthest = 0
    for start, line in enumerate(source):
        if line != excerpt[0]:
            continue
        at, count, room = start, 1, GAP
        for wanted in excerpt[1:]:
            if wanted in DOTS:
                room, count = len(source), count + 1
                continue
            found = next(
                (i for i in range(at + 1, min(at + 1 + room, len(source))) if source[i] == wanted), None
            )
            if found is None:
                break
            at, count, room = found, count + 1, GAP
        furthest = max(furthest, count)
    return furthest


def missing(excerpt: list[str], sources: list[list[str]]) -> list[str]:
    """The lines of an excerpt from the first on that no source has. Comments are free."""
    own = [line for line in map(normal, excerpt) if line]
    return own[max(follows(own, source) for source in sources) :]


@cache
def sources(name: str) -> list[list[str]]:
    """The normal lines of each file of a phase's tree."""
    texts = [path.read_text(encoding="utf-8") for path in patches.files(name).values()]
    return [[normal(line) for line in text.splitlines()] for text in texts]


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
    for before in found[:-1]:  # or one more of its own
        assert not missing(before, sources(name)) or not missing(before, sources(parent or name))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(lessons.PANELS))
def test_its_figure_is_what_the_published_run_says(name: str) -> None:
    path = registry.find_phase(name).path / lessons.NAME
    assert f"]({lessons.NAME})" in notes(name)
    made = lessons.figure(name)
    assert made and path.read_text() == lessons_draw.svg(made)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(lessons.PANELS))
def test_a_legend_of_its_figure_is_beside_the_title(name: str) -> None:
    made = lessons.figure(name)
    assert made
    with matplotlib.rc_context(STYLE):
        for axes in lessons_draw.draw(made).axes:
            title = axes.get_title(loc="left") and axes._left_title.get_window_extent()  # pyright: ignore
            legend = axes.get_legend()
            assert not (title and legend and legend.get_window_extent().overlaps(title))


@pytest.mark.parametrize("name", sorted({*lessons.PANELS} - {"baseline", "truth"}))
def test_its_times_are_what_the_published_run_says(name: str) -> None:
    assert lesson_times.filled(name, notes(name)) == notes(name)


def test_the_lessons_of_systems_are_of_the_newest_run_that_has_them_all(tmp_path: Path) -> None:
    for name, day, files in (
        ("zen9-a", 1, lessons.SYSTEMS),
        ("zen1-b", 2, lessons.SYSTEMS),
        ("zen5-c", 3, lessons.SYSTEMS[:-1]),
    ):
        (tmp_path / name).mkdir()
        store.write_json(tmp_path / name / "context.json", {"time": f"2026-11-0{day}T00:00:00+00:00"})
        for file in files:
            (tmp_path / name / file).touch()
    assert lessons.systems(tmp_path).name == "zen1-b"


WITH_IDEAS = [name for name in PHASES if ideas.of(name)]


@pytest.mark.parametrize("name", WITH_IDEAS)
def test_its_table_of_ideas_is_what_the_published_run_says(name: str) -> None:
    text = notes(name)
    made = ideas.filled(text, name, ideas.published(name))
    assert made == text
    told = [line.split(" | ")[0] for line in parts(text)["Result"].splitlines() if line.startswith("| ")]
    assert {f"| {patch.head['idea']}" for patch in ideas.of(name)} <= set(told)


@pytest.mark.parametrize("name", [patch.name for phase in WITH_IDEAS for patch in ideas.of(phase)])
def test_an_idea_is_taken_out_of_its_phase_and_its_lines_are_found(name: str) -> None:
    (patch,) = [one for one in ideas.of(name.partition("+")[0]) if one.name == name]
    assert (patch.head["direction"], patch.head["against"]) == ("removed", name.partition("+")[0])
    assert ideas.code_lines(name) > 0
    for scene in patch.head["scenes"].split():
        ideas.check_scene(scene)


def test_the_phases_behind_the_papers_have_their_ideas() -> None:
    assert {"opt6_wide", "opt7_tiles", "opt8_streams", "opt9_convex"} <= set(WITH_IDEAS)
    assert all(len(ideas.of(name)) >= 3 for name in WITH_IDEAS)


def measured(phase: str, n: int = 360) -> dict:
    def row(patch: patches.Patch, scene: str, at: int) -> dict:
        gain = {"value": 1 + at / 10, "low": 1.0, "high": 2.0, "launches": 20, "sufficient": True}
        told = {"change_psnr_db": 101.26 if at else None, "change_max_abs": 1e-4 * at, "lines": 10 + at}
        return {"ablation": patch.name, "scene": scene, "gain": gain, **told}

    rows = [row(p, s, i) for i, p in enumerate(ideas.of(phase)) for s in p.head["scenes"].split()]
    context = {"cpu": {"model": "AMD EPYC", "microarchitecture": "Zen 9"}}
    return {"rows": rows, "skipped": [], "failures": [], "n": n, "launches": 20, "context": context}


def test_a_table_of_ideas_is_of_the_newest_run_that_has_them_all(tmp_path: Path) -> None:
    name = "opt6_wide"
    for run, made in {
        "zen9-2027-01-02": measured(name),
        "zen1-2027-01-01": measured(name, 90),
        "zen9-2027-02-01": measured("opt7_tiles"),
    }.items():
        (tmp_path / run).mkdir()
        complete.write(tmp_path / run / ideas.IDEAS_FILE, made)
    (tmp_path / "zen9-2027-03-01").mkdir()
    found = ideas.published(name, tmp_path)
    assert found == tmp_path / "zen9-2027-01-02"
    lines = ideas.filled(f"a\n\n{ideas.BEGIN}\nold\n\n| x |\n\nb\n", name, found).splitlines()
    assert lines[:3] == ["a", "", ideas.BEGIN] and lines[-2:] == ["", "b"]
    assert "`results/reference/zen9-2027-01-02`; Zen 9, " in " ".join(lines)
    rows = [line for line in lines if line.startswith("| ")][2:]
    assert len(rows) == len(ideas.of(name)) and all(len(line) <= COLUMNS for line in lines)
    assert rows[0].endswith("| 1.20 [1.00, 2.00] | 101 dB | 12 |")  # the largest gain
    assert rows[-1].endswith("| 1.00 [1.00, 2.00] | identical | 10 |")
    again = ideas.filled("\n".join([*lines, ""]), name, found)
    assert again.splitlines() == lines
    with pytest.raises(StudyError, match="<!-- ideas"):
        ideas.filled("# a lesson\n", name, found)


def test_the_lines_of_a_function_are_its_definitions() -> None:
    text = "int f(int);\nint f(int a,\n      int b) {\n    return f(1);\n}\nstatic int\ng(void) {\n}\n"
    assert [ideas.function_lines(text, name) for name in "fgh"] == [4, 2, 0]


def test_every_phase_of_the_published_run_has_a_figure() -> None:
    measured = set(store.read_json(lessons.RUN / "plan.json")["phases"])
    assert measured & set(PHASES) <= set(lessons.PANELS) <= set(PHASES)


F = "int f(int x) {"


def test_a_stale_excerpt_is_seen() -> None:
    body = "".join(f"    step({i});\n" for i in range(20))
    text = f"{F}\n    return  x + 1; // one more\n}}\nvoid g(void) {{\n{body}    end();\n}}\n"
    own = [[normal(line) for line in text.splitlines()]]
    assert missing([F, "    // why", "  return x + 1;", "}"], own) == []
    assert missing([F, "    return x + 2;", "}"], own) == ["return x + 2;", "}"]
    assert missing(["    return x + 1;", F], own) == [F]
    assert missing(["void g(void) {", "    ...", "    end();"], own) == []
    assert missing(["void g(void) {", "    end();"], own) == ["end();"]


@pytest.mark.parametrize(("value", "said"), [(1234.5, "1,234"), (0.0123, "0.0123"), (9.96, "9.96"), (0, "0")])
def test_numbers_have_three_digits(value: float, said: str) -> None:
    assert lessons_draw.number(value) == said


PROOFS = sorted(name for name in PHASES if (registry.find_phase(name).path / "PROOFS.md").is_file())


@pytest.mark.parametrize("name", PROOFS)
def test_the_tests_that_proofs_name_exist(name: str) -> None:
    text = (registry.find_phase(name).path / "PROOFS.md").read_text(encoding="utf-8")
    known = {path.stem for path in (registry.ROOT / "tests").rglob("test_*.*")}
    for path in (registry.ROOT / "tests").rglob("test_*.py"):
        known |= set(re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"\btest_\w+", text)) <= known
    numbers = [int(n) for n in re.findall(r"^(\d+)\. ", text, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1)) and text.count("Test:") >= len(numbers)
    assert all(len(line) <= COLUMNS for line in text.splitlines())
