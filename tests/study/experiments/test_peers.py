"""Beside other programs: translations by known values and by picture, what is missing by name, ratios by
arithmetic. A peer that is not installed leaves out its own picture alone."""

from __future__ import annotations

import functools
import importlib
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import OpenImageIO as oiio
import pytest

from study.core import cli, commands, registry, run, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.scene_json import Camera, Displacement, Shape
from study.experiments.peers import measure, peer, shader, tables
from study.experiments.peers.measure import Measuring, Point
from study.experiments.peers.peer import Drawn, Job, Peer
from study.experiments.peers.programs import drjit, embree, fidget, povray
from study.numbers.beside import PEERS, PLAIN, Peers, Program
from study.numbers.schema import Skipped
from study.truth import truth

solid = functools.partial(Shape, material="white")
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


WALL = Wall("wall", "Wall", "all", "it is grey", dict.fromkeys(PLAIN, 1.0), cores=False)
OFFLINE = Offline("offline", "Offline", "all", "", {})
GONE = replace(ALL["povray"], name="gone", title="Gone")


def test_the_camera_is_as_the_format_has_it() -> None:
    scene = registry.find_scene("scene0").content
    scene.camera = Camera((1, 2, 3), (3, 2, 3), (0, 5, 0), 90)
    found = shader.camera(scene, 320, 160)
    assert [found.position, found.ahead, found.right, found.up] == [
        (1, 2, 3),
        pytest.approx([1, 0, 0]),
        pytest.approx([0, 0, -2]),
        pytest.approx([0, 1, 0]),
    ]


def test_povray_gets_the_scene_and_says_what_it_lacks() -> None:
    text = povray.translated(registry.find_scene("scene0_plain").content, 320, 180)
    for solid in ("plane {", "box {", "sphere {", "cone {", "torus {", "mesh {"):
        assert text.count(f"\n{solid}") == 1
    with pytest.raises(StudyError, match="soft shadows"):
        povray.translated(registry.find_scene("scene0").content, 320, 180)
    for name, value, said in (
        ("type", "mandelbulb", "no mandelbulb"),
        ("rounding", 0.1, "rounded"),
        ("repeat", (0, 1, 0), "repeats"),
    ):
        changed = registry.find_scene("scene0_plain").content
        setattr(changed.shapes[1], name, value)
        with pytest.raises(StudyError, match=said):
            povray.translated(changed, 320, 180)


def test_povrays_picture_is_read_as_it_is(tmp_path: Path) -> None:
    pixels = np.array([[[0, 1, 2], [65535, 13107, 0]]], np.uint16)
    spec = oiio.ImageSpec(2, 1, 3, "uint16")
    file = oiio.ImageOutput.create(str(tmp_path / "picture.png"))
    assert file.open(str(tmp_path / "picture.png"), spec) and file.write_image(pixels) and file.close()
    assert povray.read_linear(tmp_path / "picture.png") == pytest.approx(pixels / 65535)
    with pytest.raises(StudyError, match=r"none\.png"):
        povray.read_linear(tmp_path / "none.png")


def test_embrees_hits_are_shaded_as_the_format_has_it(tmp_path: Path) -> None:
    """A plane z = 2 seen head on, the light at the camera: c (0.01 + 6/2) + 0.2·6/2, times exp(−0.1·8)."""
    data = registry.find_scene("scene0").data | {
        "light": {"position": [0, 0, 0], "emission": [6, 6, 6], "shadows": "none"},
        "background": [0.25, 0, 0],
        "fog": 0.1,
        "materials": {"m": {"color": [0.5, 0, 1], "shininess": 9}},
        "shapes": [{"type": "plane", "normal": [0, 0, -1], "offset": -2, "material": "m"}],
    }
    rays = np.array([[0, 0, 0, 0, 0, 1, math.inf], [0, 0, 0, 0, 0, -1, math.inf]], "<f4")
    seen = embree.shaded(Scene("s", tmp_path, data, False), rays, np.array([[2, 0], [np.inf, -1]]))
    fog = math.exp(-0.8)
    assert seen[0] == pytest.approx([2.105 * fog, 0.6 * fog, 3.61 * fog]) and list(seen[1]) == [0.25, 0, 0]


