"""Beside other programs: translations by known values and by picture, what is missing by name, ratios by
arithmetic. A peer that is not installed leaves out its own picture alone."""

from __future__ import annotations

import copy
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import complete
import needs
import numpy as np
import pytest
import started

from study.core import cli, registry, run
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.experiments.original import measure as original
from study.experiments.peers import command, measure, paper, peer, shader, tables
from study.experiments.peers.measure import Measuring, Point
from study.experiments.peers.peer import Drawn, Job, Peer
from study.experiments.peers.programs import embree, fidget, mandelbulber, povray
from study.truth import truth

SCRIPT = (sys.executable, ROOT / "scripts" / "stepwise", "peers")
OPT4, OPT5 = Spec("opt4", "opt4"), Spec("opt5_threads", "opt5_threads")
ALL = peer.find_all()


class Wall(Peer):
    """Draws a grey wall in 7 ms; fails on the Mandelbulb."""

    def lacking(self) -> str | None:
        return None

    def draw(self, job: Job) -> Drawn:
        if job.scene.fractal:
            raise StudyError("Wall: no fractals")
        grey = np.full((*job.size[::-1], 3), 0.5, np.float32) if job.picture else None
        return Drawn([7e6] * job.frames, "1", grey)


class Offline(Wall):
    """Cannot be installed."""

    def lacking(self) -> str | None:
        return "needs a network"

    def install(self) -> None:
        raise StudyError("there is no network", cli.CANNOT_RUN)


WALL = Wall("wall", "Wall", "all", "it is grey", dict.fromkeys(peer.PLAIN, 1.0), cores=False)
OFFLINE = Offline("offline", "Offline", "all", "", {"scene0_plain": 1.0})
GONE = replace(ALL["povray"], name="gone", title="Gone")


def test_turning_is_as_the_format_has_it() -> None:
    """A quarter about each axis maps (u, v) to (−v, u), on (y, z), (x, z) and (x, y) in turn."""
    assert shader.turn([90, 0, 0]) @ [1, 2, 3] == pytest.approx([1, -3, 2])
    assert shader.turn([0, 90, 0]) @ [1, 2, 3] == pytest.approx([-3, 2, 1])
    assert shader.turn([90, 0, 90]) @ [1, 2, 3] == pytest.approx([3, 1, 2])


def test_the_camera_is_as_the_format_has_it() -> None:
    data = registry.find_scene("scene0").data
    turned = {"position": [1, 2, 3], "look_at": [3, 2, 3], "up": [0, 5, 0], "vertical_fov_degrees": 90}
    found = shader.camera(data | {"camera": turned}, 320, 160)
    assert [found[name] for name in ("position", "ahead", "right", "up")] == [
        [1, 2, 3],
        pytest.approx([1, 0, 0]),
        pytest.approx([0, 0, -2]),
        pytest.approx([0, 1, 0]),
    ]


def test_povray_gets_the_scene_and_says_what_it_lacks() -> None:
    data = registry.find_scene("scene0_plain").data
    text = povray.translated(data, 320, 180)
    for solid in ("plane {", "box {", "sphere {", "cone {", "torus {", "mesh {"):
        assert text.count(f"\n{solid}") == 1
    for other, said in (
        ("scene0", "other soft shadows and mirrors"),
        ("mandelbulb", "other soft shadows and mirrors"),
    ):
        with pytest.raises(StudyError, match=said):
            povray.translated(registry.find_scene(other).data, 320, 180)
    for change, said in (
        ({"type": "mandelbulb"}, "no mandelbulb"),
        ({"rounding": 0.1}, "no box with rounded edges"),
        ({"repeat": [0, 1, 0]}, "repeats no shape"),
    ):
        changed = copy.deepcopy(data)
        changed["shapes"][1] |= change
        with pytest.raises(StudyError, match=said):
            povray.translated(changed, 320, 180)


def test_embrees_hits_are_shaded_as_the_format_has_it(tmp_path: Path) -> None:
    """A plane z = 2 seen head on, the light at the camera: c (0.01 + 6/2) + 0.2·6/2, times exp(−0.1·8)."""
    data = {
        "light": {"position": [0, 0, 0], "emission": [6, 6, 6]},
        "background": [0.25, 0, 0],
        "fog": 0.1,
        "march": {"bounds_radius": 100},
        "materials": {"m": {"color": [0.5, 0, 1], "shininess": 9}},
        "shapes": [{"type": "plane", "normal": [0, 0, -1], "offset": -2, "material": "m"}],
    }
    rays = np.array([[0, 0, 0, 0, 0, 1, math.inf], [0, 0, 0, 0, 0, -1, math.inf]], "<f4")
    seen = embree.shaded(Scene("s", tmp_path, data, False), rays, np.array([[2, 0], [np.inf, -1]]))
    fog = math.exp(-0.8)
    assert seen[0] == pytest.approx([2.105 * fog, 0.6 * fog, 3.61 * fog]) and list(seen[1]) == [0.25, 0, 0]


