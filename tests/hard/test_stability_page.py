"""The chapter of the hard cases comes from stability.json alone; the command's files and statuses."""

from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from study.core import cli, commands, store
from study.core.cli import StudyError
from study.experiments.stability import cases as hard
from study.experiments.stability import experiment, figures, tables
from study.experiments.stability.cases import measure
from study.experiments.stability.schema import FILE, Phase, Skipped, Stability

ABOUT = msgspec.structs.replace(
    hard.find_cases(["halo"])[0].about, why="<b>wide</b>, *so*", strengths=(1.0, 0.1, 1e-6)
)
HALO = hard.Case(ABOUT, hard.find_cases(["halo"])[0].run)


def data() -> Stability:
    """Two phases on one case: one hangs at last, one is right, with markup in a note."""
    hangs = [measure.Point(1.0, measure.RIGHT, 0.0), measure.Point(0.1, measure.WRONG, 2.5, note="a <i> b")]
    right = [measure.Point(s, measure.RIGHT, 1e-4) for s in ABOUT.strengths]
    rows = [
        measure.row("opt3", HALO, [*hangs, measure.Point(1e-6, measure.HUNG, note="after 6 s")]),
        measure.row("opt4", HALO, right),
    ]
    phases = [Phase(name=name, precision="float") for name in ("opt3", "opt4")]
    return Stability(phases=phases, cases=[ABOUT], results=rows, skipped=[Skipped(phase="opt5", reason="x")])


def test_the_chapter_is_of_the_file_alone(tmp_path: Path) -> None:
    assert experiment.section(SimpleNamespace(path=tmp_path)).html == ""
    store.write_json(tmp_path / FILE, cli.plain(data()))
    found = experiment.section(SimpleNamespace(path=tmp_path))
    assert "&lt;b&gt;wide&lt;/b&gt;, <em>so</em>" in found.html and "a &lt;i&gt; b" in found.html
    assert 'href="#hard-03-halo"' in found.html and "data:image/" in found.html
    assert ">0.1</td>" in found.html and '<td class="good">·</td>' in found.html
    assert "<td class=bad>hung</td>" in found.html and "opt3" in found.answer


def test_what_a_phase_does() -> None:
    wrong, right = data().results
    assert {"0.1:", "2.5"} <= set(tables.does(wrong, ABOUT)[0].split())
    assert tables.does(right, ABOUT)[0].endswith("10⁻⁴ scene units")
    assert tables.does(msgspec.structs.replace(wrong, first_failure=1e-6), ABOUT)[0].endswith(": hung")
    assert len(figures.draw(data()).axes[0].patches) == 2


def stability(*words: object) -> cli.Outcome:
    return commands.called("stability", list(map(str, words)))[0]


def test_a_wrong_answer_is_a_result(tmp_path: Path) -> None:
    found = stability("--phase", "opt2", "--case", "step_cap", "--strengths", "few", "--run", tmp_path)
    assert found.ended == cli.OK
    (row,) = Stability.load(tmp_path / FILE).results
    assert (row.case, row.phase, row.non_finite, row.hung) == ("step_cap", "opt2", 0, False)
    assert row.first_failure in row.strengths and len(row.errors) == 3
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert names == {FILE, "figures/hard-04-step-cap.svg", "figures/hard-04-step-cap.png"}


def test_a_hang_fails(tmp_path: Path) -> None:
    """No picture is done in a microsecond."""
    words = ["--phase", "opt2", "--case", "halo", "--strengths", "few", "--time-limit", "1e-6"]
    found = stability(*words, "--run", tmp_path)
    assert found.ended == cli.FAILED and len(found.failed) == 3
    assert Stability.load(tmp_path / FILE).results[0].hung is True


@pytest.mark.parametrize("words", [["--case", "hello"], ["--phase", "opt99"]])
def test_a_name_that_there_is_not(tmp_path: Path, words: list[str]) -> None:
    with pytest.raises(StudyError, match=words[1]):
        stability(*words, "--run", tmp_path)
    assert not list(tmp_path.iterdir())


def test_list() -> None:
    assert [case.number for case in stability("--list").result["cases"]] == [c.number for c in hard.cases()]
