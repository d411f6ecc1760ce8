"""opt10_scene: kernels generated for a scene against its general ones, their cache, and no compiler."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from emulated import TRUE, made_in, needs_sixteen, sixteen

from conformance.feature_scenes import FEATURES
from study.core import registry
from study.core.build import build
from study.pictures import images

PHASE = "opt10_scene"
SIZE = ["-n", "61", "-w", "112"]  # rows past the caches; opt9_convex has odd ones in test_convex

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(registry.missing_isa(registry.phases()[PHASE])), reason=f"the CPU lacks what {PHASE} needs"
    ),
    pytest.mark.skipif(not shutil.which("gcc"), reason="gcc would compile kernels"),
]


def facts_of(output: str | bytes) -> dict:
    """What a record says of its kernel."""
    record = json.loads(output)
    kernel, hash_, compile_ns = (record[key] for key in ("kernel", "kernel_hash", "kernel_compile_ns"))
    generated = kernel == "generated"
    return {
        "generated": generated,
        "cached": generated and compile_ns == 0,
        "reason": kernel,
        "hash": hash_,
        "compile_ns": compile_ns,
    }


class Workshop:
    """A cache of its own, and a compiler that compiles a kernel once and then hands out copies."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.cache, self.kept = folder, folder / "cache", folder / "kept"
        self.kept.mkdir()
        self.compiler = self.script(
            "cc",
            f"""for i in "$@"; do case "$i" in -DKERNEL_TAG=*) tag="${{i#*=}}";; *.so) out="$i";; esac; done
            kept="{self.kept}/$(echo "$tag" | tr -d '"').so"
            test -f "$kept" || gcc "$@" && {{ test -f "$kept" || cp "$out" "$kept"; cp "$kept" "$out"; }}""",
        )

    def script(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text("#!/bin/sh\n" + text)
        path.chmod(0o755)
        return path

    def command(self, scene: str | Path, *more: str) -> list[str]:
        path = registry.scenes()[scene].path if isinstance(scene, str) else scene
        return [*map(str, (build(PHASE), path, *SIZE, "--json", *more))]

    def environment(self, changes: dict[str, str]) -> dict[str, str]:
        return os.environ | {"STEPWISE_CC": str(self.compiler), "STEPWISE_CACHE": str(self.cache)} | changes

    def run(
        self, scene: str | Path, *more: str, program: Path | None = None, seconds: float = 90, **changes: str
    ) -> tuple[dict, str, dict[str, np.ndarray]]:
        """What the record says of the kernel, standard error, the picture."""
        out = self.folder / "picture.exr"
        done = subprocess.run(
            [str(program or build(PHASE)), *self.command(scene, *more)[1:], "--aov", "-o", str(out)],
            env=self.environment(changes),
            capture_output=True,
            text=True,
            timeout=seconds,
        )
        assert done.returncode == 0, done.stderr
        return facts_of(done.stdout), done.stderr, images.read(out)


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("kernels"))


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray], within: float = 0.0) -> None:
    for name, values in a.items():
        allowed = within if name in "RGB" else 0.0
        with np.errstate(invalid="ignore"):
            apart = np.abs(np.where(values == b[name], 0, values - b[name]))
        assert (apart <= allowed).all(), (name, np.nanmax(apart))


def scene_of(name: str, shop: Workshop) -> str | Path:
    """A scene or its path; twenty: of spheres40, more than are written out and fewer than a crowd."""
    if name in FEATURES:
        path = shop.folder / f"{name}.json"
        path.write_text(json.dumps(FEATURES[name]))
        return path
    if name == "two materials":  # of copies, whose bundles meet one, or both
        scene = json.loads(registry.scenes()["lattice"].path.read_text())
        scene["materials"]["red"] = {"color": [0.7, 0.1, 0.1], "reflectivity": 0, "shininess": 20}
        scene["shapes"][1]["material"] = "red"
        path = shop.folder / "two.json"
        path.write_text(json.dumps(scene))
        return path
    if name != "twenty":
        return name
    scene = json.loads(registry.scenes()["spheres40"].path.read_text())
    path = shop.folder / "twenty.json"
    path.write_text(json.dumps(scene | {"shapes": scene["shapes"][:20]}))
    return path