def test_fidgets_solids_are_below_zero_inside() -> None:
    """Points just inside and just outside of each solid, on an axis and off it."""
    for shape, inside, outside in (
        ({"type": "sphere", "radius": 2}, [0, 1.99, 0], [0, 2.01, 0]),
        ({"type": "plane", "normal": [0, 2, 0], "offset": 3}, [9, 1.49, 9], [9, 1.51, 9]),
        ({"type": "box", "half_size": [1, 2, 3]}, [0.99, -1.99, 2.99], [0.99, -2.01, 2.99]),
        ({"type": "torus", "major_radius": 3, "minor_radius": 1}, [0, 0, 2.01], [0, 0, 1.99]),
        ({"type": "octahedron", "radius": 3}, [0.99, -1, 1], [1.01, -1, 1]),
        (
            {"type": "cone", "bottom_radius": 2, "top_radius": 1, "half_height": 1},
            [0, -0.99, 1.98],
            [0, -0.99, 2.01],
        ),
        ({"type": "sphere", "radius": 1, "position": [5, 0, 0]}, [5.99, 0, 0], [6.01, 0, 0]),
        ({"type": "box", "half_size": [1, 2, 3], "rotation_degrees": [90, 0, 0]}, [0, 2.99, 0], [0, 0, 2.01]),
    ):
        found = [fidget.solid(shape, list(map(float, p)), math.sqrt) for p in (inside, outside)]
        assert found[0] < 0 < found[1], shape
    with pytest.raises(StudyError, match="gets no mandelbulb"):
        fidget.solid({"type": "mandelbulb"}, [0, 0, 0], math.sqrt)


def test_fidgets_text_says_the_same() -> None:
    data, known = registry.find_scene("scene0_plain").data, {}
    p = (1.7, -1.2, 11.5)
    operations = {
        **{"add": float.__add__, "sub": float.__sub__, "mul": float.__mul__, "min": min, "max": max},
        **{"abs": abs, "sqrt": math.sqrt, "const": float},
    }
    for name, operation, *operands in map(str.split, fidget.expression(data).splitlines()):
        values = [known.get(one, one) for one in operands]
        axis = "xyz".find(operation[-1]) if operation.startswith("var-") else -1
        known[name] = p[axis] if axis >= 0 else operations[operation](*values)
    least = min(fidget.solid(shape, list(p), math.sqrt) for shape in data["shapes"])
    assert known[name] == pytest.approx(least) and least < 0  # inside the cone


def test_fidgets_voxels_lie_along_a_pixels_ray() -> None:
    """The middle of 90 rows, 160 columns; nearest and farthest voxel; and fidget's own map of them undone."""
    data = registry.find_scene("scene0_plain").data
    both = [fidget.from_voxels(data, 160, 90) @ [79.5, 44.5, k, 1] for k in (0, fidget.DEPTH)]
    assert [p[:3] / p[3] for p in both] == [pytest.approx([0, 0, 100]), pytest.approx([0, 0, 10])]
    corner = fidget.from_voxels(data, 160, 90) @ [-0.5, -0.5, fidget.DEPTH, 1]
    up = 10 * math.tan(math.radians(15))
    assert corner[:3] / corner[3] == pytest.approx([-up * 16 / 9, up, 10])
    world = [(3 - 80) / 45, (7 - 44) / -45, (9 - 512) / 45, 1]
    assert fidget.from_world(data, 160, 90) @ world == pytest.approx(
        fidget.from_voxels(data, 160, 90) @ [3, 7, 9, 1]
    )


def test_mandelbulber_gets_the_mandelbulb_in_its_coordinates(tmp_path: Path) -> None:
    """The Mandelbulb of mandelbulb.json is 6 ahead, its floor 1.5 below, its bailout 256 of the square."""
    data = measure.plain("mandelbulb", tmp_path).data
    lines = mandelbulber.settings(data, 320, 180, 2).splitlines()
    for line in (
        "camera -0.0 0.0 -6.0;",
        "bailout 16.0;",
        "primitive_plane_1_position -0.0 -1.5 0.0;",
        "image_width 321;",
        "limit_CPU_cores 2;",
    ):
        assert line in lines
    (fov,) = (float(line.split()[1].rstrip(";")) for line in lines if line.startswith("fov "))
    assert fov / 181 == pytest.approx(2 * math.tan(math.radians(12.5)) / 180)  # between two rows
    other = copy.deepcopy(data)
    other["shapes"][0]["normal"] = [0, -1, 0]
    for wrong, said in (
        (other, "a floor that faces up"),
        (registry.find_scene("mandelbulb").data, "other soft shadows"),
        (registry.find_scene("scene0_plain").data, "one Mandelbulb"),
    ):
        with pytest.raises(StudyError, match=said):
            mandelbulber.settings(wrong, 320, 180, 1)