RIPPLE = Displacement(0.3, (1, 1, 1))
BLOCK = solid(
    "group", operation="union", shapes=[solid("box", half_size=(1, 1, 1)), solid("sphere", radius=1.4)]
)
CORED = solid(
    "group",
    operation="difference",
    position=(0, 0, 5),
    shapes=[BLOCK, solid("sphere", radius=0.5), solid("capsule", radius=0.3, half_height=9)],
)


@pytest.mark.parametrize(
    ("shape", "inside", "outside"),
    [
        (solid("sphere", radius=2), [0, 1.99, 0], [0, 2.01, 0]),
        (solid("plane", normal=(0, 2, 0), offset=3), [9, 1.49, 9], [9, 1.51, 9]),
        (solid("box", half_size=(1, 2, 3)), [0.99, -1.99, 2.99], [0.99, -2.01, 2.99]),
        (solid("torus", major_radius=3, minor_radius=1), [0, 0, 2.01], [0, 0, 1.99]),
        (solid("octahedron", radius=3), [0.99, -1, 1], [1.01, -1, 1]),
        (solid("cone", bottom_radius=2, top_radius=1, half_height=1), [0, -0.99, 1.98], [0, -0.99, 2.01]),
        (solid("sphere", radius=1, position=(5, 0, 0)), [5.99, 0, 0], [6.01, 0, 0]),
        (solid("box", half_size=(1, 2, 3), rotation_degrees=(90, 0, 0)), [0, 2.99, 0], [0, 0, 2.01]),
        (solid("box", half_size=(1, 2, 3), rounding=0.5), [1.35, 2.35, 3], [1.36, 2.36, 3]),
        (solid("capsule", radius=1, half_height=2), [0.6, -2.79, 0], [0.6, -2.81, 0]),
        (solid("gyroid", cell=math.tau, thickness=0.4), [0.35, 0, 0], [0.36, 0, 0]),
        (solid("sphere", radius=1, position=(3, 0, 0), mirror="x"), [3.99, 0, 0], [-2, 0, 0]),
        (solid("box", half_size=(3, 3, 1), twist=math.pi / 4), [0.9, 2, 2.9], [2.9, 2, 0.9]),
        (solid("sphere", radius=2, displace=RIPPLE), [-1.2, 1.2, 1.2], [1.1, 1.1, 1.1]),
        (solid("sphere", radius=2, shell=0.1), [1.91, 0, 0], [1.89, 0, 0]),
        (solid("sphere", radius=2, offset=0.5), [2.49, 0, 0], [2.51, 0, 0]),
        (CORED, [0.9, 0, 6], [0.2, 0.9, 5]),
        (CORED, [-1.3, 0, 5], [-1.5, 0, 5]),
    ],
)
def test_fidgets_solids_are_below_zero_inside(shape: Shape, inside: list, outside: list) -> None:
    """Points just inside and just outside of each solid, on an axis and off it."""
    found = fidget.solid(shape, np.array([inside, outside], float).T)
    assert found[0] < 0 < found[1]


def test_fidget_says_what_it_lacks() -> None:
    blend = solid("group", operation="union", blend=0.1, shapes=[solid("sphere", radius=1)])
    for lacking in (solid("mandelbulb"), blend, solid("box", repeat=(1, 0, 0))):
        with pytest.raises(StudyError, match="fidget"):
            fidget.solid(lacking, np.zeros(3))


@pytest.mark.parametrize(
    ("name", "p"),
    [("scene0_plain", (1.7, -1.2, 11.5)), ("csg", (1.1, 0.3, 12.2)), ("bumpy", (-2.3, 0.1, 12.8))],
)
def test_fidgets_text_says_the_same(name: str, p: tuple) -> None:
    """So at a point inside a solid."""
    scene, known = registry.find_scene(name).content, {}
    operations = {
        **{"add": float.__add__, "sub": float.__sub__, "mul": float.__mul__, "min": min, "max": max},
        **{"abs": abs, "sqrt": math.sqrt, "const": float},
        **{"sin": math.sin, "cos": math.cos, "neg": float.__neg__},
    }
    for name, operation, *operands in map(str.split, fidget.expression(scene).splitlines()):
        values = [known.get(one, one) for one in operands]
        axis = "xyz".find(operation[-1]) if operation.startswith("var-") else -1
        known[name] = p[axis] if axis >= 0 else operations[operation](*values)
    least = min(fidget.solid(shape, np.array(p)) for shape in scene.shapes)
    assert known[name] == pytest.approx(least) and least < 0


