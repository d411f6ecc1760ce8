"""Labs 10 and 12: keys again from the task alone, and the task from the published run's own file."""

import io
import json
import math

import emitted
import pandas as pd
import pytest

from study.commands.labs import judge
from study.core import json_files
from study.core.registry import ROOT
from study.labs import answers, published

STUDENTS = range(12)


def given(asked: list[answers.Question]) -> dict[str, str]:
    table = pd.read_csv(io.StringIO(asked[0].files["task.csv"]), dtype=str)
    return dict(zip(table.given, table.value, strict=True))


def keys(asked: list[answers.Question]) -> dict[str, float | None]:
    return {one.name: one.number for one in asked}


@pytest.mark.parametrize("student", STUDENTS)
def test_keys_of_the_roofline(student):
    asked = answers.questions("published.roofline", student)
    task = given(asked)
    flops, moved, rate, fma, band = (float(task[name]) for name in ("flops", "bytes", "rate", "fma", "L1"))
    slope = band * flops / moved
    assert asked[2].word == ("L1" if slope < fma else "fma")
    assert keys(asked) == pytest.approx(
        {
            "intensity": flops / moved,
            "ridge": fma / band,
            "roof": min(fma, slope),
            "share": 100 * rate / min(fma, slope),
            "least-cycles": max(flops / fma, moved / band),
            "half-the-bytes": min(fma, 2 * slope),
        }
    )
    assert 0 < keys(asked)["share"] < 100


@pytest.mark.parametrize("student", STUDENTS)
def test_keys_of_the_caches(student):
    asked = answers.questions("published.caches", student)
    task = {name: float(value) for name, value in given(asked).items()}
    whole = task["size"] * task["shapes"]
    level = "memory"
    for one in ("L3", "L2", "L1"):
        level = one if whole <= task[f"{one} size"] else level
    lines = sum(task["size"] for _ in range(int(task["shapes"]))) / 64
    assert asked[1].word == level != "L1"
    assert keys(asked) == pytest.approx(
        {
            "lines": lines,
            "level": None,
            "cycles": lines * 64 / task[f"{level} band"],
            "block": math.floor(task["L1 size"] / (2 * task["size"])),
            "blocked": lines * 64 * (1 / (task["rays"] * task[f"{level} band"]) + 1 / task["L1 band"]),
            "ahead": math.ceil(task["latency"] / task["work"]),
        }
    )


def test_ceilings_are_those_of_a_published_run():
    """The best of loads, stores and copies by 256 bits."""
    task = given(answers.questions("published.caches", 3))
    found = []
    for run in published.RUNS:
        file = json_files.read_json(run / "ceilings.json")
        wide = [one for one in file["ceilings"] if one.get("level") and one["bits"] == 256]
        rates = {level: [one["value"] for one in wide if one["level"] == level] for level in published.LEVELS}
        found.append([max(rate) for rate in rates.values()])
    mine = [float(task[f"{level} band"]) for level in published.LEVELS]
    assert any(mine == pytest.approx(one, rel=1e-5) for one in found)


@pytest.mark.parametrize("number", [10, 12])
def test_right_and_wrong_answers(tmp_path, capsys, number):
    """Every question's wrong number has a hint of its own, and the page names every question."""
    lab, path = judge.labs()[number], tmp_path / "answers.json"
    asked = answers.questions(lab.answers, 4)
    page = (ROOT / "docs" / "labs" / lab.page).read_text(encoding="utf-8")
    right = {one.name: {"word": one.word, "number": one.number} for one in asked}
    words = ("judge", number, "--student", 4, "--file", path, "--json")
    path.write_text(json.dumps(right))
    assert emitted.told(*words) == 0
    capsys.readouterr()
    for one in asked:
        key = "number" if one.number is not None else "word"
        wrong = one.number * 1.03 if one.number is not None else None
        path.write_text(json.dumps(right | {one.name: right[one.name] | {key: wrong}}))
        assert emitted.told(*words) == 1 and f"`{one.name}`" in page
        told = emitted.result(capsys.readouterr().out)
        assert told["hint"] == lab.hints[one.name if key == "number" else "word"]