def test_mandelbulbers_places_are_found_by_their_fractions() -> None:
    """Points about the middle, seen from 6 away. Its 16 bits hold x·65535 modulo 65536."""
    points = np.random.default_rng(1).uniform(-1.15, 1.15, (200, 3))
    eye = np.array([0.3, 0.2, -6])
    d = (points - eye) / np.linalg.norm(points - eye, axis=1, keepdims=True)
    steps = np.trunc(points * 65535).astype(int)
    found = mandelbulber.places((steps & 65535) / 65535, eye, d)
    assert np.abs(found - points).max() < 2 / 65535


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scene"), [(name, scene) for name, one in ALL.items() for scene in one.least_db]
)
def test_a_peer_draws_the_scene(name: str, scene: str, tmp_path: Path) -> None:
    """Its PSNR to ground truth is no less than it declares."""
    one = ALL[name]
    if needed := one.lacking():
        pytest.skip(f"{one.title} {needed}")
    work = Measuring(ALL, {scene: measure.plain(scene, tmp_path)}, 90, run.FASTEST)
    found = work.judge(Point(name, scene, 1), 90)
    assert found["non_finite"] == 0 and found["psnr_db"] >= one.least_db[scene]
    assert work.versions[name] and work.once(Point(name, scene, 1), 100) > 0


def test_what_is_not_there_is_left_out_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer.shutil, "which", lambda name: None)
    monkeypatch.setattr(peer, "HOME", Path("/nowhere"))
    others = {"wall": WALL, "gone": GONE, "taichi": ALL["taichi"]}
    able, out = measure.able(others)
    assert list(able) == ["wall"] and out == [
        {"phase": "Gone", "reason": "needs Debian's package povray"},
        {"phase": "Taichi", "reason": "needs taichi==1.7.4 from PyPI: --install"},
    ]


def test_a_worker_that_fails_or_says_nothing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = tmp_path / "taichi" / "venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    monkeypatch.setattr(peer, "HOME", tmp_path)
    scene = registry.find_scene("scene0_plain")
    job = Job(scene, (32, 18), 1, 1, set(run.USABLE), tmp_path)
    for text, said in (("echo no such module >&2; exit 3", "Taichi: no such module"), ("", "no JSON object")):
        python.write_text(f"#!/bin/sh\n{text}\n")
        python.chmod(0o755)
        with pytest.raises(StudyError, match=said) as error:
            ALL["taichi"].draw(job)
        assert error.value.exit_status == cli.CANNOT_RUN
    python.write_text('#!/bin/sh\necho "a remark"\necho \'{"ns": [5, 6], "version": "9"}\'\n')
    assert ALL["taichi"].draw(job) == Drawn([5, 6], "9", None)
    task = json.loads((tmp_path / "task.json").read_text())
    assert task["scene"]["march"]["hit_distance"] == 1e-5 and "torus(" in task["source"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--peer", "cinema4d"], "invalid choice: 'cinema4d'"),
        (["--phase", "opt9x"], "no phase 'opt9x'"),
        (["--scene", "trio"], "no other program draws 'trio'"),
        (["--threads", "4096"], "--threads 4096: there are"),
        (["--paper", "/nowhere"], "/nowhere: is no git checkout of the paper's program"),
    ],
)
def test_bad_input_is_one_line(words: Sequence[str], said: str, tmp_path: Path) -> None:
    some = words if "--peer" in words or "--paper" in words else [*words, "--peer", "embree"]
    done = started.run([*SCRIPT, *some, "--run", tmp_path])
    assert done.returncode in (cli.BAD_INPUT, cli.CANNOT_RUN) and "Traceback" not in done.stderr
    assert said in done.stderr or done.returncode == cli.CANNOT_RUN, done.stderr


def test_each_stands_beside_our_phases_on_what_it_draws() -> None:
    made = measure.points([OPT4, OPT5], {"wall": WALL}, ["scene0_plain", "spheres40_plain"], [1, 2])
    assert made == [Point(name, "scene0_plain", 1) for name in ("opt4", "opt5_threads", "wall")]
    both = replace(WALL, cores=True)
    made = measure.points([OPT4, OPT5], {"wall": both}, ["scene0_plain"], [2])
    assert [p.program for p in made] == ["opt5_threads", "wall"]


