"""The throttle of rod marching: what it chooses, by hand and for real; its table of a published run."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import complete
import numpy as np
import pytest

from study.core import commands, registry, store
from study.core.registry import find_scene
from study.experiments.flight import tables, throttle
from study.experiments.flight.schema import THROTTLE, Large, Setting, Throttle
from study.measuring.schema import HitErrors


@pytest.mark.parametrize(
    ("psnr", "wrong", "non_finite", "fits"),
    [(40, 1000, 0, True), (None, 0, 0, True), (39.9, 1000, 0, False), (40, 1001, 0, False),
     (99, 0, 1, False), (math.nan, 0, 0, False), (50, math.nan, 0, False)],
)  # fmt: skip
def test_enough(psnr: float | None, wrong: float, non_finite: int, fits: bool) -> None:
    found = HitErrors(psnr_db=psnr, wrong_ppm=wrong, non_finite=non_finite)
    assert throttle.enough(found, 40, 1000) == fits


def test_it_takes_the_fastest_within_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Made-up pictures and times: the fastest is outside, a first look lies about the next two, and the
    choice's luck among the finalists is not its gain."""
    psnr = {throttle.PLAIN: 60, "a": 30, "b": 45, "c": 41, "d": 50}
    first = {throttle.PLAIN: 10.0, "a": 1.0, "b": 3.0, "c": 2.9, "d": 8.0}
    final = first | {"b": 2.0, "c": 4.0}
    anew = {throttle.PLAIN: 12.0, "b": 6.0}
    looks = dict.fromkeys(psnr, 0)
    sizes = set()

    def milliseconds(phase, scene, size, reps, pad, told):
        (words,) = told.values()
        sizes.add(size[1])
        looks[words] += 1
        if size[1] == 360:
            return {throttle.PLAIN: 100.0, "b": 125.0}[words]
        if words == throttle.PLAIN:
            return anew[words] if looks[words] > 1 else first[words]
        return first[words] if looks[words] == 1 else final[words] if looks[words] <= 6 else anew[words]

    def picture(phase, scene, size, told):
        (words,) = told.values()
        planes = {name: np.full((1, 4), 0.5, np.float32) for name in ("R", "G", "B", "Z", "id")}
        return words if size[1] == 90 else planes

    monkeypatch.setattr(throttle, "launches", SimpleNamespace(**vars(throttle.launches)))
    monkeypatch.setattr(throttle.launches, "milliseconds", milliseconds)
    monkeypatch.setattr(throttle.truth, "picture", lambda *_: None)
    monkeypatch.setattr(throttle.hits, "picture", picture)
    error = lambda exact, made: HitErrors(psnr_db=psnr[made], wrong_ppm=0, non_finite=0)  # noqa: E731
    monkeypatch.setattr(throttle.hits, "errors", error)
    how = {"wrong_ppm": 1000, "count": 5, "seed": 1, "wanted": list("abcd")}
    found = throttle.choose(find_scene("trio"), 90, 40, **how)
    assert found.chosen and found.chosen.settings == "b" and found.within == 3 and found.large is None
    assert (found.finalists["b"].ms, found.chosen.ms, found.plain.ms) == (2, 6, 12)
    assert found.gain == 2
    assert looks["a"] == 0
    looks.update(dict.fromkeys(psnr, 0))
    more = throttle.choose(find_scene("trio"), 90, 40, **how, large=360).large
    assert more and (more.gain, more.psnr_db, more.other_ppm) == (0.8, None, 0) and sizes == {90, 360}
    none = throttle.choose(find_scene("trio"), 90, 70, **how, large=360)
    assert none.chosen is None and none.large is None and none.within == 0


def test_two_pictures_with_nan_are_not_identical() -> None:
    about = {"width": 1, "n": 1, "other_ppm": 0.0, "psnr_db": None, "chosen": None, "plain": None}
    bad, same = (tables.apart(Large(**about, non_finite=count)) for count in (1, 0))
    assert bad.startswith("not finite") and same.startswith("identical")


def test_the_table_of_a_published_run() -> None:
    result = Throttle.load(complete.RUN / THROTTLE)
    found = tables.system(complete.RUN)
    assert found and found.claims == [] and len(found.parts[0].table.cells) == len(result.rows)
    told = tables.words_of(Setting(settings="march=rods size=16 least=2 steps=0 finish=8"))
    assert [int(word) for word in told.split() if word.isdigit()] == [16, 2, 8]


def test_its_lesson_by_hand(tmp_path: Path) -> None:
    """Three scenes of a published run: the gains of two are 1.25 and 2, and none is within the error on the
    third."""
    data = complete.published(THROTTLE)
    known = {row["scene"]: row for row in data["rows"]}
    rows = [known["scene0"], known["trio"], known["cubes"] | {"chosen": None, "large": None}]
    for row, gain in zip(rows, (1.25, 2.0), strict=False):
        row["large"] |= {"gain": gain}
        row["chosen"] |= {"settings": "march=rods size=16 least=2 steps=0 finish=0", "evaluations": 40.0}
        row["plain"] |= {"evaluations": 50.0}
    store.write_json(tmp_path / THROTTLE, data | {"rows": rows})
    found = tables.system(tmp_path)
    assert found
    (lesson,) = found.lessons()
    ((name, *cells),) = [[text.split(" [")[0] for text, _ in row] for row in lesson.table.cells]
    assert (lesson.name, name, cells) == (
        "rods_simd",
        "scene0",
        ["size=16 least=2 steps=0 finish=0", "1.25×", "50.0 → 40.0"],
    )
    assert all(word in lesson.foot for word in ("2 of 3", "1.25×", "2.00×"))


@pytest.mark.slow
@pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()["rods_simd"])), reason="the CPU lacks what rods_simd needs"
)
def test_from_pictures_to_its_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Two settings: one that is the scene's own picture, one whose five steps leave holes."""
    own, short = "march=rods size=16 least=4 steps=0 finish=0", "march=rods size=16 least=4 steps=1 finish=5"
    monkeypatch.setattr(throttle, "settings", lambda: [short, own])
    words = ["--still", "--scene", "trio", "-n", "18", "--large", "36", "--launches", "2", "--seed", "1"]
    outcome, _ = commands.called("flight", [*words, "--run", str(tmp_path)])
    (row,) = Throttle.load(tmp_path / THROTTLE).rows
    assert outcome.ended == 0 and (row.tried, row.within, row.chosen.settings) == (3, 1, own)
    assert list(row.finalists) == [own] and row.chosen.launches != row.finalists[own].launches
    assert row.large.n == 36 and row.large.other_ppm == 0 and row.large.gain > 0
    assert row.chosen.wrong_ppm == 0 and row.chosen.evaluations < row.plain.evaluations
    monkeypatch.setattr(throttle, "settings", lambda: [short])
    outcome, _ = commands.called("flight", [*words, "--run", str(tmp_path)])
    assert outcome.ended == 1 and len(outcome.failed) == 1
