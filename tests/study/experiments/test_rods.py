"""stepwise rods: its trade-off by hand, its tables of a published run, its whole way at a small size."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import complete
import numpy as np
import pytest

from study.core import commands, store
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures, tables
from study.experiments.rods.schema import FILE, Rods
from study.experiments.systems import experiment as systems
from study.measuring.schema import HitErrors


def test_the_trade_has_the_march_per_pixel_in_its_own_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Made up: 30 ms per pixel, rods that end at 4×4 pixels 2, all others 10; launches interleaved."""
    asked = []

    def milliseconds(phase, scene, size, reps, pad, told, **more):
        (words,) = told.values()
        asked.append((words, more["max_steps"]))
        return 30.0 if "march=pixels" in words else 2.0 if "least=4" in words else 10.0

    monkeypatch.setattr(rods.launches, "milliseconds", milliseconds)
    monkeypatch.setattr(rods.hits, "picture", lambda *_, **__: None)
    monkeypatch.setattr(rods.hits, "errors", lambda *_: HitErrors(evaluations=1.0))
    monkeypatch.setattr(rods.truth, "picture", lambda *_: None)
    rows, pixels = rods.trade(16, 6, 1)
    assert pixels.launches == [30.0] * 6
    assert {row.gain for row in rows if row.least != 4} == {3.0}
    (coarse,) = (row for row in rows if row.least == 4)
    assert (coarse.gain, coarse.gain_low, coarse.gain_high) == (15.0, 15.0, 15.0)
    plain = [i for i, (words, _) in enumerate(asked) if words == "march=pixels picture=map"]
    assert len(asked) == 6 * (len(rows) + 1) and {asked[i][1] for i in plain} == {None}
    assert [i // (len(rows) + 1) for i in plain] == list(range(6)), "once a round"


def made_up() -> dict:
    """A published run, whose march of the article's scene takes 100 ms per pixel, 20 by rods and 5 by rods
    that end at 4×4 pixels; another cap of steps has other figures."""
    data = complete.published(FILE)
    data["own"] |= {"gain": 5.0, "fewer": 20.0}
    data["own"]["pixels"] |= {"ms": 100.0, "evaluations": 10.0, "wrong_ppm": 7.0}
    data["own"]["rods"] |= {"ms": 20.0, "evaluations": 0.5, "wrong_ppm": 1234.0}
    article = {"down": data["article"]["down"], "max_steps": data["article"]["max_steps"], "step": "whole"}
    row = data["trade"][0] | article | {"least": 4, "ms": 5.0, "evaluations": 0.1, "wrong_ppm": 2.0}
    others = [row | {"ms": 1.0, **one} for one in ({"max_steps": 10}, {"step": "safe"}, {"least": 1})]
    return data | {"trade": [row, *others]}


def test_the_articles_figures_beside_ours(tmp_path: Path) -> None:
    store.write_json(tmp_path / FILE, made_up())
    found = tables.system(tmp_path)
    assert found and [(one.said, one.ours.split()[0], one.ratio, one.error) for one in found.claims] == [
        ("150", "100", "1.50×", "7 ppm"),
        ("under 10", "20.0", "0.500×", "1,234 ppm"),
        ("over 15×", "5.00×", "0.333×", "1,234 ppm"),
        ("100×", "20.0×", "0.200×", "1,234 ppm"),
    ]
    assert [part.name for part in found.parts] == ["rods", "rods-trade"]


def test_its_lesson_has_the_articles_settings_alone(tmp_path: Path) -> None:
    store.write_json(tmp_path / FILE, made_up())
    found = tables.system(tmp_path)
    assert found
    (lesson,) = found.lessons()
    assert lesson.name == "rods"
    assert [[text.split(" [")[0] for text, _ in row[1:]] for row in lesson.table.cells] == [
        ["100", "10.0", "1.00×", "7.00"],
        ["20.0", "0.500", "20.0×", "1,234"],
        ["5.00", "0.100", "100×", "2.00"],
    ]


def test_colours_by_hand() -> None:
    steps, depth, error = pictures.columns(20, 2.0, 4.0)
    assert steps.rgb(np.array([1, 20]))[:, 0].tolist() == [1, 0]
    assert depth.rgb(np.array([2, 4, np.inf]))[:, 0] == pytest.approx([1, 0.15, 0], abs=0.005)
    planes = {"id": np.array([[0, 0, 1, -1]]), "Z": np.array([[1, 2, 3, np.inf]])}
    made = {"id": np.array([[0, 0, 0, -1]]), "Z": np.array([[1 + 1e-6, 2.1, 3, np.inf]])}
    shown = pictures.error_rgb(error, planes, made)[0]
    assert shown[[0, 3]].tolist() == [[1, 1, 1]] * 2 and shown[1] == pytest.approx([0, 0, 0], abs=0.01)
    assert tuple(shown[2]) == pictures.WRONG


@pytest.mark.slow
def test_from_pictures_to_its_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With a corner of the trade-off."""
    monkeypatch.setattr(rods, "DOWN", (8, 16))
    monkeypatch.setattr(rods, "CAPS", (20,))
    words = ["--scene", "trio", "-n", "18", "--article-n", "32", "--launches", "2", "--seed", "1"]
    outcome, _ = commands.called("rods", [*words, "--run", str(tmp_path)])
    result = Rods.load(tmp_path / FILE)
    assert outcome.ended == 0 and outcome.result == result
    assert (result.own.scene, result.own.n, result.own.width) == (rods.SCENE, 32, 32)
    assert [(row.scene, row.n) for row in result.rows] == [("trio", 18)]
    for row in (result.own, *result.rows):
        assert row.rods.evaluations < row.pixels.evaluations and row.fewer > 1 and row.rods.ms > 0
    assert [(row.down, row.least, row.step) for row in result.trade] == [
        (8, 1, "whole"),
        (16, 1, "whole"),
        *((16, k, "whole") for k in (2, 4, 8)),
        (16, 1, "safe"),
    ]
    assert (tmp_path / "images" / f"{pictures.PICTURES}.png").exists()
    assert [p.name for p in systems.section(SimpleNamespace(path=tmp_path)).parts] == [
        "systems",
        "rods",
        "rods-trade",
    ]