# A whole shininess is a row of products in a kernel, else a logarithm and an exponential: 15 · 2^-24 apart.
@pytest.mark.parametrize(
    ("scene", "within"),
    [
        ("scene0", 4e-6),
        ("trio", 4e-6),
        ("twenty", 4e-6),
        ("mandelbulb", 4e-6),
        ("cubes", 4e-6),
        ("lattice", 4e-6),
        ("mirrors_facing_6", 4e-6),
        ("torus_turned_repeated", 4e-6),
        ("shapes_one_of_each", 4e-6),
        ("two materials", 4e-6),
    ],
)
def test_kernel_and_general_code_agree(scene: str, within: float, shop: Workshop) -> None:
    facts, said, generated = shop.run(scene_of(scene, shop))
    assert facts["generated"], facts
    assert not said
    assert facts["compile_ns"] > 0
    assert not facts["cached"]
    general, said, picture = shop.run(scene_of(scene, shop), STEPWISE_CC="none")
    assert not general["generated"] and "none" in general["reason"]
    same(picture, generated, within)
    again, _, picture = shop.run(scene_of(scene, shop), "--threads", "2")
    assert again["cached"] and again["compile_ns"] == 0 and again["hash"] == facts["hash"]
    same(picture, generated)


@pytest.mark.parametrize("scene", ["scene0", "mandelbulb", "cubes", "mirrors_facing_6"])
def test_a_kernel_draws_any_size_by_any_number_of_threads(scene: str, shop: Workshop) -> None:
    """A pixel, a row, a column, one tile and a pixel more, more threads than pixels: the general code's
    picture by one thread, and not a bit of it hangs on the threads."""
    for width, height, threads in [(1, 1, 64), (3, 1, 5), (1, 40, 2), (32, 8, 2), (33, 9, 64), (64, 32, 3)]:
        size = ("-w", str(width), "-n", str(height))
        facts, said, alone = shop.run(scene_of(scene, shop), *size)
        assert facts["generated"] and not said
        _, _, general = shop.run(scene_of(scene, shop), *size, STEPWISE_CC="none")
        assert alone["id"].shape == (height, width)
        same(general, alone, 4e-6)
        facts, said, several = shop.run(scene_of(scene, shop), *size, "--threads", str(threads))
        assert facts["cached"] and not said
        same(several, alone)


def test_kernels_of_features(shop: Workshop, tmp_path: Path) -> None:
    """Of every fourth of conformance's scenes (STEPWISE_EVERY_KERNEL=1: of all, two minutes) a small
    picture by its kernel (-O1, which compiles faster) against the general code's, which conformance judges.
    """
    quick = shop.script("less", 'exec gcc "$@" -O1')
    words = {"STEPWISE_CC": str(quick), "STEPWISE_CACHE": str(tmp_path / "cache")}
    marched = {name for name in FEATURES if "mandelbox" in str(FEATURES[name])}  # which have no kernel
    names = [name for name in FEATURES if name not in marched]
    names = names[:: 1 if os.environ.get("STEPWISE_EVERY_KERNEL") else 4]
    generated = 0
    for name in names:
        size = ("-w", "48", "-n", "27")
        facts, said, by_kernel = shop.run(scene_of(name, shop), *size, **words)
        assert not said, (name, said)
        if facts["generated"]:
            generated += 1
            _, _, general = shop.run(scene_of(name, shop), *size, STEPWISE_CC="none")
            try:
                same(general, by_kernel, 4e-6)
            except AssertionError as error:
                raise AssertionError(f"{name}: {error}") from error
    assert generated >= 0.75 * len(names), f"{generated} of {len(names)} scenes have a kernel"


@pytest.mark.parametrize("scene", ["scene0", "mandelbulb", "cubes", "lattice", "mirrors_facing_6"])
def test_a_kernel_under_sanitizers_draws_the_same_bits(scene: str, shop: Workshop, tmp_path: Path) -> None:
    """The program hands its own sanitizers on to its kernels: an address out of bounds or undefined behaviour
    would end it."""
    words = {"STEPWISE_CC": "gcc", "STEPWISE_CC_SECONDS": "270", "STEPWISE_CACHE": str(tmp_path / "cache")}
    facts, said, sanitized = shop.run(
        scene_of(scene, shop), program=made_in("asan", PHASE, "SANITIZE=1"), seconds=300, **words
    )
    assert facts["generated"] and not said
    kernel = next((tmp_path / "cache").glob("*.so")).read_bytes()
    assert b"__asan_" in kernel and b"__ubsan_" in kernel, "the kernel was sanitized"
    same(shop.run(scene_of(scene, shop))[2], sanitized)


