"""What is made of a phase that hangs, crashes, refuses, writes NaN or is wrong, and of a broken case."""

import dataclasses
import math
import stat
from pathlib import Path

import msgspec
import numpy as np
import pytest

from study.core.cli import StudyError
from study.experiments.stability import cases as hard
from study.experiments.stability.cases import Case, Outcome, Phase, curves, measure
from study.experiments.stability.cases.scenes import scene, shape

BALL = scene([shape("sphere", radius=1)])


def case(run: object, limit: float = 0.5) -> Case:
    strengths = (1.0, 2.0, 4.0)
    about = hard.cases()[0].about
    return Case(msgspec.structs.replace(about, strengths=strengths, unit="", fails_above=limit), run)


@dataclasses.dataclass
class Program(Phase):
    """A phase whose program is a shell script."""

    path: Path = Path()

    def program(self, target: str = "render") -> Path:
        return self.path


@pytest.fixture
def program(tmp_path: Path):
    def make(script: str, **keys: object) -> Program:
        path = tmp_path / "render"
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return Program("baseline", path=path, **keys)

    return make


def look(phase: Phase, strength: float) -> Outcome:
    return Outcome(float(phase.render(BALL, (1, 1))["Z"][0, 0]) - 4)


@pytest.mark.parametrize(
    "script, state, said",
    [
        ("exec sleep 60", measure.HUNG, "0.3 s"),
        ("kill -SEGV $$", measure.CRASHED, "SIGSEGV"),
        ("echo memory >&2; exit 5", measure.CRASHED, "memory"),
        ("echo torus >&2; exit 4", measure.REFUSED, "torus"),
        ("echo avx2 >&2; exit 3", measure.REFUSED, "avx2"),
        ("echo scene >&2; exit 2", measure.BROKEN, "scene"),
        ("exit 0", measure.BROKEN, "picture"),
    ],
)
def test_ends(program, script: str, state: str, said: str) -> None:
    found = measure.measure_point(program(script, time_limit=0.3), case(look), 1.0)
    assert found.state == state and said in found.note and math.isnan(found.error)


def test_right_and_wrong() -> None:
    assert measure.measure_point(Phase("baseline"), case(look), 1.0).state == measure.RIGHT
    for error in (0.6, math.nan, math.inf):
        found = measure.measure_point(Phase("baseline"), case(lambda *_, error=error: Outcome(error)), 1.0)
        assert found.state == measure.WRONG


def test_not_finite_is_seen_without_the_case(monkeypatch: pytest.MonkeyPatch) -> None:
    """NaN in any plane is counted where the picture is read; Z = +inf on a miss is not."""
    from study.pictures import images

    read = images.read

    def spoilt(path: Path) -> images.Picture:
        picture = read(path)
        picture["N.y"][0, 0] = np.nan
        return picture

    away = scene([shape("sphere", radius=1, position=[0, 50, 0])])
    found = measure.measure_point(
        Phase("baseline"), case(lambda p, _: Outcome(len(p.render(away, (2, 2))) * 0)), 1.0
    )
    assert (found.state, found.non_finite) == (measure.RIGHT, 0)
    monkeypatch.setattr(images, "read", spoilt)
    found = measure.measure_point(Phase("baseline"), case(look), 1.0)
    assert (found.state, found.non_finite) == (measure.NOT_FINITE, 1)


def test_row() -> None:
    """The first failure is the first in the order of strengths; a refusal is none."""
    p = [
        measure.Point(1, measure.REFUSED),
        measure.Point(2, measure.WRONG, 3.0),
        measure.Point(4, measure.HUNG),
    ]
    row = measure.row("opt4", case(look), p)
    assert (row.first_failure, row.hung, row.refused, row.crashed) == (2, True, False, False)
    (line,) = measure.breaks([row])
    assert line.endswith(": hung")
    assert not measure.breaks([measure.row("opt4", case(look), p[:2])])


class Wrong(Phase):
    """The baseline with every second answer spoilt, from the first on: hits and misses change places."""

    renders = 0

    def render(self, scene: dict, size: tuple[int, int], aov: bool = True, **overrides: float):
        picture = super().render(scene, size, aov, **overrides)
        self.renders += 1
        if self.renders % 2:
            missed = picture["id"] < 0
            picture["Z"] = np.where(missed, np.float32(3.25), np.float32(np.inf))
            picture["id"] = np.where(missed, 0, -1).astype(np.float32)
            for name, value in {"N.x": 0.6, "N.y": 0.8, "N.z": 0.0, "R": 0.3, "G": 2.0, "B": 0.1}.items():
                picture[name] = np.full_like(picture[name], value)
        return picture

    def distances(self, scene: dict, points: np.ndarray) -> np.ndarray:
        self.renders += 1
        return super().distances(scene, points) + (self.renders % 2)


# One of them has to be compiled by two compilers.
CASES = [
    pytest.param(one, id=one.name, marks=[pytest.mark.slow] * (one.name == "contraction"))
    for one in hard.cases()
]


@pytest.mark.parametrize("one", CASES)
def test_a_wrong_phase_fails(one: Case) -> None:
    """Every case sees a phase that confuses hit and miss, even at its easiest strength."""
    assert one.failed(one.run(Wrong("baseline"), one.strengths[0]).error)


@pytest.mark.parametrize("one", CASES)
def test_the_easiest_is_easy(one: Case) -> None:
    """The baseline, in double, is right at the easiest strength: else a failure would say nothing."""
    assert not one.failed(one.run(Phase("baseline"), one.strengths[0]).error)


def test_cases_are_found() -> None:
    found = hard.cases()
    assert [one.number for one in found] == sorted({one.number for one in found}) and len(found) == 38
    assert [one.number for one in hard.find_cases(["7", "c03", "halo"])] == [7, 3]
    with pytest.raises(StudyError, match="hallo"):
        hard.find_cases(["hallo"])


def test_curve_of_every_state(tmp_path: Path) -> None:
    """A figure comes of errors of 0, of null and of nothing at all."""
    one = case(look)
    states = [measure.RIGHT, measure.HUNG, measure.NOT_FINITE]
    points = map(measure.Point, one.strengths, states, (0.0, math.nan, 0.2))
    rows = [
        measure.row("opt3", one, list(points)),
        measure.row("opt4", one, [measure.Point(s, measure.REFUSED) for s in one.strengths]),
    ]
    svg, png = curves.draw(one.about, rows, ["opt3", "opt4"], tmp_path / "a")
    assert png.stat().st_size > 5000 and "hang: opt3" in svg.read_text().replace("\n", "")
