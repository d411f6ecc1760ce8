"""stepwise accuracy as a command: rows, verdicts, what cannot be, and one chain against a quadratic."""

import math
import shutil
import types

import msgspec
import numpy as np
import pytest
from discs import HEIGHT, WIDTH, made_truth

from conformance import geometry
from study.core import commands, registry
from study.core.cli import Outcome, StudyError
from study.core.registry import ROOT, Spec
from study.core.run import DriverError
from study.experiments import running
from study.experiments.accuracy import command as command_module
from study.experiments.accuracy import tables
from study.numbers.accuracy import FILE, Accuracy, rows
from study.pictures import gallery, gate, images
from study.truth import subject, where

PIXEL = 1e6 / (HEIGHT * WIDTH)  # ppm


@pytest.fixture
def house(tmp_path, monkeypatch, write_exr, disc):
    """The command with pictures made here: truth is the disc, a phase's picture what `pictures` says."""
    monkeypatch.delenv("STEPWISE_ISA_LIMIT", raising=False)
    pictures = {name: disc for name in ("baseline", "opt4", "opt5")}
    (tmp_path / "bin").mkdir()

    def build(spec: Spec):
        path = tmp_path / "bin" / str(spec)
        path.write_text(str(spec))
        return path

    def render(spec, scene, height, width, *, aov, out, timed):
        made = pictures[str(spec)]
        if isinstance(made, Exception):
            raise made
        write_exr(out, made())

    monkeypatch.setattr(gallery, "build", build)
    monkeypatch.setattr(gallery, "render", render)
    monkeypatch.setattr(subject.truth, "picture", lambda scene, size: made_truth(disc()))
    monkeypatch.setattr(command_module.running, "draw", lambda folder, made: drawn.extend(made) or [])
    drawn: list[str] = []
    opt1 = registry.find_phase("opt1")
    places = (("baseline", 0, "ladder"), ("opt4", 4, "ladder"), ("opt5", 5, "ladder"), ("exact", 0, "truth"))
    known = {
        name: msgspec.structs.replace(opt1, name=name, order=order, family=family, tolerance={})
        for name, order, family in places
    }
    monkeypatch.setattr(registry, "phases", lambda root=ROOT: known)
    return types.SimpleNamespace(pictures=pictures, known=known, run=tmp_path / "run", drawn=drawn)


@pytest.fixture
def command(house):
    def call(*words: str) -> Outcome:
        shutil.rmtree(house.run, ignore_errors=True)  # pictures are kept
        size = ("-n", str(HEIGHT), "-w", str(WIDTH), "--jobs", "1", "--run", str(house.run))
        return commands.called("accuracy", [*size, *words])[0]

    return call


def test_one_row(command, house):
    found = command("--phase", "opt4", "--scene", "scene0")
    (row,) = rows(house.run)
    assert found.ended == 0 and (row.psnr_db, row.rmse, row.gated, row.worse) == (math.inf, 0, False, [])
    assert (house.run / str(row.picture)).is_file()
    assert house.drawn == ["accuracy-where"]


def test_a_gated_phase_that_is_further_than_baseline_fails_with_metric_and_both_values(command, house, disc):
    house.pictures["opt5"] = lambda: disc(1)
    found = command("--phase", "opt4", "opt5", "--scene", "trio")
    near, far = rows(house.run)
    assert found.ended == 1 and far.failed and not near.failed
    assert {"false_hits_ppm", "false_misses_ppm", "psnr_db"} <= set(far.worse)
    assert f"{23 * PIXEL:.6g}" in far.why[0] and "opt5 on trio" in found.failed[0]


def test_nobody_need_copy_baselines_errors(command, house, disc):
    house.pictures["baseline"] = lambda: disc(2)
    assert command("--phase", "opt5", "--scene", "trio").ended == 0 and rows(house.run)[0].false_hits_ppm == 0


def test_a_fractal_may_be_as_far_as_opt4_and_no_other_scene(command, house, disc):
    house.pictures["opt4"] = house.pictures["opt5"] = lambda: disc(1)
    assert command("--phase", "opt5", "--scene", "mandelbulb").ended == 0
    assert command("--phase", "opt5", "--scene", "trio").ended == 1
    house.pictures["opt4"] = DriverError(4, "none today")
    found = command("--phase", "opt5", "--scene", "mandelbulb")
    assert found.ended == 1 and "baseline has" in found.failed[0]