@pytest.mark.skipif(not shutil.which("clang"), reason="clang would compile kernels")
@pytest.mark.parametrize("scene", ["scene0", "mandelbulb"])
def test_clang_makes_kernels_too(scene: str, shop: Workshop, tmp_path: Path) -> None:
    words = {"STEPWISE_CC": "clang", "STEPWISE_CACHE": str(tmp_path / "cache")}
    facts, said, by_clang = shop.run(scene_of(scene, shop), **words)
    assert facts["generated"] and not said, said
    same(shop.run(scene_of(scene, shop))[2], by_clang, 4e-6)


def test_a_kernel_ends_when_shapes_move(shop: Workshop, tmp_path: Path) -> None:
    """Its constants are of one place: an animation is drawn by general code, and its record says so."""
    scene = json.loads(registry.scenes()["scene0"].path.read_text())
    moving = shop.folder / "moving.json"
    scene["shapes"][0]["path"] = {"type": "line", "to": [0.5, 1, 0], "period": 1}
    moving.write_text(json.dumps(scene))
    still, _, there = shop.run(moving)
    assert still["generated"], still
    words = ("--frames", "31", "--first-frame", "30")
    facts, said, picture = shop.run(moving, *words)
    assert not facts["generated"] and "the shapes move" in facts["reason"] and not said
    cache = tmp_path / "cache"
    asked = shop.script("asked", f"touch {tmp_path}/asked; exit 1")
    facts, said, _ = shop.run(moving, *words, STEPWISE_CC=str(asked), STEPWISE_CACHE=str(cache))
    assert "the shapes move" in facts["reason"] and not said and facts["compile_ns"] == 0
    assert not cache.exists() and not (tmp_path / "asked").exists(), "none is compiled to be dropped"
    same(picture, shop.run(moving, *words, STEPWISE_CC="none")[2])
    assert (picture["id"] != there["id"]).any()


def test_a_crowd_has_the_general_code(shop: Workshop) -> None:
    """From 32 shapes on a scene has a BVH, and no kernel."""
    facts, said, _ = shop.run("spheres40")
    assert not facts["generated"] and "32 shapes or more" in facts["reason"]
    assert not said


@needs_sixteen
def test_eight_lanes(shop: Workshop) -> None:
    """The kernel of 16 lanes, emulated where the CPU has none (emulated.py), against that of eight."""
    # an emulated build's -O0 takes gcc four times as long, of a kernel
    compiler = shop.compiler if TRUE else shop.script("quick", f'exec {shop.compiler} "$@" -O1')
    # and on a busy machine longer than a kernel's usual limit of 60 s: then the picture is the general code's
    patient = {"STEPWISE_CC": str(compiler), "STEPWISE_CC_SECONDS": "270"}
    wide, said, a = shop.run("scene0", program=sixteen(PHASE), seconds=300, **patient)
    assert wide["generated"], said
    narrow, said, b = shop.run("scene0", seconds=300, STEPWISE_ISA_LIMIT="avx2", **patient)
    assert narrow["generated"], said
    assert wide["hash"] != narrow["hash"]
    same(a, b)


def test_hash_is_the_scenes(shop: Workshop, tmp_path: Path) -> None:
    """A length changes it; camera, light and the limits that a sweep varies do not."""
    first, _, _ = shop.run("scene0")
    scene = json.loads(registry.scenes()["scene0"].path.read_text())
    scene["camera"]["position"] = [0.5, 0.25, -1]
    scene["light"]["position"] = [3, 90, 2]
    moved = tmp_path / "moved.json"
    moved.write_text(json.dumps(scene))
    facts, _, picture = shop.run(moved, "--max-steps", "2000", "--hit-distance", "2e-6")
    assert facts["cached"] and facts["hash"] == first["hash"]
    _, _, general = shop.run(moved, "--max-steps", "2000", "--hit-distance", "2e-6", STEPWISE_CC="none")
    same(general, picture, 4e-6)
    scene["shapes"][2]["radius"] = 2.75
    moved.write_text(json.dumps(scene))
    failing = shop.script("failing", "echo 'x.c:1: error: no such luck' >&2; exit 1")
    facts, said, _ = shop.run(moved, STEPWISE_CC=str(failing))
    assert not facts["generated"]
    assert "no such luck" in facts["reason"]
    assert len(said.splitlines()) == 1 and "no such luck" in said


