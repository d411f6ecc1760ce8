"""Speed against error: fronts and winners of points whose answer is known by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from study.core import cli, commands, registry, run, store
from study.core.registry import Spec
from study.experiments import running
from study.experiments.pareto import command, fronts, tables
from study.experiments.pareto import measure as measuring
from study.experiments.pareto.schema import Pareto, Row
from study.numbers.schema import Interval, Skipped
from study.pictures import images


def row(phase: str, pace: float, psnr: float, **more: object) -> Row:
    interval = Interval(value=pace, low=pace * 0.9, high=pace * 1.1, launches=6, sufficient=True)
    base = {"scene": "scene0", "hit_distance": 1e-6, "max_steps": 3000, "own_parameters": True}
    return Row(phase=phase, psnr_db=psnr, **(base | {"ns_per_pixel": interval} | more))


A, B, C, D = row("a", 10, 30), row("b", 20, 60), row("c", 30, 50), row("d", 40, math.inf)


def test_the_front_has_what_nothing_beats_in_both() -> None:
    assert fronts.front([D, C, B, A], "psnr_db") == [A, B, D]  # c is slower and worse than b
    assert fronts.front([row("e", 10, 29), A], "psnr_db") == [A]


def test_what_has_no_number_or_is_not_finite_wins_nothing() -> None:
    nan, broken = row("nan", 1, math.nan), row("broken", 1, 200, non_finite=3)
    assert fronts.front([nan, broken, A], "psnr_db") == [A]
    assert fronts.reaching([nan, broken, A], "psnr_db", 20) == [A]


@pytest.mark.parametrize(("level", "winner"), [(40, "b"), (50, "b"), (60, "b"), (61, "d"), (80, "d")])
def test_the_fastest_reaches_the_level(level: int, winner: str) -> None:
    assert fronts.reaching([A, B, C, D], "psnr_db", level)[0].phase == winner


def test_the_grid_is_full_for_switches_too_and_has_the_scenes_own_parameters() -> None:
    scene = registry.find_scene("scene0")
    points = measuring.grid(scene, [Spec.parse("opt4"), Spec.parse("opt4+rsqrt")], [1e-3], [64])
    for name in ("opt4", "opt4+rsqrt"):
        mine = [(p.hit_distance, p.max_steps) for p in points if p.spec.phase == name]
        assert sorted(mine) == [(1e-6, 64), (1e-6, 3000), (1e-3, 64), (1e-3, 3000)]


def points(names: str) -> list[measuring.Point]:
    return [
        measuring.Point("scene0", Spec("opt4", "opt4"), 1e-3, steps) for steps in range(1, len(names) + 1)
    ]


def test_only_what_a_nearer_point_undercuts_twice_by_every_measure_is_left_out() -> None:
    near, far, best, hits, edge, ruined = mine = points("abcdef")
    found = {
        near: row("near", 0, 60, psnr_ideal_db=40, false_ppm=5.0, dt_p99=1e-3),
        far: row("far", 0, 50, psnr_ideal_db=40, false_ppm=5.0, dt_p99=1e-3),  # 2.1 × near's time: out
        best: row("best", 0, 61, psnr_ideal_db=39, false_ppm=9.0, dt_p99=1e-2),  # nearest by one measure
        hits: row("hits", 0, 20, psnr_ideal_db=20, false_ppm=0.0, dt_p99=1e-2),  # and by another
        edge: row("edge", 0, 50, psnr_ideal_db=40, false_ppm=5.0, dt_p99=1e-3),  # just within twice
        ruined: row("ruined", 0, math.nan, false_ppm=0.0, dt_p99=0.0, non_finite=1),
    }
    times = dict(zip(mine, [10.0, 21.0, 90.0, 90.0, 19.9, 1.0], strict=True))
    out = measuring.beaten(found, times)
    assert out == {far: dict.fromkeys(fronts.MEASURES, near), ruined: {}}


def test_a_measure_without_a_figure_keeps_nobody_in_and_beats_nobody() -> None:
    near, far, other = mine = points("abc")
    found = {
        near: row("near", 0, 60, dt_p99=math.nan),  # a fractal: no hits, no distances
        far: row("far", 0, 50, dt_p99=math.nan),
        other: row("other", 0, 40, dt_p99=1.0),  # beaten in decibels, and alone with a distance
    }
    assert measuring.beaten(found, dict(zip(mine, [1.0, 3.0, 3.0], strict=True))) == {far: {"psnr_db": near}}


@pytest.mark.slow
def test_a_real_scene_is_measured_on_one_thread_and_timed_in_full_where_it_counts(tmp_path: Path) -> None:
    """A phase that could use every core is compared at equal resources; opt1's bits are baseline's."""
    steps = registry.ladder().items()
    threaded = [name for name, phase in steps if phase.threads and registry.cpu_supports(phase)]
    scene = registry.find_scene("two_spheres")
    # of those with threads one that marches and one by closed forms
    specs = [Spec.parse(name) for name in dict.fromkeys(("baseline", "opt1", *threaded[:1], *threaded[-1:]))]
    grid = measuring.grid(scene, specs, [1e-1], [2])
    rows, skipped = measuring.study_scene(scene, grid, (24, 24), 6, 1, run.FASTEST, tmp_path)
    assert not skipped and len(rows) == 4 * len(specs)
    assert {r.threads for r in rows} == {1}
    own = [r for r in rows if r.own_parameters]
    assert len(own) == len(specs) and all(r.beaten_by is None for r in own)
    for r in rows:
        assert r.ns_per_pixel.launches == (6 if r.timed else 1)
        assert r.false_ppm == r.false_hits_ppm + r.false_misses_ppm
        if r.timed and r.evals_per_pixel > 0:
            assert r.ns_per_eval * r.evals_per_pixel == pytest.approx(r.ns_per_pixel.value)
        elif r.timed:  # by closed forms, without a single distance
            assert math.isnan(r.ns_per_eval) and registry.find_phase(r.phase).exact_hits
    twins = {(r.hit_distance, r.max_steps): r.psnr_db for r in rows if r.phase == "baseline"}
    assert len(set(twins.values())) > 1  # the parameters reach the picture
    for r in rows:
        if r.phase == "opt1":
            assert r.psnr_db == twins[r.hit_distance, r.max_steps]


@pytest.mark.slow
def test_a_fractal_is_judged_by_means_of_its_own_size(tmp_path: Path) -> None:
    """11×6 pixels of 4×4 samples, and no 43×24."""
    scene = registry.find_scene("mandelbulb")
    point = measuring.Point(scene.name, Spec.parse("baseline"), *measuring.own(scene))
    rows, skipped = measuring.judge([point], scene, 6, tmp_path)
    assert not skipped and rows[point].psnr_db > 20 and math.isnan(rows[point].false_ppm)


@pytest.mark.slow
def test_evaluations_are_those_of_every_ray_and_normal(tmp_path: Path) -> None:
    """Without shadows or mirrors: the camera rays' own, and four for each hit's forward differences."""
    scene, out = registry.find_scene("scene0_plain"), tmp_path / "p.exr"
    width, _ = scene.size(24)
    for name in ("baseline", *(["opt3"] if registry.cpu_supports(registry.find_phase("opt3")) else [])):
        point = measuring.Point(scene.name, Spec.parse(name), *measuring.own(scene))
        run.render(point.spec, scene.path, 24, width, aov=True, out=out)
        made = images.read(out)
        wanted = made["evals"].sum(dtype=float) + 4 * (made["id"] >= 0).sum()
        assert measuring.evaluations(point, scene, 24) * 24 * width == pytest.approx(wanted, abs=1e-6)
    shadowed = registry.find_scene("scene0")
    assert measuring.evaluations(point, shadowed, 24) > wanted / (24 * width) + 5


def test_a_short_frame_is_timed_behind_a_warm_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(*_: object, warmup: int, **__: object) -> dict:
        return {"frames": [{"ns": 9e6, "warmup": True}] * warmup + [{"ns": 7e6 - warmup, "warmup": False}]}

    cold, warm = points("ab")
    scene, cpu = registry.find_scene("scene0"), run.FASTEST
    monkeypatch.setattr(run, "render", fake)
    times = measuring.measure([cold, warm], scene, 8, 1, 1, cpu, {warm})
    assert times == {cold: [7.0], warm: [(7e6 - 1) / 1e6]}


def test_the_papers_point_is_our_baseline_over_its_own_speedup() -> None:
    there = tables.paper_point("scene0", [row("baseline", 19600, math.nan)])
    assert there == (pytest.approx(1000), pytest.approx(30.1))
    assert tables.paper_point("trio", [row("baseline", 19600, math.nan)]) is None


def test_a_null_of_a_broken_picture_is_nan_and_drawn_nowhere(tmp_path: Path) -> None:
    broken, same = row("broken", 1, math.nan, non_finite=3), row("same", 1, math.inf)
    store.write_json(tmp_path / "pareto.json", cli.plain(Pareto(schema=1, rows=[broken, same])))
    again = Pareto.load(tmp_path / "pareto.json").rows
    assert math.isnan(again[0].psnr_db) and again[1].psnr_db == math.inf
    assert [tables._decibels(one, "psnr_db") for one in again] == ["not finite", "∞"]
    figure = tables.figure([row("baseline", 9, 50), broken])
    drawn = [tuple(p) for axes in figure.axes for c in axes.collections for p in c.get_offsets()]
    assert (9, 50) in drawn and all(x != 1 for x, _ in drawn)


def test_a_phase_that_draws_the_ideal_shadow_has_a_second_mark() -> None:
    rows = [row("opt10_scene", 14, 96, psnr_ideal_db=45.8), row("opt11_ideal", 11, 45.0, psnr_ideal_db=99.0)]

    def drawn(measure: str) -> set[tuple[float, float]]:
        figure = tables.figure(rows, measure)
        return {tuple(at) for axes in figure.axes for c in axes.collections for at in c.get_offsets()}

    assert {(14, 96), (11, 45), (11, 99)} <= drawn("psnr_db") and (14, 45.8) not in drawn("psnr_db")
    assert {(14, 45.8), (11, 99)} <= drawn("psnr_ideal_db") and (11, 45) not in drawn("psnr_ideal_db")


def test_a_point_launched_once_is_drawn_faint_and_off_the_front() -> None:
    once = row("opt3", 5, 70, beaten_by={"psnr_db": "opt4"}, own_parameters=False)
    figure = tables.figure([row("opt4", 1, 75), once])
    (faint,) = [c for c in figure.axes[0].collections if (5, 70) in map(tuple, c.get_offsets())]
    assert faint.get_alpha() < 0.5
    assert [list(line.get_xdata()) for line in figure.axes[0].lines if len(line.get_xdata())] == [[1]]


def test_up_is_nearer_whatever_the_measure() -> None:
    rows = [row("a", 1, 50, false_ppm=0.0, dt_p99=1e-3), row("b", 2, 60, false_ppm=70.0, dt_p99=0.0)]
    for measure in tables.FIGURES:
        if measure == "psnr_ideal_db":
            continue
        axes = tables.figure(rows, measure).axes[0]
        best = min(rows, key=lambda r: r.badness(measure))
        spots = {r.phase: axes.transData.transform((1, tables.drawn_at(r, measure)))[1] for r in rows}
        assert max(spots, key=spots.get) == best.phase, measure


def test_a_time_per_evaluation_stands_only_where_evaluations_are_the_work() -> None:
    """A program with closed forms has a 1 for each camera ray, and evaluations for some of its rays only."""
    columns = {column.name: column.text for column in tables.POINTS}
    names = ("evaluations per camera ray", "per pixel, all rays and normals", "ns per evaluation")

    def shown(phase: str, ray: float, pixel: float, ns: float) -> list[str]:
        made = row(phase, 1, 50, evals_per_ray=ray, evals_per_pixel=pixel, ns_per_eval=ns)
        return [columns[name](made) for name in names]

    assert shown("opt4", 50, 60, 3) == shown("opt4+rsqrt", 50, 60, 3) == ["50.0", "60.0", "3.00"]
    assert shown("opt9_convex", 1, 2, 9) == ["–", "2.00", "–"]
    assert shown("opt9_convex", 1, 1e-6, 9) == ["–", "–", "–"]


def test_a_point_launched_once_wins_nothing() -> None:
    once = row("once", 1, 90, beaten_by={"psnr_db": "b at 1e-06, 3000 steps"})
    rows = [A, B, once]
    assert fronts.front(rows, "psnr_db") == [A, B] and not fronts.reaching(rows, "psnr_db", 80)
    assert fronts.left_out(rows).startswith("1 of 3") and tables._timed(once).endswith("3000 steps")


def test_who_overlaps_the_fastest_is_named() -> None:
    few = Interval(value=31, low=None, high=None, launches=2, sufficient=False)
    rows = [row("b", 20, 60), row("c", 24, 60), row("d", 30, 60), row("b", 21, 60, own_parameters=False)]
    rows += [row("low", 20, 30), row("e", 31, 60, ns_per_pixel=few)]
    winner = next(w for w in fronts.winners(rows) if w.level_db == 60)
    assert winner.best is rows[0]  # [18, 22]: c has [21.6, 26.4], d [27, 33], low is too far off
    assert [name[:2] for name in winner.not_told_apart_from] == ["b ", "c", "e"]
    assert fronts.rivals(rows[-1:]) == []  # without an interval nothing is told apart


def pareto(*words: str) -> cli.Outcome:
    return commands.called("pareto", ["--phase", "opt1", "-n", "16", *words])[0]


def test_no_row_at_all_is_no_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refused = [Skipped(phase="opt1", scene="scene0", reason="refused")]
    monkeypatch.setattr(command, "study_scene", lambda *_: ([], refused))
    with pytest.raises(cli.StudyError, match="refused") as caught:
        pareto("--scene", "scene0", "--run", str(tmp_path))
    assert caught.value.exit_status == cli.BAD_INPUT and not list(tmp_path.iterdir())


def test_a_killed_run_leaves_the_scenes_that_were_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def study_scene(scene, *_):
        if scene.name == "trio":
            raise KeyboardInterrupt
        rows = [row("opt4", 500, 61, scene=scene.name), row("opt5", 505, 61, scene=scene.name)]
        return [*rows, row("opt4", 900, 20, scene=scene.name, beaten_by={"psnr_db": "x"})], []

    monkeypatch.setattr(command, "study_scene", study_scene)
    with pytest.raises(KeyboardInterrupt):
        pareto("--scene", "scene0", "trio", "cubes", "--run", str(tmp_path))
    kept = Pareto.load(tmp_path / "pareto.json")
    assert {r.scene for r in kept.rows} == {"scene0"} and kept.unfinished == ["trio", "cubes"]
    found = tables.found(kept)
    cells = [cell for one in found.parts for line in one.table.cells for cell, _ in line]
    assert "opt4 500.0 [450.0,\u00a0550.0]; or opt5" in cells and "none" in cells
    assert "trio, cubes" in found.drawn["pareto"].note and "1 of 3" in found.drawn["pareto"].note
    assert "50 dB" in found.answer and "500 [450, 550]" in found.answer


def test_a_second_result_takes_nothing_from_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the default folder; the run that --run names is written anew."""
    monkeypatch.setattr(running.registry, "ROOT", tmp_path)
    level = iter(range(60, 70))

    def study_scene(scene, *_):
        return [row("opt1", 500, next(level), scene=scene.name)], []

    monkeypatch.setattr(command, "study_scene", study_scene)
    monkeypatch.setattr(running, "draw", lambda *_: [])
    made = [pareto("--scene", name, *more).run for name, more in (
        ("scene0", []), ("trio", []), ("scene0", []),
        ("trio", ["--run", str(tmp_path / "own")]), ("cubes", ["--run", str(tmp_path / "own")]),
    )]  # fmt: skip
    build = tmp_path / "build"
    assert made == [build / "pareto", build / "pareto-2", build / "pareto-3", *2 * [tmp_path / "own"]]
    kept = [(r.scene, r.psnr_db) for path in made[:4] for r in Pareto.load(path / "pareto.json").rows]
    assert kept == [("scene0", 60), ("trio", 61), ("scene0", 62), ("cubes", 64)]
