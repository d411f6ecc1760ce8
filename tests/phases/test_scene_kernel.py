"""opt10_scene: kernels generated for a scene against its general ones, their cache, and no compiler."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import phase_pictures
import pytest
from phase_pictures import check_bits
from processes import children, ends, only_warned
from programs import TRUE, made_in, needs_sixteen, sixteen

from conformance.feature_scenes import FEATURES
from study.core import registry
from study.core.build import build
from study.pictures import images

PHASE = "opt10_scene"
SIZE = (112, 61)  # rows past the caches; opt9_convex has odd ones in opt9_pictures

pytestmark = [
    pytest.mark.slow,
    phase_pictures.needs(PHASE),
    pytest.mark.skipif(not shutil.which("gcc"), reason="gcc would compile kernels"),
]


def facts_of(output: str | bytes) -> dict:
    """What a record says of its kernel."""
    record = json.loads(output)
    facts = {key: record[f"kernel_{key}"] for key in ("hash", "compile_ns")} | {"reason": record["kernel"]}
    facts["generated"] = record["kernel"] == "generated"
    return facts | {"cached": facts["generated"] and facts["compile_ns"] == 0}


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
        self.less = self.script("less", 'exec gcc "$@" -Og')  # compiles in half the time

    def script(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text("#!/bin/sh\n" + text)
        path.chmod(0o755)
        return path

    def words(self, **changes: str) -> dict[str, str]:
        return {"STEPWISE_CC": str(self.compiler), "STEPWISE_CACHE": str(self.cache)} | changes

    def start(self, scene: str, **how) -> subprocess.Popen:
        words = [build(PHASE), registry.scenes()[scene].path, "-w", SIZE[0], "-n", SIZE[1], "--json"]
        return subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, **how)

    def run(
        self, scene: str | Path | dict, *more: str, program: Path | None = None, size=SIZE, **changes: str
    ) -> tuple[dict, str, dict[str, np.ndarray]]:
        """What the record says of the kernel, standard error, the picture."""
        words = self.words(**changes)
        done = phase_pictures.render(program or PHASE, scene, self.folder, *more, size=size, **words)
        assert done.returncode == 0, done.stderr
        return facts_of(done.stdout), done.stderr, images.read(self.folder / "picture.exr")


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("kernels"))


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray], within: float = 0.0, where: str = "") -> None:
    for name, values in a.items():
        allowed = within if name in "RGB" else 0.0
        with np.errstate(invalid="ignore"):
            apart = np.abs(np.where(values == b[name], 0, values - b[name]))
        assert (apart <= allowed).all(), (where, name, np.nanmax(apart))


def data_of(name: str) -> dict:
    return json.loads((registry.scenes() | registry.groups())[name].path.read_text())


TWO_MATERIALS = data_of("lattice")  # of copies, whose bundles meet one, or both
TWO_MATERIALS["materials"]["red"] = {"color": [0.7, 0.1, 0.1], "reflectivity": 0, "shininess": 20}
TWO_MATERIALS["shapes"][1]["material"] = "red"
# More than are written out and fewer than a crowd.
TWENTY = data_of("spheres40") | {"shapes": data_of("spheres40")["shapes"][:20]}
GROUPS = list(registry.groups())
SCENES = {"two materials": TWO_MATERIALS, "twenty": TWENTY} | {name: data_of(name) for name in GROUPS}


# A whole shininess is a row of products in a kernel, else a logarithm and an exponential: 15 · 2^-24 apart.
@pytest.mark.parametrize(
    "scene", ["scene0", "twenty", "mandelbulb", "mirrors_facing_6", "two materials", *GROUPS]
)
def test_kernel_and_general_code_agree(scene: str, shop: Workshop) -> None:
    data = SCENES.get(scene, scene)
    words = {} if scene in ("scene0", "mandelbulb") else {"STEPWISE_CC": str(shop.less)}
    facts, said, generated = shop.run(data, **words)
    assert facts["generated"], facts
    assert not said and facts["compile_ns"] > 0 and not facts["cached"]
    general, said, picture = shop.run(data, STEPWISE_CC="none")
    assert not general["generated"] and "none" in general["reason"]
    same(picture, generated, 4e-6)
    again, _, picture = shop.run(data, "--threads", "2", **words)
    assert again["cached"] and again["compile_ns"] == 0 and again["hash"] == facts["hash"]
    same(picture, generated)


def test_kernels_of_features(shop: Workshop, tmp_path: Path) -> None:
    """Every ninth of conformance's scenes (STEPWISE_EVERY_KERNEL=1: all, two minutes) is drawn by its kernel
    as by the general code, which conformance judges.
    """
    words = {"STEPWISE_CC": str(shop.less), "STEPWISE_CACHE": str(tmp_path / "cache")}
    marched = {name for name in FEATURES if "mandelbox" in str(FEATURES[name])}  # which have no kernel
    names = [name for name in FEATURES if name not in marched]
    names = names[:: 1 if os.environ.get("STEPWISE_EVERY_KERNEL") else 9]
    generated = 0
    for name in names:
        facts, said, by_kernel = shop.run(name, size=(48, 27), **words)
        assert only_warned(said), (name, said)
        if facts["generated"]:
            generated += 1
            _, _, general = shop.run(name, size=(48, 27), STEPWISE_CC="none")
            same(general, by_kernel, 4e-6, name)
    assert generated >= 0.75 * len(names), f"{generated} of {len(names)} scenes have a kernel"


@pytest.mark.parametrize("scene", ["scene0", "mandelbulb", "csg"])
def test_a_kernel_under_sanitizers_draws_the_same_bits(scene: str, shop: Workshop, tmp_path: Path) -> None:
    """The program hands its own sanitizers on to its kernels: an address out of bounds or undefined behaviour
    would end it."""
    words = {"STEPWISE_CC": "gcc", "STEPWISE_CC_SECONDS": "270", "STEPWISE_CACHE": str(tmp_path / "cache")}
    program = made_in("asan", PHASE, "SANITIZE=1")
    facts, said, sanitized = shop.run(SCENES.get(scene, scene), program=program, **words)
    assert facts["generated"] and not said
    kernel = next((tmp_path / "cache").glob("*.so")).read_bytes()
    assert b"__asan_" in kernel and b"__ubsan_" in kernel, "the kernel was sanitized"
    same(shop.run(SCENES.get(scene, scene))[2], sanitized)


@pytest.mark.skipif(not shutil.which("clang"), reason="clang would compile kernels")
def test_clang_makes_kernels_too(shop: Workshop, tmp_path: Path) -> None:
    words = {"STEPWISE_CC": "clang", "STEPWISE_CACHE": str(tmp_path / "cache")}
    facts, said, by_clang = shop.run("scene0", **words)
    assert facts["generated"] and not said, said
    same(shop.run("scene0")[2], by_clang, 4e-6)


def test_a_kernel_ends_when_shapes_move(shop: Workshop, tmp_path: Path) -> None:
    """Its constants are of one place: general code draws an animation, and no kernel is compiled for it."""
    moving = data_of("scene0")
    moving["shapes"][0]["path"] = {"type": "line", "to": [0.5, 1, 0], "period": 1}
    words = ("--frames", "31", "--first-frame", "30")
    facts, said, picture = shop.run(moving, *words, STEPWISE_CACHE=str(tmp_path / "cache"))
    assert not facts["generated"] and facts["compile_ns"] == 0 and not said
    assert not (tmp_path / "cache").exists()
    same(picture, shop.run(moving, *words, STEPWISE_CC="none")[2])


@needs_sixteen
def test_eight_lanes(shop: Workshop) -> None:
    """The kernel of 16 lanes, emulated where the CPU has none (programs.py), against that of eight."""
    # an emulated build's -O0 takes gcc four times as long, of a kernel
    compiler = shop.compiler if TRUE else shop.script("quick", f'exec {shop.compiler} "$@" -O1')
    # and on a busy machine longer than a kernel's usual limit of 60 s: then the picture is the general code's
    patient = {"STEPWISE_CC": str(compiler), "STEPWISE_CC_SECONDS": "270"}
    wide, said, a = shop.run("scene0", program=sixteen(PHASE), **patient)
    assert wide["generated"], said
    narrow, said, b = shop.run("scene0", STEPWISE_ISA_LIMIT="avx2", **patient)
    assert narrow["generated"], said
    assert wide["hash"] != narrow["hash"]
    same(a, b)


def test_hash_is_the_scenes(shop: Workshop) -> None:
    """A length changes it; camera, light and the limits that a sweep varies do not."""
    less = {"STEPWISE_CC": str(shop.less)}
    first, _, _ = shop.run("scene0", **less)
    scene = data_of("scene0")
    scene["camera"]["position"] = [0.5, 0.25, -1]
    scene["light"]["position"] = [3, 90, 2]
    limits = ("--max-steps", "2000", "--hit-distance", "2e-6")
    facts, _, picture = shop.run(scene, *limits, **less)
    assert facts["cached"] and facts["hash"] == first["hash"]
    same(shop.run(scene, *limits, STEPWISE_CC="none")[2], picture, 4e-6)
    scene["shapes"][2]["radius"] = 2.75
    assert shop.run(scene, **less)[0]["hash"] != first["hash"]


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
    size_t frame_size;
    int (*begin)(const void *);
} stepwise_kernel = {KERNEL_TAG, "trap", 1, tiles, tile, 0, NULL};
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


def test_a_camera_within_a_shape_is_drawn_by_opt9s_code(shop: Workshop, tmp_path: Path) -> None:
    """There is a kernel, of the scene; but its frame is marched, which a kernel is not made for."""
    inside = data_of("scene0")
    inside["camera"] |= {"position": [0, 0, 20], "look_at": [0, 0, 30]}
    facts, _, picture = shop.run(inside)
    assert facts["generated"]
    trap = trapped(shop, tmp_path)
    facts, said, other = shop.run(inside, **trap)
    assert facts["generated"] and only_warned(said), "the trap was loaded and not drawn by"
    same(other, picture)
    drawn = phase_pictures.render(PHASE, "scene0", tmp_path, size=SIZE, **shop.words(**trap))
    assert drawn.returncode == -signal.SIGABRT, "from outside the kernel draws"
    opt9 = phase_pictures.picture("opt9_convex", inside, tmp_path, size=SIZE)
    assert (opt9["id"] >= 0).any()
    check_bits(opt9, picture)


@pytest.mark.parametrize("scene", ["spheres40", "mandelbox"])
def test_scenes_of_many_shapes_and_marched_ones_have_the_general_code(scene: str, shop: Workshop) -> None:
    facts, said, _ = shop.run(scene)
    assert not facts["generated"] and facts["hash"] is None and not said


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("missing", {"STEPWISE_CC": "/nowhere/cc"}),
        ("failing", {"STEPWISE_CC": "exit 1"}),
        ("idle", {"STEPWISE_CC": "exit 0"}),
        ("hanging", {"STEPWISE_CC": "sleep 60", "STEPWISE_CC_SECONDS": "0.2"}),
        ("no folder", {"STEPWISE_CACHE": "/proc/kernels"}),
    ],
)
def test_falls_back_and_says_so(what: str, changes: dict[str, str], shop: Workshop, tmp_path: Path) -> None:
    fresh = {"STEPWISE_CACHE": str(tmp_path / "cache")} | changes
    if what not in ("missing", "no folder"):
        fresh["STEPWISE_CC"] = str(shop.script(what, changes["STEPWISE_CC"]))
    facts, said, picture = shop.run("two_spheres", **fresh)
    assert not facts["generated"] and facts["hash"] is None
    assert len(said.splitlines()) == 1 and facts["reason"].removeprefix("general: ") in said
    same(shop.run("two_spheres", STEPWISE_CC="none")[2], picture)
    assert not list(tmp_path.glob("cache/.*"))


@pytest.mark.parametrize(
    ("there", "said", "called"),
    [
        (("gcc", "cc"), {}, "gcc"),
        (("cc",), {}, "cc"),
        (("cc", "my"), {"CC": "my"}, "my"),
        (("cc", "my", "wrapper"), {"CC": "wrapper my"}, "my"),
        (("gcc", "my", "wrapper"), {"STEPWISE_CC": "wrapper my"}, "my"),
    ],
)
def test_the_compiler_of_the_program_makes_its_kernel(
    there: tuple[str, ...], said: dict[str, str], called: str, shop: Workshop, tmp_path: Path
) -> None:
    """Not `cc`, which may be another; CC is for where it is not. Each says its name, and fails."""
    (tmp_path / "bin").mkdir()
    for name in there:
        body = 'exec "$@"' if name == "wrapper" else f"echo error: called {name}.; exit 1"
        shop.script(f"my {name}", body).rename(tmp_path / "bin" / name)
    words = {"CC": "", "STEPWISE_CC": ""} | said
    words |= {"PATH": str(tmp_path / "bin"), "STEPWISE_CACHE": str(tmp_path / "cache")}
    facts, _, _ = shop.run("two_spheres", **words)
    assert not facts["generated"] and f"error: called {called}." in facts["reason"]


@pytest.mark.slow
def test_a_compiler_of_several_words_makes_a_kernel(shop: Workshop, tmp_path: Path) -> None:
    """`ccache gcc`: each word's file is in the kernel's name."""
    hashes = []
    for more in ("wrapper", "other wrapper"):
        path = shop.script(more.replace(" ", "-"), 'exec "$@"')
        words = {"STEPWISE_CC": f"{path} gcc -O0", "STEPWISE_CACHE": str(tmp_path / "cache")}
        facts, said, _ = shop.run("two_spheres", **words)
        assert facts["generated"] and not said
        hashes.append(facts["hash"])
    assert len(set(hashes)) == 2


@pytest.mark.parametrize("what", ["cut", "bit", "other scene", "other source"])
def test_a_damaged_object_is_made_anew(what: str, shop: Workshop, tmp_path: Path) -> None:
    folder = {"STEPWISE_CACHE": str(tmp_path / "cache")}
    facts, _, picture = shop.run("two_spheres", **folder)
    kernel = tmp_path / "cache" / f"{facts['hash']}.so"
    whole, source = kernel.read_bytes(), kernel.with_suffix(".c")
    if what == "cut":
        kernel.write_bytes(whole[: len(whole) // 2])
    elif what == "bit":
        kernel.write_bytes(whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:])
    elif what == "other scene":
        other, _, _ = shop.run("scene0", **folder)
        shutil.copy(kernel.with_name(f"{other['hash']}.so"), kernel)
    else:  # of a source that shares the hash
        source.write_bytes(source.read_bytes().replace(b"SHAPES 2", b"SHAPES 3"))
    again, _, other_picture = shop.run("two_spheres", **folder)
    assert again["generated"] and not again["cached"]
    same(picture, other_picture)
    assert kernel.read_bytes() == whole


def test_a_folder_that_others_may_write_to_is_not_trusted(shop: Workshop, tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    facts, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(tmp_path))
    assert not facts["generated"] and str(tmp_path) in said


def test_old_kernels_and_leftovers_go(shop: Workshop, tmp_path: Path) -> None:
    """Kernels unused for 30 days, and what killed processes left an hour ago and before: younger files may
    be of a process that compiles."""
    folder = tmp_path / "cache"
    folder.mkdir(0o700)
    go = {"0" * 16 + ".so": 31, "1" * 16 + ".c": 31, ".00ff-7.so": 0.05}
    stay = {"2" * 16 + ".so": 29, "notes.c": 9999, ".00ff-8.c.log": 0, ".keep": 9999}
    for name, days in (go | stay).items():
        (folder / name).write_text("")
        os.utime(folder / name, (time.time() - days * 24 * 3600,) * 2)
    assert shop.run("two_spheres", STEPWISE_CACHE=str(folder))[0]["generated"]
    assert {name for name in go | stay if (folder / name).exists()} == set(stay)


def test_two_at_once(shop: Workshop, tmp_path: Path) -> None:
    environment = os.environ | shop.words(STEPWISE_CACHE=str(tmp_path / "cache"))
    both = [shop.start("two_spheres", env=environment) for _ in range(2)]
    for one in both:
        out, said = one.communicate(timeout=90)
        assert one.returncode == 0 and not said
        assert facts_of(out)["generated"]
    assert len(list((tmp_path / "cache").glob("*.so"))) == 1
    assert not list((tmp_path / "cache").glob(".*"))


def test_read_only_cache_serves_what_it_has(shop: Workshop, tmp_path: Path) -> None:
    """Who may not write there still has the kernels that are there."""
    folder = tmp_path / "cache"
    facts, _, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    folder.chmod(0o500)
    again, said, _ = shop.run("two_spheres", STEPWISE_CACHE=str(folder))
    assert again["cached"] and again["hash"] == facts["hash"] and not said


def test_what_ends_it_ends_its_compiler(shop: Workshop, tmp_path: Path) -> None:
    """The compiler has a process group of its own; neither it nor a file is left behind."""
    folder, told = tmp_path / "cache", tmp_path / "pid"
    slow = shop.script("slow", f'echo $$ > "{told}.new"; mv "{told}.new" "{told}"\nsleep 60')
    environment = os.environ | shop.words(STEPWISE_CACHE=str(folder), STEPWISE_CC=str(slow))

    def interruptible() -> None:  # a shell's & has it ignored, and that stays
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with shop.start("two_spheres", env=environment, preexec_fn=interruptible) as renderer:
        for _ in range(600):
            if told.exists():
                break
            time.sleep(0.05)
        assert list(folder.iterdir()), "it has begun"
        started = [int(told.read_text()), *children(int(told.read_text()))]
        renderer.send_signal(signal.SIGINT)
        assert renderer.wait(timeout=20) == -signal.SIGINT
    assert not list(folder.iterdir())
    assert all(map(ends, started))


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


@pytest.mark.parametrize(
    ("read", "compiles"),
    [
        ("model.march.bounds_radius", True),
        ("primitives[0].bound", True),
        ("model.march.max_steps", False),
    ],
)
def test_what_no_kernel_knows_cannot_be_read_as_if_it_did(read: str, compiles: bool, tmp_path: Path) -> None:
    """What a generated scene leaves out would be 0 there: it is no member of what KNOWN gives, but one of
    what the general code reads."""
    folder = registry.phases()[PHASE].file("types/known_scene.h").parents[1]
    parents = registry.phases()["opt6_wide"].path  # what opt9_convex derives from
    include = ["-I", registry.ROOT / "common", "-iquote", folder, "-iquote", parents]
    source = tmp_path / "known.c"

    def compiled(expression: str) -> subprocess.CompletedProcess[str]:
        function = f"double f(const struct prepared *p) {{ return {expression}; }}\n"
        source.write_text(f'#include "types/known_scene.h"\n{function}')
        command = ["gcc", "-std=c11", "-fsyntax-only", *include, source]
        return subprocess.run(command, capture_output=True, text=True)

    done = compiled(f"KNOWN(p)->{read}")
    assert (done.returncode == 0) == compiles and ("no member" in done.stderr) != compiles, done.stderr
    assert compiled("p->" + (read if compiles else read.replace("primitives", "extras"))).returncode == 0