TRAP = """
#include <stddef.h>
#include <stdlib.h>
static int tiles(const void *job) { return job ? 1 : 0; }
static void tile(const void *job, int number, void *own) { abort(); }
// struct scene_kernel of kernel.h
const struct {
    const char *tag, *compiler;
    size_t scratch_size;
    int (*tiles)(const void *);
    void (*tile)(const void *, int, void *);
} stepwise_kernel = {KERNEL_TAG, "trap", 1, tiles, tile};
"""


def trapped(shop: Workshop, folder: Path) -> dict[str, str]:
    """The environment in which the kernel, once it draws, ends the program."""
    (folder / "trap.c").write_text(TRAP)
    compiler = shop.script(
        "trap",
        f"""for i in "$@"; do case "$i" in -DKERNEL_TAG=*) tag="$i";; *.so) out="$i";; esac; done
        gcc -shared -fPIC "$tag" "{folder}/trap.c" -o "$out" """,
    )
    return {"STEPWISE_CC": str(compiler), "STEPWISE_CACHE": str(folder / "cache")}


def from_inside(folder: Path) -> Path:
    """scene0 from within its sphere: a kernel is made for it, and none draws it."""
    scene = json.loads(registry.scenes()["scene0"].path.read_text())
    scene["camera"] = scene["camera"] | {"position": [0, 0, 20], "look_at": [0, 0, 30]}
    path = folder / "inside.json"
    path.write_text(json.dumps(scene))
    return path


def test_a_camera_within_a_shape_is_drawn_by_opt9s_code(shop: Workshop, tmp_path: Path) -> None:
    """There is a kernel, of the scene; but its frame is marched, which a kernel is not made for."""
    inside = from_inside(tmp_path)
    facts, _, picture = shop.run(inside)
    assert facts["generated"]
    trap = trapped(shop, tmp_path)
    facts, said, other = shop.run(inside, **trap)
    assert facts["generated"] and not said, "the trap was loaded and not drawn by"
    same(other, picture)
    drawn = subprocess.run(shop.command("scene0"), env=shop.environment(trap), capture_output=True)
    assert drawn.returncode == -signal.SIGABRT, "from outside the kernel draws"
    done = subprocess.run(
        [build("opt9_convex"), inside, *SIZE, "--aov", "-o", tmp_path / "opt9.exr"], capture_output=True
    )
    assert done.returncode == 0, done.stderr
    opt9 = images.read(tmp_path / "opt9.exr")
    assert opt9.keys() == picture.keys() and (opt9["id"] >= 0).any()
    for name in opt9:
        assert np.array_equal(opt9[name].view(np.uint32), picture[name].view(np.uint32)), name


def test_another_compiler_of_the_same_name_makes_its_own_kernel(shop: Workshop, tmp_path: Path) -> None:
    """It is told by its file: a copy in its place, one byte more of it, a nanosecond later."""
    inside, trap = from_inside(tmp_path), trapped(shop, tmp_path)
    compiler = Path(trap["STEPWISE_CC"])
    stamp = 10**18
    os.utime(compiler, ns=(stamp, stamp))
    hashes = {shop.run(inside, **trap)[0]["hash"]}
    assert shop.run(inside, **trap)[0]["cached"]
    for change in ("copy", "longer", "later"):
        if change == "copy":
            os.replace(shutil.copy2(compiler, tmp_path / "copy"), compiler)
        elif change == "longer":
            compiler.write_text(compiler.read_text() + "\n")
        stamp += change == "later"
        os.utime(compiler, ns=(stamp, stamp))
        facts, said, _ = shop.run(inside, **trap)
        assert facts["generated"] and not facts["cached"] and not said, change
        assert facts["hash"] not in hashes, change
        hashes.add(facts["hash"])


# A compiler that leaves something else under the object's name, made by a command.
LEAVES = 'while [ "$1" != -o ]; do shift; done; {} "$2"'