def test_fidgets_voxels_lie_along_a_pixels_ray() -> None:
    """The middle of 90 rows, 160 columns; nearest and farthest voxel; and fidget's own map of them undone."""
    scene = registry.find_scene("scene0_plain").content
    voxels = fidget.from_voxels(scene, 160, 90)
    both = [voxels @ [79.5, 44.5, k, 1] for k in (0, fidget.DEPTH)]
    assert [p[:3] / p[3] for p in both] == [pytest.approx([0, 0, 100]), pytest.approx([0, 0, 10])]
    corner = voxels @ [-0.5, -0.5, fidget.DEPTH, 1]
    up = 10 * math.tan(math.radians(15))
    assert corner[:3] / corner[3] == pytest.approx([-up * 16 / 9, up, 10])
    world = [(3 - 80) / 45, (7 - 44) / -45, (9 - 512) / 45, 1]
    assert fidget.from_world(scene, 160, 90) @ world == pytest.approx(voxels @ [3, 7, 9, 1])


class Vec(np.ndarray):
    """A point, as libraries that compile Python have it."""

    x, y, z = (property(lambda self, i=i: float(self[i])) for i in range(3))


def test_the_formulas_of_compiled_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Distances one and a half from each solid, by NumPy; w to the power 8 by its angles."""
    monkeypatch.syspath_prepend(peer.WORKERS)
    formulas = importlib.import_module("formulas")
    names = ("dot", "minimum", "maximum", "clip", "sqrt")
    m = SimpleNamespace(
        **{name: getattr(np, name) for name in names},
        **{"norm": np.linalg.norm, "norm2": math.hypot, "func": lambda f: f, "rcp": lambda x: 1 / x},
        **{"select": lambda a, b, c: b if a else c, "vec3": lambda *v: np.array(v, float).view(Vec)},
    )
    shapes, vec3 = formulas.shapes(m), m.vec3
    edge = 1.5 + 1.5 / math.sqrt(2)  # of an octahedron
    for name, p, sizes in (
        ("sphere", (0, -3.5, 0), (2,)),
        ("plane", (9, 4.5, 9), (vec3(0, 1, 0), 3)),
        ("box", (1.9, 3.2, 0), (vec3(1, 2, 3), 0)),
        ("box", (1, 2, 4.6), (vec3(1, 2, 3), 0.1)),
        ("torus", (5.7, -1.6, 0), (4.5, 0.5)),
        ("cone", (0.3, 2.5, 0.4), (2, 1, 1)),
        ("cone", (2.9, -2.2, 0), (2, 1, 1)),
        ("cone", (0.9 + 1.8 / math.sqrt(5), 1.5 / math.sqrt(5), 1.2 + 2.4 / math.sqrt(5)), (2, 1, 1)),
        ("octahedron", (0, 0, -4.5), (3,)),
        *(("octahedron", tuple(np.roll([0, edge, -edge], i)), (3,)) for i in range(3)),
        ("octahedron", tuple([1 + 1.5 / math.sqrt(3)] * 3), (3,)),
    ):
        assert shapes[name](vec3(*p), *sizes) == pytest.approx(1.5), name
    w = vec3(0.3, -0.7, 0.5)
    r, polar, azimuth = np.linalg.norm(w), 8 * math.acos(w.y / np.linalg.norm(w)), 8 * math.atan2(w.x, w.z)
    turned = math.sin(polar) * math.sin(azimuth), math.cos(polar), math.sin(polar) * math.cos(azimuth)
    assert formulas.eighth(m)(w) == pytest.approx(r**8 * np.array(turned))


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


def test_what_is_not_there_says_what_it_needs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(povray.shutil, "which", lambda name: None)
    monkeypatch.setattr(peer, "HOME", tmp_path)
    for one, needed in ((GONE, "povray"), (ALL["taichi"], "taichi=="), (ALL["fidget"], "cargo")):
        assert needed in (one.lacking() or "")
    with pytest.raises(StudyError, match="cargo") as error:
        ALL["fidget"].install()
    assert error.value.exit_status == cli.CANNOT_RUN


def test_the_newest_llvm_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"libLLVM-15.so.1": 15, "libLLVM.so.19.1": 19, "libLLVM-17.so": 17, "libLLVM-9.so": None}
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    with pytest.raises(StudyError, match="found: none"):
        drjit.find_llvm([tmp_path])
    for name in versions:
        (tmp_path / name).write_text("no library")
    assert drjit.llvm_version(tmp_path / "libLLVM-17.so") is None
    monkeypatch.setattr(drjit, "llvm_version", lambda path: versions[path.name])
    assert drjit.find_llvm([tmp_path]) == (tmp_path / "libLLVM.so.19.1", 19)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM-17.so"))
    assert drjit.find_llvm([tmp_path])[1] == 17
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM-15.so.1"))
    with pytest.raises(StudyError, match=r"libLLVM-15\.so\.1"):
        drjit.find_llvm([tmp_path])


def test_a_worker_that_fails_or_says_nothing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = tmp_path / "llvmpipe" / "venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    monkeypatch.setattr(peer, "HOME", tmp_path)
    scene = registry.find_scene("scene0_plain")
    job = Job(scene, (32, 18), 1, 1, set(run.USABLE), tmp_path)
    for text, said in (("echo no such module >&2; exit 3", "no such module"), ("", "llvmpipe")):
        python.write_text(f"#!/bin/sh\n{text}\n")
        python.chmod(0o755)
        with pytest.raises(StudyError, match=said) as error:
            ALL["llvmpipe"].draw(job)
        assert error.value.exit_status == cli.CANNOT_RUN
    python.write_text('#!/bin/sh\necho "a remark"\necho \'{"ns": [5, 6], "version": "9"}\'\n')
    assert ALL["llvmpipe"].draw(job) == Drawn([5, 6], "9", None)
    task = json.loads((tmp_path / "task.json").read_text())
    assert task["scene"]["march"]["hit_distance"] == 1e-5 and "torus(" in task["source"]


def test_each_stands_beside_our_phases_on_what_it_draws() -> None:
    made = measure.points([OPT4, OPT5], {"wall": WALL}, ["scene0_plain", "spheres40_plain"], [1, 2])
    assert made == [Point(name, "scene0_plain", 1) for name in ("opt4", "opt5_threads", "wall")]
    both = replace(WALL, cores=True)
    made = measure.points([OPT4, OPT5], {"wall": both}, ["scene0_plain"], [2])
    assert [p.program for p in made] == ["opt5_threads", "wall"]


def test_what_cannot_be_drawn_is_left_out(tmp_path: Path) -> None:
    scenes = {name: measure.plain(name, tmp_path) for name in PLAIN}
    work = Measuring({"wall": WALL}, scenes, 16, run.FASTEST)
    wanted = [Point(name, scene, 1) for scene in scenes for name in ("opt4", "wall")]
    told, out = work.judged(wanted, 16)
    assert [(one.phase, one.scene) for one in out] == [("Wall", "mandelbulb_plain")]
    assert list(told) == [(p.program, p.scene) for p in wanted[:3]]
    assert told["opt4", "scene0_plain"]["psnr_db"] > 40 > 10 > told["wall", "scene0_plain"]["psnr_db"]
    assert work.reps == dict.fromkeys(told, measure.FRAMES) and work.versions["wall"] == "1"
    assert work.once(wanted[1], 9) == 7e6


def test_errors_by_arithmetic(tmp_path: Path) -> None:
    """The truth itself is identical; 0.1 too dark everywhere is 20 dB; NaN is no picture."""
    scene = measure.plain("spheres40", tmp_path)
    exact = truth.picture(scene, scene.size(16))
    picture = np.stack([exact[name] for name in "RGB"], -1)
    found = measure.errors(exact, picture, False)
    assert found["psnr_db"] is None and found["rmse"] == 0
    grey = exact | dict.fromkeys("RGB", np.full_like(exact["R"], 0.5))
    for fractal in (False, True):
        found = measure.errors(grey, np.full_like(picture, 0.4), fractal)
        assert found["psnr_db"] == pytest.approx(20, abs=1e-3) and found["averaged"] is fractal
    height, width = exact["R"].shape
    checks = 0.5 + 0.1 * (-1.0) ** np.add.outer(np.arange(height), np.arange(width))
    checked = np.repeat(checks[..., None], 3, axis=-1).astype(np.float32)  # whose means are grey
    assert measure.errors(grey, checked, False)["psnr_db"] == pytest.approx(20, abs=1e-3)
    assert measure.errors(grey, checked, True)["rmse"] < 1e-6
    found = measure.errors(exact, np.full_like(picture, np.nan), False)
    assert found["non_finite"] == picture.size and found["rmse"] is None


def result(psnr_db: float | None = 50.0, rmse: float | None = 0.003) -> Peers:
    """Rows of known times: the wall takes 30 ms, opt4 20 and opt5 10. The errors are the wall's."""
    times = {Point(name, "a", 1): [ms * 1e6] * 6 for name, ms in (("opt4", 20), ("opt5_threads", 10))}
    times[Point("wall", "a", 1)] = [30e6] * 6
    error = {"psnr_db": 50.0, "rmse": 0.003, "averaged": False, "non_finite": 0}
    told = {(p.program, p.scene): error for p in times}
    told["wall", "a"] = error | {"psnr_db": psnr_db, "rmse": rmse}
    wall = Program(program="Wall", version="1", timed="all", differs="it is grey", least_db={"a": 40.0})
    return Peers(
        **{"schema": 1, "launches": 6, "n": 360, "error_n": 180, "programs": [wall]},
        rows=Measuring({"wall": WALL}, {}, 360, 0).rows(times, told),
        left_out=[Skipped(phase="Gone", reason="needs Debian's package povray")],
    )