def test_what_cannot_be_drawn_is_left_out(tmp_path: Path) -> None:
    scenes = {name: measure.plain(name, tmp_path) for name in peer.PLAIN}
    work = Measuring({"wall": WALL}, scenes, 16, run.FASTEST)
    wanted = [Point(name, scene, 1) for scene in scenes for name in ("opt4", "wall")]
    told, out = measure.judged(work, wanted, 16)
    assert out == [{"phase": "Wall", "scene": "mandelbulb_plain", "reason": "Wall: no fractals"}]
    assert list(told) == [(p.program, p.scene) for p in wanted[:3]]
    assert told["opt4", "scene0_plain"]["psnr_db"] > 40 > 10 > told["wall", "scene0_plain"]["psnr_db"]
    assert work.reps == dict.fromkeys(told, measure.FRAMES) and work.versions["wall"] == "1"
    assert work.once(wanted[1], 9) == 7e6


def test_errors_by_arithmetic(tmp_path: Path) -> None:
    """The truth itself is identical; 0.1 too dark everywhere is 20 dB; NaN is no picture."""
    scene = measure.plain("spheres40", tmp_path)
    exact = truth.picture(scene, scene.size(16))
    picture = np.stack([exact[name] for name in "RGB"], -1)
    assert measure.errors(exact, picture, False)["psnr_db"] == math.inf
    grey = {**exact, **dict.fromkeys("RGB", np.full_like(exact["R"], 0.5))}
    for fractal in (False, True):
        found = measure.errors(grey, np.full_like(picture, 0.4), fractal)
        assert found["psnr_db"] == pytest.approx(20, abs=1e-3) and found["averaged"] is fractal
    height, width = exact["R"].shape
    checks = 0.5 + 0.1 * (-1.0) ** np.add.outer(np.arange(height), np.arange(width))
    checked = np.repeat(checks[..., None], 3, axis=-1).astype(np.float32)  # whose means are grey
    assert measure.errors(grey, checked, False)["psnr_db"] == pytest.approx(20, abs=1e-3)
    assert measure.errors(grey, checked, True)["psnr_db"] > 120
    found = measure.errors(exact, np.full_like(picture, np.nan), False)
    assert found["non_finite"] == picture.size and math.isnan(found["psnr_db"])


def result(paper_too: bool = False) -> dict[str, Any]:
    """Rows of known times: the wall takes 30 ms, opt4 20 and opt5 10; the paper's baseline 400 and opt4 80,
    ours 300 and 20."""
    known = {("opt4", "a"): 20, ("opt5_threads", "a"): 10, ("wall", "a"): 30}
    others: dict[str, Peer] = {"wall": WALL}
    if paper_too:
        others |= {
            "paper_" + name: paper.steps(["paper_b"])["paper_" + name] for name in ("baseline", "opt4")
        }
        known |= {("paper_baseline", "paper_b"): 400, ("paper_opt4", "paper_b"): 80}
        known |= {("baseline", "paper_b"): 300, ("opt4", "paper_b"): 20}
    times = {Point(*key, 1): [ms * 1e6] * 6 for key, ms in known.items()}
    error = {"psnr_db": 50.0, "rmse": 0.003, "psnr_display_db": 45.0, "averaged": False, "non_finite": 0}
    told = {(p.program, p.scene): error for p in times}
    rows = measure.rows(times, told, others, lambda name: getattr(others.get(name), "phase", None))
    about = {"schema": 1, "launches": 6, "n": 360, "error_n": 180}
    programs: list[dict[str, Any]] = [
        {"program": "Wall", "version": "1", "timed": "all", "differs": "it is grey"}
    ]
    programs[0]["least_db"] = {"a": 40.0}
    out = [{"phase": "Gone", "reason": "needs Debian's package povray"}]
    return cli.plain(about | {"programs": programs, "rows": rows, "left_out": out})


def test_ratios_are_to_the_fastest_phase_or_the_same_step() -> None:
    rows = {row["program"]: row for row in result(True)["rows"] if row["kind"] != "phase"}
    assert rows["Wall"]["ratio"]["value"] == 3 and rows["Wall"]["beside"] == "opt5_threads"
    assert rows["the paper's opt4"]["ratio"]["value"] == 4 and rows["the paper's opt4"]["beside"] == "opt4"
    fastest = next(row for row in result()["rows"] if row["program"] == "opt5_threads")
    assert fastest["ratio"] is None and fastest["kind"] == "phase"


