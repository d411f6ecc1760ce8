"""How cost grows: the budget, errors and memory known by hand, many shapes, tables and figures of a file."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest

from study.core import cli, commands, generated_scenes, registry, run, store
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments.scaling import command, experiment, tables
from study.experiments.scaling import measure as scaling
from study.experiments.scaling.measure import First
from study.experiments.scaling.schema import Row, Scaling
from study.experiments.scaling.series import Point, Series, foreseen, series, thread_counts
from study.numbers.schema import Interval
from study.pictures.draw import STYLE

OPT4, BASE, NEW = (Spec.parse(name) for name in ("opt4", "baseline", "opt11_ideal"))


def line(xs: tuple[int, ...] = (1, 4, 16, 64), grows: float = 1, first: tuple[int, ...] = ()) -> Series:
    scene = registry.find_scene("trio")
    return Series("shapes-x", "t", "x", xs, grows, 1, 90, lambda x, number: scene, first=first)


def takes(asked: list, seconds: Callable[[Point], float]) -> Callable[[Point], First]:
    """Renders in the seconds told; notes what it was asked for."""

    def first(point: Point) -> First:
        asked.append((str(point.spec), point.x))
        return First(seconds(point))

    return first


def test_what_does_not_fit_is_left_out_with_what_it_would_take() -> None:
    asked: list = []
    first = takes(asked, lambda point: (1.0 if point.spec == BASE else 0.3) * point.x)
    plan = scaling.choose(line(), [BASE, OPT4], 40.0, 6, first)
    # Six launches: 2.2 s and 7.6 s of opt4 at 1 and 4, 6.6 s of baseline at 1. The next take 28 s and 24 s.
    assert sorted(asked) == [("baseline", 1), ("opt4", 1), ("opt4", 4)] and plan.spent <= 40
    missing = {(row.phase, row.x): row.foreseen_s for row in plan.left_out}
    assert missing.keys() == {
        *(("baseline", x) for x in (4, 16, 64)),
        *(("opt4", x) for x in (16, 64)),
    }
    assert missing["opt4", 16] == pytest.approx(4.8) and missing["baseline", 4] == pytest.approx(4)


def test_every_program_has_three_points_before_any_has_a_fourth() -> None:
    asked: list = []
    first = takes(asked, lambda point: 2.0 if point.spec == BASE else 0.01)
    plan = scaling.choose(line((1, 2, 3, 4, 5, 6), 0), [BASE, OPT4], 75.0, 6, first)
    # Three of baseline take 3 · 12.6 s, under 0.6 of 75 s; two more fit, a sixth and its first frame not.
    assert [name for name, _ in asked[:6]].count("baseline") == 3
    assert [sum(p.spec == spec for p in plan.taken) for spec in (OPT4, BASE)] == [6, 5]


def test_the_newest_phases_have_all_their_points_before_the_others_have_any() -> None:
    asked: list = []
    plan = scaling.choose(line(), [BASE, NEW, OPT4], 1e9, 6, takes(asked, lambda point: 0.001))
    assert [name for name, _ in asked[:4]] == [str(NEW)] * 4
    assert len(plan.taken) == 12 and not plan.left_out


def test_a_point_that_proves_too_long_is_left_out_and_the_rest_goes_on() -> None:
    slow = {1: 0.001, 4: 3.0, 16: 0.002, 64: 0.002}
    plan = scaling.choose(line(), [OPT4], 10.0, 6, lambda p: First(slow[p.x]))
    assert [point.x for point in plan.taken] == [1] and plan.spent <= 10
    assert [row.x for row in plan.left_out] == [4, 16, 64]


def test_what_is_refused_is_not_asked_for_more() -> None:
    """As 16, 1, 4, 64 with 16 and more too large: what is smaller is asked, what is larger is not."""
    asked: list = []

    def first(point: Point) -> First:
        asked.append((str(point.spec), point.x))
        if point.spec == BASE and point.x >= 16:
            raise DriverError(run.NO_MEMORY, "too large")
        return First(0.001)

    plan = scaling.choose(line(first=(16, 1, 4)), [BASE, OPT4], 1e9, 6, first)
    assert ("baseline", 64) not in asked and asked.count(("baseline", 16)) == 1
    assert {p.x for p in plan.taken if p.spec == BASE} == {1, 4}
    assert [(r.phase, r.x) for r in plan.left_out] == [("baseline", 16), ("baseline", 64)]
    assert plan.left_out[0].reason == "too large"


@pytest.mark.parametrize(
    ("known", "x", "expected"),
    [
        ([], 4, 0.0),
        ([(4, 2.0)], 16, 8.0),
        ([(1, 1.0), (4, 8.0)], 16, 64.0),  # x^1.5 seen
        ([(1, 1.0), (4, 1.0)], 16, 4.0),  # flat so far: x^1 all the same
        ([(1, 1.0), (4, 4.0**5)], 16, 4.0**5 * 16),  # at most one more
        ([(16, 2.0), (4, 1.0)], 8, math.sqrt(2)),  # between two points: on their line
        ([(16, 2.0), (4, 1.0)], 1, 1.0),
    ],
)
def test_a_frame_is_foreseen_from_what_is_known(known: list, x: int, expected: float) -> None:
    assert foreseen(known, x, 1) == pytest.approx(expected)


def test_threads_are_powers_of_two_and_all() -> None:
    assert [thread_counts(n) for n in (1, 2, 6, 8)] == [(1,), (1, 2), (1, 2, 4, 6), (1, 2, 4, 8)]


def test_every_launch_of_a_crowd_has_a_scene_of_its_own(monkeypatch, tmp_path: Path) -> None:
    drawn: list[tuple[int, str]] = []

    def of_shapes(name: str, count: int, seed: int, folder: Path) -> Scene:
        return dataclasses.replace(registry.find_scene("trio"), name=f"{name}-{count}-{seed}")

    def milliseconds(spec: Spec, scene: Scene, size: tuple, reps: int, padding: int, **how: object) -> float:
        drawn.append((size[1], scene.name))
        assert (how["warmup"], reps) == (1, 3)
        return 1.0

    monkeypatch.setattr(scaling, "milliseconds", milliseconds)
    monkeypatch.setattr(generated_scenes, "of_shapes", of_shapes)
    crowd = series(90, 5, tmp_path)["crowd"]
    work = scaling.Measuring(crowd, scaling.Settings(6, 1, run.FASTEST, tmp_path), 1)
    found = work.times({Point("crowd", x, BASE): First(0.1) for x in crowd.xs})
    assert len(found[Point("crowd", 16, BASE)]) == 6 and {height for height, _ in drawn} == {720}
    for count in (16, 4096):
        assert [name for _, name in drawn if f"-{count}-" in name] == [
            f"scattered-{count}-{seed}" for seed in range(5, 11)
        ]


def test_closed_forms_have_no_evaluations_of_a_ray(monkeypatch) -> None:
    planes = {name: np.ones((4, 6), np.float32) for name in ("R", "G", "B", "evals", "id")}
    monkeypatch.setattr(scaling.images, "read", lambda path: planes)
    assert scaling.seen(Path("a.exr"), NEW)["evals_per_ray"] is None
    assert scaling.seen(Path("a.exr"), OPT4)["evals_per_ray"] == 1


def test_without_truth_the_first_double_program_stands_for_it() -> None:
    points = [Point("s", 1, Spec(name, name)) for name in ("opt4", "opt3", "opt2")]
    assert scaling.finest(points).spec.phase == "opt3"
    assert scaling.finest(points[:1]).spec.phase == "opt4"


def of(value: float) -> Interval:
    return Interval(value=value, low=value, high=value, launches=6, sufficient=True)


def row(phase: str, x: float, each: float, name: str = "shapes-scattered", **more: object) -> Row:
    found = {
        **{"series": name, "phase": phase, "x": x, "n": 90, "width": 160, "threads": 1, "scene": "s"},
        **{"ns": [each] * 6, "ms": of(each / 1e6), "ns_per_pixel": of(each), "coverage": 0.4},
        **{"evals_per_ray": 10.0 * x, "non_finite": 0, "reference": "truth"},
        **{"psnr_db": 60.0, "rmse": 0.001, "wrong_ppm": 0.0},
    }
    return Row(**found | more)


def test_many_shapes_stand_beside_few() -> None:
    rows = [row("a", 16, 100), row("a", 4096, 399), row("c", 16, 9), row("c", 1024, 9), row("d", 16, 1)]
    a, c = scaling.crowds(rows, list("acd"))  # d has few alone
    assert a.ratio.value == pytest.approx(3.99) and (a.shapes, c.shapes) == (4096, 1024)


def test_a_crowds_scenes_are_summarized_by_their_means() -> None:
    # Means 100 and 390; the median of the few is 60, which would make it 6.5 times.
    few = [60.0] * 8 + [260.0] * 2
    rows = [
        row("a", 16, 0, "crowd", scenes=80, ns=few * 8),
        row("a", 4096, 0, "crowd", scenes=12, ns=[390.0] * 12),
    ]
    (a,) = scaling.crowds(rows, ["a"])
    assert a.ratio.value == pytest.approx(3.9) and 3 < a.ratio.low < 3.9 < a.ratio.high < 5
    assert a.scenes == [80, 12] and a.mean_ms == pytest.approx([100e-6, 390e-6])
    assert a.by_medians.value == pytest.approx(6.5)
    # Rows of one scene are compared by their medians.
    rows = [row("a", 16, 0, "crowd", ns=few), row("a", 4096, 0, "crowd", ns=[390.0] * 10)]
    (a,) = scaling.crowds(rows, ["a"])
    assert a.ratio.value == pytest.approx(6.5) and a.scenes == [1, 1] and a.mean_ms is None


def test_verdicts_beside_the_papers_law() -> None:
    xs = [1, 4, 16, 64]

    def said(of: Callable[[float], float], paper: float | None = 1, launches: int = 6) -> str:
        return scaling.verdict(scaling.law([(x, [of(x)] * launches) for x in xs]), paper)

    alike = said(lambda x: x**1.04)
    slower, faster = said(lambda x: x**0.5), said(lambda x: x**1.2)
    few, bent = said(lambda x: x**0.5, launches=2), said(lambda x: x + 20)
    assert len({alike, slower, faster, few, bent, said(lambda x: x, None)}) == 6
    assert said(lambda x: x) == alike and bent.endswith("1, 4, 16, 64")


def result(rows: list[Row]) -> Scaling:
    known = series(90, 1, Path("nowhere"))["shapes-scattered"]
    return Scaling(
        **{"schema": 1, "n": 90, "launches": 6, "rows": rows, "left_out": []},
        fits=scaling.fits(rows, [known]),
        goals=scaling.crowds(rows, ["opt4"]),
        axes={known.name: known.axis},
        titles={known.name: known.title},
    )


@pytest.mark.parametrize("evals", [1.0, None])
def test_closed_forms_have_no_exponent_of_evaluations(evals: float | None) -> None:
    """Their plane holds a 1, of which older files fitted a 0.00; newer ones hold none."""
    rows = [row("opt9_convex", x, 1e6 * x, evals_per_ray=evals) for x in (1, 16, 64)]
    made = result([row("opt4", x, 1e6 * x) for x in (1, 16, 64)] + rows)
    shown = {one.name: one.markdown for one in tables.parts(made)}
    four, nine = (next(r for r in shown["scaling"].splitlines() if p in r) for p in ("opt4", "opt9_convex"))
    assert four.endswith("| 1.00 |") and nine.endswith(f"| {tables.CLOSED} |")
    points = [r.split(" | ")[5] for r in shown["scaling-points"].splitlines()[2:]]
    assert points == ["10.0", "160", "640", "–", "–", "–"]


def test_figures_and_chapter_are_made_from_the_file_alone(tmp_path: Path) -> None:
    made = result([row("opt4", x, 1e6 * x**0.5) for x in (1, 16, 64)] + [row("opt3", 1, 5e5)])
    data = SimpleNamespace(path=tmp_path)
    assert experiment.section(data).parts == []
    store.write_json(tmp_path / command.FILE, made)
    chapter = experiment.section(data)
    assert [part.name for part in chapter.parts] == ["scaling", "scaling-crowds", "scaling-points"]
    assert "0.50" in chapter.answer and "0.50" in chapter.parts[0].markdown
    assert set(chapter.drawn) == {"scaling-time"}
    with matplotlib.rc_context(STYLE):
        axes = chapter.drawn["scaling-time"].make().axes[0]
    assert "opt4" in {line.get_label() for line in axes.lines}


@pytest.mark.parametrize("words", [["--series", "shape"], ["--phase", "truth"]])
def test_bad_input_is_said(words: list[str], tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=words[-1]):
        commands.called("scaling", [*words, "--run", str(tmp_path)])


@pytest.mark.slow
def test_from_end_to_end(tmp_path: Path) -> None:
    """Two small series of two programs: rows, fits, and truth beside them."""
    words = [
        "--series",
        "bounces",
        "threads",
        "--phase",
        "opt1",
        "opt5_threads",
        "-n",
        "16",
        "--launches",
        "1",
    ]
    # Far more time than it takes: what is measured must not hang on how fast this machine is now.
    outcome, _ = commands.called("scaling", [*words, "--budget", "3600", "--run", str(tmp_path)])
    assert outcome.ended == cli.OK
    made = Scaling.load(tmp_path / command.FILE)
    assert json.loads((tmp_path / command.FILE).read_text()) == cli.plain(outcome.result)
    threads = [one for one in made.rows if one.series == "threads"]
    assert {one.phase for one in threads} == {"opt5_threads"} and threads[0].threads == 1
    chain = [one for one in made.rows if (one.series, one.phase) == ("bounces", "opt1")]
    assert [one.x for one in chain][:3] == [1, 2, 3] and all(one.coverage == 1 for one in chain)
    assert chain[0].reference == "truth" and chain[0].psnr_db > 60 and chain[0].wrong_ppm == 0
    assert (tmp_path / "figures" / "scaling-time.png").stat().st_size > 1000