@pytest.mark.parametrize(
    "what",
    [
        "missing",
        "silent",
        "late word",
        "idle",
        "endless",
        "pipe",
        "folder",
        "a folder",
        "hanging",
        "no number",
        "path",
        "file",
        "unwritable",
        "no folder",
    ],
)
def test_falls_back_and_says_so(what: str, shop: Workshop, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    changes = {
        "missing": ({"STEPWISE_CC": "/nowhere/cc"}, "there is no compiler"),
        "silent": ({"STEPWISE_CC": str(shop.script("silent", "exit 1"))}, "failed"),
        "late word": (
            {"STEPWISE_CC": str(shop.script("late", "echo; echo virtual memory exhausted; exit 1"))},
            "failed: virtual memory exhausted",
        ),
        "idle": ({"STEPWISE_CC": str(shop.script("idle", "exit 0"))}, "wrote no object"),
        "endless": (
            {"STEPWISE_CC": str(shop.script("endless", LEAVES.format("ln -s /dev/zero")))},
            "no object",
        ),
        "pipe": ({"STEPWISE_CC": str(shop.script("pipe", LEAVES.format("mkfifo")))}, "no object"),
        "folder": ({"STEPWISE_CC": str(shop.script("folder", LEAVES.format("mkdir")))}, "no object"),
        "a folder": ({"STEPWISE_CC": str(tmp_path)}, "there is no compiler"),
        "hanging": (
            {"STEPWISE_CC": str(shop.script("hanging", "sleep 60")), "STEPWISE_CC_SECONDS": "0.2"},
            "time limit",
        ),
        "no number": ({"STEPWISE_CC_SECONDS": "1 h"}, "STEPWISE_CC_SECONDS is 1 h: a number above 0"),
        "path": ({"STEPWISE_CC": "", "CC": "", "PATH": str(tmp_path / "empty")}, "on PATH"),
        "file": ({"STEPWISE_CACHE": str(tmp_path / "file")}, "no folder"),
        "unwritable": ({"STEPWISE_CACHE": "/proc/kernels"}, "cannot be made"),
        "no folder": ({"STEPWISE_CACHE": "", "XDG_CACHE_HOME": "", "HOME": ""}, "STEPWISE_CACHE"),
    }[what]
    fresh = {"STEPWISE_CACHE": str(tmp_path / "cache")} | changes[0]
    facts, said, picture = shop.run("two_spheres", **fresh)
    assert not facts["generated"] and facts["hash"] is None
    assert changes[1] in facts["reason"]
    assert len(said.splitlines()) == 1 and facts["reason"].removeprefix("general: ") in said
    _, _, general = shop.run("two_spheres", STEPWISE_CC="none")
    same(general, picture)
    left = [path for path in (tmp_path / "cache").glob(".*")] if (tmp_path / "cache").exists() else []
    assert not left


def test_a_mandelbox_is_marched_by_the_general_code(shop: Workshop) -> None:
    facts, said, _ = shop.run("mandelbox")
    assert not facts["generated"] and facts["hash"] is None and not said
    assert facts["reason"] == "general: the scene is marched: no kernel is generated for that"


def test_a_reason_that_is_no_utf8_is_recorded(shop: Workshop, tmp_path: Path) -> None:
    """JSON is: a byte that is not ASCII is a question mark in the record, and itself in the line."""
    environment = {"STEPWISE_CC": os.fsdecode(b"/nowhere/k\xe4fig/cc"), "STEPWISE_CACHE": str(tmp_path)}
    done = subprocess.run(shop.command("two_spheres"), env=shop.environment(environment), capture_output=True)
    assert done.returncode == 0 and b"/nowhere/k\xe4fig/cc" in done.stderr
    assert facts_of(done.stdout)["reason"] == "general: there is no compiler /nowhere/k?fig/cc (STEPWISE_CC)"


def test_a_folder_whose_name_looks_like_an_option(shop: Workshop, tmp_path: Path) -> None:
    for _ in range(2):
        environment = shop.environment({"STEPWISE_CACHE": "-kernels"})
        done = subprocess.run(shop.command("two_spheres"), env=environment, cwd=tmp_path, capture_output=True)
        assert done.returncode == 0 and facts_of(done.stdout)["generated"], done.stderr
    assert len(list((tmp_path / "-kernels").glob("*.so"))) == 1


@pytest.mark.parametrize(
    "what", ["cut", "bit", "other", "empty", "open", "namesake", "longer", "no source", "twin", "waits"]
)
def test_damaged_object_is_made_anew(what: str, shop: Workshop, tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    facts, _, picture = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert facts["generated"]
    kernel = folder / f"{facts['hash']}.so"
    whole = kernel.read_bytes()
    kept = kernel.with_suffix(".c")
    source = kept.read_bytes()
    if what == "cut":
        kernel.write_bytes(whole[: len(whole) // 2])
    elif what == "bit":
        kernel.write_bytes(whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:])
    elif what == "other":  # sound, but of another scene
        other, _, _ = shop.run("scene0", STEPWISE_CACHE=str(folder))
        shutil.copy(folder / f"{other['hash']}.so", kernel)
    elif what == "empty":
        kernel.write_bytes(b"")
    elif what == "namesake":  # sound and of this name, but made of another source that shares the hash
        kept.write_bytes(source.replace(b"SHAPES 2", b"SHAPES 3"))
        assert kept.read_bytes() != source
    elif what == "longer":
        kept.write_bytes(source + b"int more;")
    elif what == "no source":
        kept.unlink()
    elif what == "waits":  # whoever reads it would wait for its writer
        for file in (kernel, kept):
            file.unlink()
            os.mkfifo(file)
    elif what == "twin":  # sound and of this name, sealed for another source, and this one's beside it
        kernel.write_bytes(whole[:-16] + bytes(8) + whole[-8:])
    else:  # a folder that others may write to is not trusted
        folder.chmod(0o777)
    again, said, other_picture = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    if what == "open":
        assert not again["generated"] and "open to others" in said
        return
    assert again["generated"] and not again["cached"] and again["compile_ns"] > 0
    same(picture, other_picture)
    assert kernel.read_bytes() == whole and kept.read_bytes() == source


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to another user")
@pytest.mark.parametrize("what", ["folder", "link to it", "kernel"])
def test_what_is_another_users_is_not_trusted(what: str, shop: Workshop, tmp_path: Path) -> None:
    """A folder, and a link to one, is refused; a kernel in one's own is made anew."""
    folder, link = tmp_path / "cache", tmp_path / "link"
    facts, _, picture = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    kernel = folder / f"{facts['hash']}.so"
    link.symlink_to(folder)
    os.chown(kernel if what == "kernel" else folder, 65534, 65534)
    asked = link if what == "link to it" else folder
    again, said, other_picture = shop.run("two_spheres", STEPWISE_CACHE=str(asked))
    if what == "kernel":
        assert again["generated"] and not again["cached"] and kernel.stat().st_uid == 0
        same(picture, other_picture)
    else:
        assert not again["generated"] and "another user's: a folder of one's own is required" in said


def test_nothing_is_written_through_a_link(shop: Workshop, tmp_path: Path) -> None:
    """Where a kernel and its source should be, there are links to a file elsewhere and to none."""
    folder, precious = tmp_path / "cache", tmp_path / "precious"
    facts, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    kernel, source = (folder / f"{facts['hash']}.{ending}" for ending in ("so", "c"))
    precious.write_text("kept")
    for path, target in ((kernel, precious), (source, tmp_path / "none")):
        path.unlink()
        path.symlink_to(target)
    again, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert again["generated"] and not again["cached"] and not said
    assert precious.read_text() == "kept" and not (tmp_path / "none").exists()
    assert not kernel.is_symlink() and not source.is_symlink()


def test_two_at_once(shop: Workshop, tmp_path: Path) -> None:
    environment = shop.environment({"STEPWISE_CACHE": str(tmp_path / "cache")})
    both = [
        subprocess.Popen(
            shop.command("two_spheres"), env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for _ in range(2)
    ]
    for one in both:
        out, said = one.communicate(timeout=90)
        assert one.returncode == 0 and not said
        assert facts_of(out)["generated"]
    assert len(list((tmp_path / "cache").glob("*.so"))) == 1
    assert not list((tmp_path / "cache").glob(".*"))


def test_copies_wider_than_their_cells_have_the_general_code(shop: Workshop, tmp_path: Path) -> None:
    """They are marched."""
    scene = json.loads(registry.scenes()["cubes"].path.read_text())
    scene["shapes"][0]["repeat"] = [2.5, 0, 0]
    wide = tmp_path / "wide.json"
    wide.write_text(json.dumps(scene))
    facts, said, _ = shop.run(wide)
    assert not facts["generated"] and "marched" in facts["reason"] and not said


def test_read_only_cache_serves_what_it_has(shop: Workshop, tmp_path: Path) -> None:
    """Who may not write there still has the kernels that are there."""
    folder = tmp_path / "cache"
    facts, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    folder.chmod(0o500)
    again, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert again["cached"] and again["hash"] == facts["hash"] and not said


def test_leftovers_of_killed_processes_go(shop: Workshop, tmp_path: Path) -> None:
    """Of an hour ago and older: younger ones may be of a process that compiles."""
    folder = tmp_path / "cache"
    folder.mkdir(0o700)
    old, young, other = (folder / n for n in (".00ff-7.so", ".00ff-8.c.log", ".keep"))
    for path in (old, young, other):
        path.write_text("")
    for path in (old, other):
        os.utime(path, (1e9, 1e9))
    facts, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert facts["generated"]
    assert not old.exists() and young.exists() and other.exists()


def test_unused_kernels_go(shop: Workshop, tmp_path: Path) -> None:
    """When one is made: of 30 days, and of more than 1,000 files the longest unused; none of this hour."""
    folder = tmp_path / "cache"
    folder.mkdir(0o700)
    day = 24 * 3600.0

    def put(number: int, days: float, ending: str = "so") -> Path:
        path = folder / f"{number:016x}.{ending}"
        path.write_text("")
        os.utime(path, (time.time() - days * day,) * 2)
        return path

    first, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    own = [folder / f"{first['hash']}.{ending}" for ending in ("so", "c")]
    for path in own:
        os.utime(path, (1e9, 1e9))
    again, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert again["cached"], "which is a use of it"
    stale = [put(i, 31, ending) for i, ending in enumerate(("so", "c"), 1)]
    foreign = [folder / name for name in ("notes.c", "0123456789abcdef.txt", "0123456789abcdef0.so")]
    for path in foreign:
        path.write_text("")
        os.utime(path, (1e9, 1e9))
    made, _, _ = shop.run("scene0", STEPWISE_CACHE=str(folder))
    assert made["generated"] and not made["cached"]
    assert not any(path.exists() for path in stale)
    assert all(path.exists() for path in [*own, *foreign])
    own += [folder / f"{made['hash']}.{ending}" for ending in ("so", "c")]
    own[-2].unlink()
    older = [put(1000 + i, 2) for i in range(100)]
    newer = [put(2000 + i, 1) for i in range(890)]
    new = [put(5000 + i, 0.01) for i in range(100)]  # 14 minutes
    shop.run("scene0", STEPWISE_CACHE=str(folder))
    assert all(path.exists() for path in [*own, *foreign, *newer, *new])
    assert sum(path.exists() for path in older) == 1000 - (len(own) - 1) - len(newer) - len(new)
    many = [put(1000 + i, 0.02) for i in range(1100)]
    own[-2].unlink()
    shop.run("scene0", STEPWISE_CACHE=str(folder))
    assert all(path.exists() for path in [*own, *many]), "none of this hour, however many"


def test_killed_compiler_is_said(shop: Workshop, tmp_path: Path) -> None:
    crashing = shop.script("crashing", "kill -SEGV $$")
    fresh = {"STEPWISE_CACHE": str(tmp_path / "cache"), "STEPWISE_CC": str(crashing)}
    facts, said, _ = shop.run("two_spheres", **fresh)
    assert not facts["generated"] and "was killed: Segmentation fault" in said
    assert not list((tmp_path / "cache").iterdir())


def test_whoever_starts_it_may_ignore_the_ends_of_its_children(shop: Workshop, tmp_path: Path) -> None:
    """SIG_IGN for SIGCHLD is inherited, and would have the system keep the compiler's status to itself."""
    environment = shop.environment({"STEPWISE_CACHE": str(tmp_path / "cache")})
    ignoring = (
        "import os, sys; from signal import *; signal(SIGCHLD, SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
    )
    words = [sys.executable, "-c", ignoring, *shop.command("two_spheres")]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=90)
    assert done.returncode == 0 and facts_of(done.stdout)["generated"], done.stderr


def living(group: int) -> list[str]:
    """Processes of that group that run or sleep."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended
            state, _, its_group, *_ = path.read_text().rpartition(")")[2].split()
            found += [path.parent.name] * (int(its_group) == group and state not in "ZX")
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_what_ends_it_ends_its_compiler(number: signal.Signals, shop: Workshop, tmp_path: Path) -> None:
    """The compiler has a process group of its own; neither it nor a file is left behind."""
    slow = shop.script(
        f"slow{number}", f'echo $$ > "{tmp_path}/pid.new"; mv "{tmp_path}/pid.new" "{tmp_path}/pid"\nsleep 60'
    )
    folder, told = tmp_path / "cache", tmp_path / "pid"
    environment = shop.environment({"STEPWISE_CACHE": str(folder), "STEPWISE_CC": str(slow)})
    with subprocess.Popen(
        shop.command("two_spheres"),
        env=environment,
        stdout=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(
            number, signal.SIG_DFL
        ),  # a shell's & has it ignored, and that stays
    ) as renderer:
        for _ in range(600):
            if told.exists():
                break
            time.sleep(0.05)
        assert list(folder.iterdir()), "it has begun"
        renderer.send_signal(number)
        assert renderer.wait(timeout=20) == -number
    assert not list(folder.iterdir())
    group = int(told.read_text())
    for _ in range(200):
        if not living(group):
            break
        time.sleep(0.05)  # what was killed, on a busy CPU; left alone, `sleep` takes a minute
    assert not living(group)


def test_a_kernel_whose_source_cannot_be_kept_is_used(shop: Workshop, tmp_path: Path) -> None:
    """Without HASH.c, which tells of what source HASH.so is, the next launch makes it anew."""
    folder = tmp_path / "cache"
    facts, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    kernel, source = (folder / f"{facts['hash']}.{ending}" for ending in ("so", "c"))
    kernel.unlink()
    source.unlink()
    source.mkdir()
    again, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert again["generated"] and not again["cached"] and not said
    assert kernel.exists() and not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_compiler_that_does_not_know_how_gcc_copies(shop: Workshop, tmp_path: Path) -> None:
    """clang and gcc before 12 refuse the words for it: asked again without them, and for nothing else."""
    asked = tmp_path / "asked"
    other = shop.script(
        "other",
        f"""echo asked >> '{asked}'
        for i in "$@"; do case "$i" in -mmove-max=*|-mmem*-strategy=*)
            echo "error: unknown argument: '$i'"; exit 1;; esac; done
        exec '{shop.compiler}' "$@\"""",
    )
    fresh = {"STEPWISE_CACHE": str(tmp_path / "cache"), "STEPWISE_CC": str(other)}
    facts, said, _ = shop.run("two_spheres", **fresh)
    assert facts["generated"] and not said
    told = registry.variant_here(registry.phases()[PHASE]).flags
    assert asked.read_text().split() == ["asked"] * (1 + ("-mmove-max=" in told))
    broken = shop.script("broken", f"echo asked >> '{asked}'; echo 'error: no space'; exit 1")
    asked.unlink()
    facts, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(tmp_path / "new"), STEPWISE_CC=str(broken))
    assert not facts["generated"] and "no space" in said and asked.read_text().split() == ["asked"]


