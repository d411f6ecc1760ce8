"""The program hits, beside Embree and without it."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from conformance.feature_scenes import FLOOR, scene, shape
from study.core import store
from study.core.build import build
from study.core.registry import ROOT
from study.experiments.packets import measure as packets
from study.measuring import rays as packets_rays

pytestmark = pytest.mark.slow

BASES = (Path("/usr/include"), Path("/usr/local/include"))
HEADERS = [base / f"embree{version}" / "rtcore.h" for version in (4, 3) for base in BASES]
EMBREE = pytest.mark.skipif(
    not any(h.exists() for h in HEADERS), reason="libembree-dev is not installed: nothing beside Embree"
)
BALLS = [shape("sphere", radius=0.5 + 0.2 * i, position=[1.3 * i - 2, 0.4 * i - 1, i]) for i in range(4)]
WALL = shape("plane", normal=[0, 0, -1], offset=-9)
# shapes; which of them a picture's rays meet
SCENES = {
    "both": ([WALL, *BALLS, FLOOR], {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}),
    "spheres": (BALLS, {-1.0, 0.0, 1.0, 2.0, 3.0}),
    "planes": ([FLOOR, WALL], {0.0, 1.0}),
}
COUNT = 1061  # more than a chunk of embree.c's, and no whole packet at the end


@pytest.fixture
def path(tmp_path):
    return tmp_path / "scene.json"


def rays_of(data):
    return packets_rays.camera(data, 36, 32)[:COUNT]


@EMBREE
@pytest.mark.parametrize("name", SCENES)
def test_embree_meets_what_we_meet(name, path):
    """By each of its ways, whose hits are single rays' too. The last turn of one repetition is the stream's,
    of three its packets', of four its single rays'; without streams of one single rays', of three packets'.
    """
    shapes, there = SCENES[name]
    data = scene(shapes, light={"shadows": "hard"})
    store.write_json(path, data)
    rays, hits = rays_of(data), []
    for reps in (1, 3, 4):
        record, found = packets_rays.hits(path, rays, "primary", reps=reps, beside=True)
        about = r"Embree [34]\.\d+\.\d+, packets of 16 (native|emulated)(, a build with assertions)?"
        assert re.fullmatch(about, record.embree)
        assert found.shape == (2, COUNT, 2) and set(np.unique(found[1, :, 1])) == there
        said = packets.agreement(data, "primary", rays, found)
        assert said.compared > 900 and said.other_shape <= 1 and said.dt_max < 1e-4
        assert len(record.ns) == len(record.embree16_ns) == len(record.embree1_ns) == reps
        assert len(record.embree_stream_ns) == (reps if record.embree.startswith("Embree 3") else 0)
        hits.append(found[1])
        rays[:, 6] = np.where(np.isfinite(found[0, :, 0]), found[0, :, 0], 20) + np.resize([-0.1, 0.1], COUNT)
        record, blocked = packets_rays.hits(path, rays, "shadow", reps=reps, beside=True)
        other = packets.agreement(data, "shadow", rays, blocked).other_shape
        assert other <= 1 and 50 < (blocked[1, :, 0] == -np.inf).sum() < 900
    for found in hits[:2]:
        same = found[:, 1] == hits[2][:, 1]
        assert (~same).sum() <= 1 and np.allclose(found[same, 0], hits[2][same, 0], rtol=1e-5)


def hits_with(folder: Path, flags: list[str], libraries: list[str]) -> Path:
    """The program hits with an embree.c compiled by those flags."""
    build("packets", "hits")
    words = ["gcc", "-std=c11", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *flags]
    stub, program = folder / "stub.o", folder / "hits"
    subprocess.run(
        [*words, "-Icommon", "-c", ROOT / "common/tools/embree.c", "-o", stub], check=True, cwd=ROOT
    )
    made = ROOT / "build"
    objects = [made / name for name in ("common/tools/hits.o", "packets/phase.o", "packets/variant.o")]
    for room in ("scene", "frame", "timing", "workers"):
        objects += [
            made / "common" / room / f"{path.stem}.o" for path in (ROOT / "common" / room).glob("*.c")
        ]
    found = subprocess.run(["pkg-config", "--libs", "jansson", "OpenEXR"], capture_output=True, text=True)
    libraries = [*found.stdout.split(), *libraries, "-lz", "-lpthread", "-lm"]
    subprocess.run(["gcc", *objects, stub, *libraries, "-o", program], check=True)
    return program


# What Embree 4's manual declares of a ray's questions, answered by Embree 3: arguments behind the ray, a
# structure for each kind of question, flags of another name. The rest that embree.c asks is the same.
EMBREE_4 = """
#define rtcIntersect1 three_intersect1
#define rtcIntersect16 three_intersect16
#define rtcOccluded1 three_occluded1
#define rtcOccluded16 three_occluded16
#include <embree3/rtcore.h>
#undef rtcIntersect1
#undef rtcIntersect16
#undef rtcOccluded1
#undef rtcOccluded16
#undef RTC_INTERSECT_CONTEXT_FLAG_COHERENT
enum RTCRayQueryFlags { RTC_RAY_QUERY_FLAG_INCOHERENT = 1, RTC_RAY_QUERY_FLAG_COHERENT };
struct RTCIntersectArguments { enum RTCRayQueryFlags flags; };
struct RTCOccludedArguments { enum RTCRayQueryFlags flags; };
static inline void rtcInitIntersectArguments(struct RTCIntersectArguments *a) { a->flags = 0; }
static inline void rtcInitOccludedArguments(struct RTCOccludedArguments *a) { a->flags = 0; }
static inline struct RTCIntersectContext three(enum RTCRayQueryFlags flags) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = flags == RTC_RAY_QUERY_FLAG_COHERENT;
    return context;
}
#define ASK(name, type, args) \\
    extern void name(RTCScene, struct RTCIntersectContext *, struct type *); \\
    static inline void four_##name(RTCScene s, struct type *r, struct args *a) { \\
        struct RTCIntersectContext c = three(a->flags); \\
        name(s, &c, r); \\
    }
