"""Lab 13: every key again from the files that a student gets, by pandas and SciPy's own routines."""

import io
import json
import re

import emitted
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.commands.labs import judge
from study.core import cli
from study.core.registry import ROOT
from study.labs import answers, statistics

STUDENTS = range(60)  # who have every kind


def medians(table: pd.DataFrame) -> float:
    middle = table.groupby("program").ms.median()
    return middle.old / middle.new


def number(word: str, table: pd.DataFrame) -> float:
    """The key by the page's rule."""
    if word == "mean_of_ratios":
        return table["old ms"].sum() / table["new ms"].sum()
    if word == "best_of_many":
        return stats.binom.sf(0, len(table), table.p.min())
    if word == "warm_up":
        return medians(table[table.frame > 1])
    if word == "not_independent":
        means = table[table.program == "new"].groupby("launch").ms.mean()
        low, high = stats.t.interval(0.95, len(means) - 1, means.mean(), stats.sem(means))
        return (high - low) / 2
    if word == "drift":  # one slope for both: each about its own middle
        table = table.assign(log=np.log(table.ms))
        of = {name: rows for name, rows in table.groupby("program")}
        own = [rows[["launch", "log"]] - rows[["launch", "log"]].mean() for rows in of.values()]
        both = pd.concat(own)
        slope = stats.linregress(both.launch, both.log).slope
        away = of["old"].log.mean() - of["new"].log.mean()
        return np.exp(away - slope * (of["old"].launch.mean() - of["new"].launch.mean()))
    if word == "other_work":
        table = table.assign(ms=table.ms / (table.width * table.height))
    return medians(table)


@pytest.mark.parametrize("word", statistics.FAULTS)
def test_a_key_is_what_the_samples_say(word):
    """And the report's first number is another, but where nothing is wrong."""
    seen = 0
    for student in STUDENTS:
        for one in answers.questions("statistics.questions", student):
            if one.word != word:
                continue
            seen += 1
            text, table = (one.files[f"{one.name}.{end}"] for end in ("txt", "csv"))
            assert number(word, pd.read_csv(io.StringIO(table))) == pytest.approx(one.number, rel=1e-9)
            pattern = {"not_independent": r"± ([\d.]+)", "best_of_many": r"p = ([\d.]+)"}
            (claim,) = re.findall(pattern.get(word, r"([\d.]+)×"), text)
            assert one.holds(float(claim)) == (word == "sound")
    assert seen > 5


def test_a_ratio_is_judged_by_what_it_says_beyond_one():
    """Three digits are enough; 3 % off of what it gains are wrong, and “no gain” where it gains."""
    near = 0
    for student in STUDENTS:
        for one in answers.questions("statistics.questions", student):
            if one.word in statistics.NO_RATIO:
                assert one.holds(one.number * 1.019) and not one.holds(one.number * 1.021)
                continue
            gain = one.number - 1
            assert one.holds(round(one.number, 3)) and one.holds(1 + 1.019 * gain)
            if abs(gain) > 0.02:
                near += abs(gain) < 0.1
                assert not one.holds(1 + 1.03 * gain) and not one.holds(1 + 0.97 * gain) and not one.holds(1)
    assert near > 5


def test_each_student_has_five_kinds_and_other_numbers():
    kinds = [
        [one.word for one in answers.questions("statistics.questions", student)] for student in (1, 2, 3)
    ]
    assert all(len(set(words)) == statistics.REPORTS for words in kinds)
    assert len({tuple(words) for words in kinds}) == 3


@pytest.fixture
def handed_in(tmp_path, capsys):
    """Judges student 5's answers, of which one is changed: status, and the result."""
    path = tmp_path / "answers.json"
    right = {
        one.name: {"word": one.word, "number": one.number}
        for one in answers.questions("statistics.questions", 5)
    }

    def call(changed: dict | None = None) -> tuple[int, dict]:
        path.write_text(json.dumps(right | (changed or {})))
        status = emitted.told("judge", 13, "--student", 5, "--file", path, "--json")
        return status, emitted.result(capsys.readouterr().out)

    return call


def test_right_answers(handed_in):
    status, told = handed_in()
    assert status == 0 and all(one["passed"] for one in told["checks"]) and len(told["checks"]) == 5


def test_a_wrong_answer_has_its_hint_and_no_key(handed_in):
    key = answers.questions("statistics.questions", 5)[2]
    other = next(word for word in statistics.FAULTS if word != key.word)
    for wrong, hint in (
        ({"word": other, "number": key.number}, "word"),
        ({"word": None, "number": key.number}, "word"),
        ({"word": key.word, "number": key.number * 1.03}, key.word),
        ({"word": key.word}, key.word),
        ({"word": key.word, "number": float("nan")}, key.word),
    ):
        status, told = handed_in({key.name: wrong})
        failing = [one for one in told["checks"] if not one["passed"]]
        assert status == 1 and [one["name"] for one in failing] == [key.name]
        assert told["hint"] == judge.labs()[13].hints[hint]
        assert f"{key.number:.3g}" not in failing[0]["said"] and key.word not in failing[0]["said"]


@pytest.mark.parametrize(
    ("changed", "place"),
    [
        ({"report-9": {"word": "sound"}}, r"\$\.report-9"),
        ({"report-1": {"word": "noise"}}, r"\$\.report-1\.word"),
        ({"report-1": {"number": "two"}}, "report|number"),
        ({"report-1": {"words": "sound"}}, "words"),
    ],
)
def test_what_is_no_answer_is_named(handed_in, changed, place):
    with pytest.raises(cli.StudyError, match=place):
        handed_in(changed)


def test_a_task_is_written_once(tmp_path, monkeypatch, capsys):
    """Filled-in answers are left as they are."""
    monkeypatch.setattr(answers.registry, "ROOT", tmp_path)
    assert emitted.told("judge", 13, "--student", 5) == 0
    (file,) = tmp_path.rglob(answers.TEMPLATE)
    assert len(list(file.parent.iterdir())) == 11
    file.write_text('{"report-1": {"word": "sound"}}')
    assert emitted.told("judge", 13, "--student", 5) == 0 and "sound" in file.read_text()
    assert emitted.told("judge", 13, "--student", 5, "--file", file) == 1
    assert "the word" in capsys.readouterr().out
    with pytest.raises(cli.StudyError, match="--student 5"):  # another student's task
        emitted.told("judge", 13, "--file", file)


def test_the_page_has_every_word():
    page = (ROOT / "docs" / "labs" / "13-statistics.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert rows == list(statistics.FAULTS) and set(rows) < judge.labs()[13].hints.keys()