@pytest.mark.parametrize(
    ("read", "compiles"),
    [
        ("KNOWN(p)->model.march.bounds_radius", True),
        ("KNOWN(p)->primitives[0].bound", True),
        ("KNOWN(p)->model.march.max_steps", False),
        ("KNOWN(p)->model.march.hit_distance", False),
        ("KNOWN(p)->primitives[0].clearance", False),
        ("KNOWN(p)->primitives[0].bvh_rank", False),
        ("KNOWN(p)->primitives[0].radius_sq", False),
    ],
)
def test_what_no_kernel_knows_cannot_be_read_as_if_it_did(read: str, compiles: bool, tmp_path: Path) -> None:
    """What a generated scene leaves out would be 0 there: it is no member of what KNOWN gives.

    It is one of what the general code reads.
    """
    folder = registry.phases()[PHASE].file("types/known_scene.h").parents[1]
    include = ["-I", registry.ROOT / "common", "-iquote", folder]
    source = tmp_path / "known.c"

    def compiled(expression: str) -> subprocess.CompletedProcess[str]:
        function = f"double f(const struct prepared *p) {{ return {expression}; }}\n"
        source.write_text(f'#include "types/known_scene.h"\n{function}')
        command = ["gcc", "-std=c11", "-fsyntax-only", *include, source]
        return subprocess.run(command, capture_output=True, text=True)

    done = compiled(read)
    assert (done.returncode == 0) == compiles and ("no member" in done.stderr) != compiles, done.stderr
    general = read.replace("KNOWN(p)->primitives", "p->primitives" if compiles else "p->extras")
    done = compiled(general.replace("KNOWN(p)->", "p->"))
    assert done.returncode == 0, done.stderr