def test_a_wrong_picture_is_said() -> None:
    assert tables.wrong(result()) == [] == tables.wrong(result(None, 0.0))
    for made in (result(39.9, 0.01), result(None, None)):
        assert [said.split(":")[0] for said in tables.wrong(made)] == ["Wall on a"]


def test_the_chapter_is_made_from_the_file_alone(tmp_path: Path) -> None:
    assert tables.section(SimpleNamespace(path=tmp_path)).parts == []
    store.write_json(tmp_path / PEERS, result())
    chapter = tables.section(SimpleNamespace(path=tmp_path))
    assert [part.name for part in chapter.parts] == ["peers", "peers-programs"]
    text = chapter.parts[0].markdown
    assert "| Wall | 30.0 [30.0" in text and "Gone" in text
    ratios = {row.program: row.ratio and row.ratio.value for row in result().rows}
    assert ratios == {"Wall": 3, "opt4": 2, "opt5_threads": None}  # to the fastest phase
    assert "3.00× [3.00" in chapter.answer and "50.0 dB" in chapter.answer
    assert chapter.drawn["peers"].make().axes


def called(*words: object) -> Outcome:
    return commands.called("peers", [str(word) for word in words])[0]


def test_bad_input_is_said(tmp_path: Path) -> None:
    for words, said in ((["--phase", "opt9x"], "opt9x"), (["--threads", "4096"], "4096")):
        with pytest.raises(StudyError, match=said):
            called(*words, "--peer", "embree", "--run", tmp_path)


def test_a_run_beside_a_peer_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer, "find_all", lambda: {"wall": WALL, "gone": GONE, "offline": OFFLINE})
    monkeypatch.setattr(povray.shutil, "which", lambda name: None)
    words = ["--phase", "opt1", "--launches", "2", "-n", "16", "--error-n", "16", "--threads", "1"]
    outcome = called(*words, "--install", "--run", tmp_path)
    made = Peers.load(tmp_path / PEERS)
    assert outcome.ended == cli.OK and cli.plain(outcome.result) == cli.plain(made)
    assert [row.program for row in made.rows].count("Wall") == 1 and made.rows[-1].ms.value == 7
    assert [row.program for row in made.rows].count("opt1") == len(PLAIN)
    reasons = {one.phase: one.reason for one in made.left_out}
    assert reasons.keys() == {"Gone", "Offline", "Wall"}
    monkeypatch.setattr(peer, "find_all", lambda: {"gone": GONE})
    with pytest.raises(StudyError) as error:
        called(*words, "--run", tmp_path)
    assert error.value.exit_status == cli.CANNOT_RUN