def test_a_wrong_picture_is_said() -> None:
    made = result()
    assert tables.wrong(made) == []
    for value, rmse, said in ((39.9, 0.01, "39.9 dB"), (None, None, "not finite")):
        made["rows"][2] |= {"psnr_db": value, "rmse": rmse}
        assert tables.wrong(made) == [f"Wall on a: {said} to ground truth, less than 40"]
    made["rows"][2] |= {"psnr_db": None, "rmse": 0.0}
    assert tables.wrong(made) == []


def test_the_papers_own_speed_ups_stand_beside_ours() -> None:
    steps = tables.beside_the_paper(result(True)["rows"])
    assert [row["beside"] for row in steps] == ["baseline", "opt4"]
    assert [row["gain"].value for row in steps] == [1, 5]
    assert [row["own_gain"].value for row in steps] == [1, 15]


def test_displayed_pictures_can_be_identical() -> None:
    row = {"rmse": 0.001, "psnr_display_db": None}
    assert [tables.displayed(row | change) for change in ({}, {"psnr_display_db": 45.0}, {"rmse": None})] == [
        "identical",
        "45.0",
        "–",
    ]


def test_the_chapter_is_made_from_the_file_alone(tmp_path: Path) -> None:
    assert tables.section(tmp_path).parts == []
    complete.write(tmp_path / measure.FILE, result(True))
    chapter = tables.section(tmp_path)
    assert [part.name for part in chapter.parts] == ["peers", "peers-paper", "peers-programs"]
    text = chapter.parts[0].markdown
    assert "| Wall | 30.0 [30.0" in text and "paper" not in text and "Left out: Gone: needs Debian's" in text
    assert (
        "Wall takes 3.00× [3.00" in chapter.answer and "of opt5_threads on a (50.0 dB, ours" in chapter.answer
    )
    assert "5.00×" in chapter.parts[1].markdown and "15.0×" in chapter.parts[1].markdown
    assert chapter.drawn["peers"].make().axes


def test_displayed_bytes_are_undone_to_the_middle_of_their_step() -> None:
    every = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    assert (paper.images.to_display(paper.linear(every)) == every).all()


@pytest.mark.slow
def test_the_papers_steps_draw_their_scene_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a checkout: a scene of its own by its baseline and by ours, each 8 bits from ground truth."""
    kept = needs.papers_program()
    monkeypatch.setattr(paper, "HELD", tmp_path / "paper")
    found = paper.fetched(kept)
    assert {f"paper_{name}" for name in ("scene0", "mandelbulb", "inception", "shape4")} <= found.keys()
    work = Measuring(paper.steps(list(found)), found, 36, run.FASTEST)
    told, out = measure.judged(work, [Point(n, "paper_shape1", 1) for n in ("paper_baseline", "opt1")], 36)
    assert not out and work.versions["paper_baseline"] == f"commit {original.COMMITS['baseline']}"
    theirs, ours = told["paper_baseline", "paper_shape1"], told["opt1", "paper_shape1"]
    assert theirs["psnr_display_db"] > 45 and theirs["psnr_db"] > 45 and ours["psnr_db"] > 45


def test_a_run_beside_a_peer_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(peer, "find_all", lambda: {"wall": WALL, "gone": GONE})
    monkeypatch.setattr(peer, "from_debian", lambda package, program: f"needs Debian's package {package}")
    monkeypatch.setattr(povray, "from_debian", peer.from_debian)
    words = ["--phase", "opt1", "--launches", "2", "-n", "16", "--error-n", "16", "--threads", "1"]
    monkeypatch.setattr(sys, "argv", ["stepwise peers", *words, "--run", str(tmp_path)])
    assert command.main() == cli.OK
    said = capsys.readouterr()
    assert "left out: Gone: needs Debian's package povray" in said.err and "| Wall | 7.00" in said.out
    made = json.loads((tmp_path / measure.FILE).read_text())
    assert [row["program"] for row in made["rows"]].count("Wall") == 1
    assert {one["phase"] for one in made["left_out"]} == {"Gone", "Wall"}
    monkeypatch.setattr(peer, "find_all", lambda: {"wall": WALL, "offline": OFFLINE})
    sys.argv += ["--install", "--scene", "scene0_plain"]
    assert command.main() == cli.OK
    assert "left out: Offline: there is no network" in capsys.readouterr().err
    monkeypatch.setattr(peer, "find_all", lambda: {"gone": GONE})
    with pytest.raises(StudyError, match="none of the other programs is here; --install") as error:
        command.main()
    assert error.value.exit_status == cli.CANNOT_RUN