def test_outlines_as_fat_as_declared_are_granted(command, house, disc):
    """And what lies beyond them is not: a false hit in the corner, far from the disc, and that one alone."""
    granted = dict.fromkeys(gate.TRUTH_METRICS, 1e6) | {"false_hits_ppm": 0, "outline_pixels": 2}
    tolerance = {gate.TRUTH: granted | {"reason": "rays as wide as a pixel"}}
    house.known["opt5"] = msgspec.structs.replace(house.known["opt5"], tolerance=tolerance)
    house.pictures["opt5"] = lambda: disc(1)
    assert command("--phase", "opt5", "--scene", "trio").ended == 0
    (row,) = rows(house.run)
    assert row.false_hits_ppm > 0 and row.beyond_outlines["false_hits_ppm"] == 0

    def spotted() -> dict[str, np.ndarray]:
        made = disc(1)
        for plane in made.values():
            plane[0, 0] = plane[HEIGHT // 2, WIDTH // 2]
        return made

    house.pictures["opt5"] = spotted
    for base in (disc, lambda: disc(1)):  # the second one's 23 false hits are at the outline
        house.pictures["baseline"] = base
        assert command("--phase", "opt5", "--scene", "trio").ended == 1
        (row,) = rows(house.run)
        assert row.worse == ["false_hits_ppm"] and f"{PIXEL:.6g}" in row.why[0]


def test_a_declared_margin_is_granted(command, house, disc):
    house.pictures["opt5"] = lambda: disc(1)
    reason = {"reason": "a test", **dict.fromkeys(gate.TRUTH_METRICS, 1e5)}
    house.known["opt5"] = msgspec.structs.replace(house.known["opt5"], tolerance={"truth": reason})
    assert command("--phase", "opt5", "--scene", "trio").ended == 0
    del reason["false_misses_ppm"]
    assert command("--phase", "opt5", "--scene", "trio").ended == 1
    assert rows(house.run)[0].worse == ["false_misses_ppm"]


@pytest.mark.parametrize("far", [2, 50])
def test_one_rounding_of_a_depth_is_granted_and_no_more(command, house, disc, monkeypatch, far):
    """At each hit's own depth: a hundred hits at 1000, whose floats are coarser, grant the others nothing."""
    spacing = np.spacing(np.float32(far))

    def off(by: float):
        picture = disc()
        rows, columns = np.nonzero(picture["id"] >= 0)
        picture["Z"][rows, columns] = far + np.float32(by) * spacing
        picture["Z"][rows[:100], columns[:100]] = 1000
        return picture

    monkeypatch.setattr(subject.truth, "picture", lambda scene, size: made_truth(off(0)))
    house.pictures["baseline"] = lambda: off(4)
    for by, status in ((4, 0), (5, 0), (6, 1)):
        house.pictures["opt5"] = lambda by=by: off(by)
        assert command("--phase", "opt5", "--scene", "trio").ended == status
        assert rows(house.run)[0].worse == ["dt_p99"] * status


def test_pixels_of_a_phase_that_draws_the_ideal_shadow_are_held_against_that(
    command, house, disc, monkeypatch
):
    truth = made_truth(disc())
    truth["R"][20, 20:24] += np.float32(0.1)
    truth["ideal.R"][5, 5] += np.float32(0.1)
    monkeypatch.setattr(subject.truth, "picture", lambda scene, size: truth)
    tolerance = {gate.IDEAL: {"psnr_ideal_db": 20, "reason": "a test"}}
    house.known["opt5"] = msgspec.structs.replace(house.known["opt5"], tolerance=tolerance)
    command("--phase", "opt4", "opt5", "--scene", "trio")
    paper, ideal = rows(house.run)
    assert (paper.to_ideal, paper.bad_pixels, ideal.to_ideal, ideal.bad_pixels) == (False, 4, True, 1)
    assert ideal.fraction_over_1_255 == pytest.approx(PIXEL / 1e6) and ideal.flip_mean < paper.flip_mean
    assert ideal.psnr_db == paper.psnr_db < ideal.psnr_ideal_db == paper.psnr_ideal_db


def test_a_picture_that_is_not_finite_fails_gated_or_not(command, house, disc):
    def broken():
        picture = disc()
        picture["G"][20, 20] = np.nan
        return picture

    house.pictures["opt4"] = broken
    assert command("--phase", "opt4", "--scene", "trio").ended == 1
    assert rows(house.run)[0].non_finite == 2


def test_what_cannot_be_is_said(command, house):
    house.pictures["opt4"] = DriverError(4, "no planes here")
    found = command("--phase", "opt4", "opt5", "--scene", "trio")
    assert found.ended == 0 and "no planes here" in found.remarks[0]
    house.pictures["opt4"] = DriverError(-11, "killed by SIGSEGV")
    found = command("--phase", "opt4", "--scene", "trio")
    assert found.ended == 1 and "SIGSEGV" in found.failed[0]
    with pytest.raises(StudyError, match="exact"):
        command("--phase", "exact", "--scene", "trio")


def test_tables_and_figures_from_the_file_alone(command, house, disc):
    house.pictures["opt4"] = lambda: disc(1)
    command("--phase", "baseline", "opt4", "--scene", "trio", "mandelbulb")
    result = Accuracy.load(house.run / FILE)
    names = [name for name, *_ in tables.tables(result)]
    assert names == ["accuracy", "accuracy-averaged", "accuracy-where"]
    text = "\n".join(tables.lines(result))
    assert "identical" in text and f"9,583 {tables.MARK}" in text
    (draw,) = tables.drawings(result).values()
    bars = draw.make().axes[0].containers[where.CLASSES.index("silhouette")]
    bad = next(row for row in result.rows if row.phase == "opt4").bad_pixels
    assert [bar.get_width() for bar in bars] == [0, pytest.approx(bad * PIXEL)]


def test_a_shard_of_a_fractal_is_held_against_opt4_too(command, house, disc):
    """Whatever phases the shard itself has: its rows are those of a run without shards."""
    house.pictures["opt4"] = house.pictures["opt5"] = lambda: disc(1)
    asked = ("--phase", "opt4", "opt5", "--scene", "mandelbulb")
    whole = command(*asked).result.rows
    assert command(*asked, "--shard", "2/2").result.rows == whole[1:]
    assert [path.name for path in house.run.glob("*.json")] == ["accuracy.shard-2-of-2.json"]
    assert command_module.specs_of(["opt4"]) == [Spec("opt4", "opt4")]


def test_a_second_result_takes_nothing_from_the_first(house, monkeypatch, tmp_path, disc):
    """And renders nothing again: both have the same pictures. Shards of one result are in one folder."""
    monkeypatch.setattr(running.registry, "ROOT", tmp_path)
    size = ("-n", str(HEIGHT), "-w", str(WIDTH), "--jobs", "1", "--scene", "trio")

    def call(*words: str) -> Outcome:
        return commands.called("accuracy", [*size, *words])[0]

    first = call("--phase", "opt4")
    house.pictures["baseline"] = house.pictures["opt4"] = RuntimeError("rendered again")
    second = call("--phase", "opt4", "opt5")
    assert (first.run, second.run) == (tmp_path / "build" / "accuracy", tmp_path / "build" / "accuracy-2")
    assert [r.phase for r in rows(first.run)] == ["opt4"] and [r.phase for r in rows(second.run)] == [
        "opt4",
        "opt5",
    ]
    assert all(
        (folder / str(r.picture)).is_file() for folder in (first.run, second.run) for r in rows(folder)
    )
    shards = {call("--phase", "opt4", "opt5", "--shard", f"{k}/2").run for k in (1, 2)}
    assert shards == {first.run}


# --- the whole chain, against a program that knows spheres only


def test_twenty_steps_lose_the_spheres_rims(tmp_path):
    """two_spheres has a cap of 20 steps: baseline's misses and |Δt| by the discriminant of a quadratic."""
    n = 48
    words = ("--phase", "baseline", "--scene", "two_spheres", "-n", str(n), "--jobs", "1")
    assert commands.called("accuracy", [*words, "--run", str(tmp_path)])[0].ended == 0
    (found,) = rows(tmp_path)

    scene = registry.find_scene("two_spheres")
    origin, directions = geometry.rays(scene.data, n, n)
    depth = np.full((2, n, n), np.inf)
    for i, shape in enumerate(scene.data["shapes"]):
        offset = origin - np.array(shape.get("position", (0, 0, 0)), float)
        half = directions @ offset
        inside = half**2 - (offset @ offset - shape["radius"] ** 2)
        first = -half - np.sqrt(np.maximum(inside, 0))
        depth[i][(inside >= 0) & (first > 0)] = first[(inside >= 0) & (first > 0)]
    exact = depth.min(axis=0)
    (path,) = tmp_path.glob("images/two_spheres-baseline-*.exr")
    made = images.read(path)
    hit = made["id"] >= 0
    assert found.false_misses_ppm == pytest.approx(1e6 * (np.isfinite(exact) & ~hit).sum() / n**2) != 0
    assert found.false_hits_ppm == pytest.approx(1e6 * (np.isinf(exact) & hit).sum() / n**2)
    same = hit & (made["id"] == depth.argmin(axis=0)) & np.isfinite(exact)
    off = np.abs(made["Z"].astype(float)[same] - exact[same])
    assert found.dt_max == pytest.approx(off.max(), abs=1e-5)
    assert found.dt_p99 == pytest.approx(np.percentile(off, 99), abs=1e-5)
    assert found.proved_fraction == 1