#define ASK16(name, type, args) \\
    extern void name(const int *, RTCScene, struct RTCIntersectContext *, struct type *); \\
    static inline void four_##name(const int *v, RTCScene s, struct type *r, struct args *a) { \\
        struct RTCIntersectContext c = three(a->flags); \\
        name(v, s, &c, r); \\
    }
ASK(rtcIntersect1, RTCRayHit, RTCIntersectArguments)
ASK(rtcOccluded1, RTCRay, RTCOccludedArguments)
ASK16(rtcIntersect16, RTCRayHit16, RTCIntersectArguments)
ASK16(rtcOccluded16, RTCRay16, RTCOccludedArguments)
#define rtcIntersect1 four_rtcIntersect1
#define rtcOccluded1 four_rtcOccluded1
#define rtcIntersect16 four_rtcIntersect16
#define rtcOccluded16 four_rtcOccluded16
"""


@pytest.mark.skipif(not any(h.exists() for h in HEADERS if "embree3" in str(h)), reason="no Embree 3")
@pytest.mark.parametrize("kind", ["primary", "shadow"])
def test_by_the_declarations_of_embree_4_it_meets_the_same(kind, tmp_path, path):
    """Compiled by the other half of embree.c. Embree 4 itself was not at hand."""
    (tmp_path / "embree4").mkdir()
    (tmp_path / "embree4" / "rtcore.h").write_text(EMBREE_4)
    four = hits_with(tmp_path, ["-DWITH_EMBREE=4", f"-I{tmp_path}"], ["-lembree3"])
    data = scene(BALLS, light={"shadows": "hard"})
    store.write_json(path, data)
    rays, found = rays_of(data), []
    rays[:, 6] = 20 if kind == "shadow" else np.inf
    # 3 has streams, whose turn is the last of one repetition: of four its single rays' is.
    for program, turns in ((four, ("1", "3")), (build("packets", "hits"), ("4", "3"))):
        out = tmp_path / "hits.out"
        for reps in turns:
            words = [program, path, "--embree", "--reps", reps, *["--any"] * (kind == "shadow"), "-o", out]
            done = subprocess.run(words, input=rays.tobytes(), capture_output=True)
            record = json.loads(done.stdout)
            assert done.returncode == 0 and record["embree"].startswith("Embree "), done.stderr
            assert bool(record["embree_stream_ns"]) == (program != four), "Embree 4 has no streams"
            found.append(np.fromfile(out, "<f4").reshape(2, COUNT, 2)[1])
    assert np.array_equal(found[0], found[2]) and np.array_equal(found[1], found[3])
    assert 50 < (found[0][:, 0] == -np.inf).sum() < 1000 or kind == "primary"


@pytest.mark.parametrize("there, version", [((3,), "3"), ((4,), "4"), ((3, 4), "4"), ((), "")])
def test_the_newest_header_is_built_with(there, version, tmp_path):
    for one in there:
        (tmp_path / f"embree{one}").mkdir()
        (tmp_path / f"embree{one}" / "rtcore.h").touch()
    rule = "include common/rules.mk\nsay: ; @echo '$(EMBREE_VERSION)|$(EMBREE)'\n"
    words = ["make", "-s", "-f", "-", f"EMBREE_INCLUDE={tmp_path}", f"BUILD={tmp_path}", "say"]
    done = subprocess.run(words, input=rule, capture_output=True, text=True, cwd=ROOT)
    header = tmp_path / f"embree{version}" / "rtcore.h" if version else ""
    assert done.stdout.strip() == f"{version}|{header}", done.stderr


def test_without_embree_it_says_so(tmp_path, path):
    """embree.c as it is built where there is none."""
    program = hits_with(tmp_path, [], [])
    data = scene(BALLS, light={"shadows": "hard"})
    store.write_json(path, data)
    out = tmp_path / "hits.out"
    done = subprocess.run(
        [program, path, "--embree", "-o", out], input=rays_of(data).tobytes(), capture_output=True
    )
    record = json.loads(done.stdout)
    assert done.returncode == 0 and "libembree-dev" in record["embree"]
    assert (
        record["embree16_ns"] == record["embree1_ns"] == record["embree_stream_ns"] == []
        and len(record["ns"]) == 1
    )
    assert np.fromfile(out, "<f4").shape == (2 * COUNT,)


BAD = {
    "reps": (["--reps", "5x"], 2, b"--reps 5x: should be a whole number from 1 to 1000000"),
    "zero": (["--reps", "0"], 2, b"--reps 0: should be"),
    "option": (["--rep5"], 2, b"--rep5"),
    "part": ([], 2, b"12 bytes are left behind 3 rays: should be 28 bytes each"),
    "output": (["-o", "{}/none/hits"], 2, b"none/hits cannot be written"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line(name, path):
    words, status, said = BAD[name]
    store.write_json(path, scene(BALLS, light={"shadows": "hard"}))
    words = [word.format(path.parent) for word in words]
    rest = 12 if name == "part" else 0
    done = subprocess.run(
        [build("packets", "hits"), path, *words], input=b"\0" * (3 * 28 + rest), capture_output=True
    )
    assert done.returncode == status and done.stdout == b"" and done.stderr.count(b"\n") == 1
    assert said in done.stderr, done.stderr


def test_a_build_with_assertions_is_told(tmp_path) -> None:
    """By what its library asks of the C library; a program that links no Embree has none."""
    asserting, silent = tmp_path / "a.c", tmp_path / "b.c"
    asserting.write_text("#include <assert.h>\nint rtc(int a) { assert(a); return a; }\n")
    silent.write_text("int rtc(int a) { return a; }\n")
    (tmp_path / "main.c").write_text("int rtc(int);\nint main(int n, char **v) { (void)v; return rtc(n); }\n")
    for source, library, expected in ((asserting, "libembree3.so", True), (silent, "libembree4.so", False)):
        folder = tmp_path / library
        folder.mkdir()
        call = ("gcc", "-w", f"-Wl,-rpath,{folder}", "-o")
        subprocess.run(
            [*call, folder / library, "-shared", "-fPIC", f"-Wl,-soname,{library}", source], check=True
        )
        subprocess.run([*call, folder / "main", tmp_path / "main.c", folder / library], check=True)
        assert packets_rays.asserts(folder / "main") is expected
    assert packets_rays.asserts(Path("/bin/true")) is False
