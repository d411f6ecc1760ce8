"""Declared costs and counted calls: build/NAME/render-count of every phase that has a costs.def.

Expected calls come from the geometry of small scenes and from the pictures' own evals and id planes; expected
costs of a step of the Mandelbulb's map from counting the distinct operations of its source.
"""

from __future__ import annotations

import functools
import itertools
import json
import re
import shutil
import subprocess
import textwrap
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from conformance.feature_scenes import CELLS, FLOOR, ROOM, SIZES, TURNED, scene, shape
from study.core import build, patches, registry, run, store
from study.core.registry import ROOT
from study.pictures import images

pytestmark = pytest.mark.slow

DECLARED = {name: p for name, p in registry.phases().items() if p.file("costs.def").exists()}
SCALAR = [name for name, phase in DECLARED.items() if phase.lanes == 1 and phase.family == "ladder"]
CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare", "call")
MACHINE = dict(zip(CLASSES, (1, 1, 2, 1, 1, 1, 1, 0, 0), strict=True))

MANY = [
    shape("sphere", radius=0.5, position=[-1, 0, 0]),
    shape("sphere", radius=0.4, position=[1, 1, 0], material="mirror"),
    shape("box", position=[2, 0, 2], **{"rotation_degrees": [0, 30, 0]}),
    shape("torus", rotation_degrees=[20, 0, 40]),
    shape("torus", position=[0, 2, 1]),
    shape("torus", position=[0, -1, 3], repeat=[5, 0, 0]),
    shape("cone", position=[-2, 0, 1]),
    shape("octahedron", position=[-1, 1.5, 0], rotation_degrees=TURNED["rotation_degrees"]),
    shape("mandelbulb", position=[1.5, -0.5, -0.5], repeat=[0, 6, 0]),
    shape("mandelbox", position=[-3, 2, 3], iterations=3),
    FLOOR,
]
OTHER = "spheres40"  # where a system refuses a scene
SCENES = {
    "many": scene(MANY, light={"shadows": "soft"}, fog=1e-4),
    "bare": scene(MANY[:2] + ROOM),  # no shadow, no fog; its mirror is taken out below
    "hard": scene(ROOM, light={"shadows": "hard"}),
    "ideal": scene(ROOM, light={"shadows": "ideal"}),
    "turned": scene([shape("box", repeat=CELLS, **TURNED), FLOOR]),
    "ball": scene([shape("sphere")]),
    "glass": scene([shape("plane", normal=[0, 1, 0], offset=0, material="mirror")]),
}
SCENES["bare"]["shapes"][1] = MANY[1] | {"material": "plain"}


@pytest.fixture(scope="session")
def scene_path(tmp_path_factory):
    """Writes one of SCENES and gives its path."""
    folder = tmp_path_factory.mktemp("counted")

    @functools.cache
    def path(name: str) -> Path:
        if name not in SCENES:
            return ROOT / "common" / "scenes" / f"{name}.json"
        store.write_json(folder / f"{name}.json", SCENES[name])
        return folder / f"{name}.json"

    return path


@pytest.fixture(scope="session")
def counted(scene_path, tmp_path_factory):
    """Counts of a phase on a scene, and its picture; `again` makes another run of the same.

    Of OTHER, where a system refuses the scene: what it draws, it counts."""
    folder = tmp_path_factory.mktemp("pictures")

    @functools.cache
    def count(phase: str, name: str, height: int = 24, again: int = 0, threads: int = 1):
        if lacking := registry.missing_isa(DECLARED[phase]):
            pytest.skip(f"this CPU lacks {', '.join(lacking)}, which {phase} needs")
        out = folder / f"{phase}-{name}-{height}-{again}-{threads}.exr"
        try:
            made = run.render(
                phase,
                scene_path(name),
                height,
                aov=True,
                out=out,
                threads=threads,
                target="render-count",
                timed=False,
            )
        except run.DriverError as error:
            may_refuse = DECLARED[phase].family == registry.SYSTEMS and name != OTHER
            if error.status != run.UNSUPPORTED or not may_refuse:
                raise
            return count(phase, OTHER, height, again, threads)
        return made, images.read(out)

    return count


def calls(made: dict[str, Any], function: str, part: str = "call") -> int:
    return made["by_function"][function]["parts"][part]


def test_there_are_phases_to_test():
    assert {"baseline", "opt1", "opt2"} <= set(SCALAR)


# --- what holds of every phase


@pytest.mark.parametrize("name", ["many", "bare", "scene0", "mandelbulb"])
@pytest.mark.parametrize("phase", DECLARED)
def test_functions_add_up(counted, phase, name):
    made, _ = counted(phase, name)
    functions = made["by_function"].values()
    assert made["flops"].keys() == {"paper", "machine"} and made["flops"]["machine"] > 0
    for convention in ("paper", "machine"):
        assert made["flops"][convention] == sum(one[convention] for one in functions)
    assert made["flops"]["machine"] == sum(n * MACHINE[kind] for kind, n in made["by_class"].items())
    assert made["executed"] == made["flops"]["machine"]
    assert made["useful"] == sum(one["useful"] for one in functions) <= made["executed"]
    for one in functions:
        assert {"calls", "lanes", "paper", "machine"} <= one.keys()
        assert one["calls"] == one["parts"].get("call", 0) and one["useful"] <= one["machine"]
        assert 0 <= one["lanes"] <= one["calls"] * registry.variant_here(DECLARED[phase]).lanes
    if DECLARED[phase].lanes == 1:
        assert all(one["lanes"] == one["calls"] for one in functions)
        assert made["useful"] == made["executed"]
        assert made["flops"]["paper"] == made["flops"]["machine"] + made["by_class"]["call"]


@pytest.mark.parametrize("phase", DECLARED)
def test_two_runs_count_the_same(counted, phase):
    first, second = (counted(phase, "many", again=n)[0] for n in range(2))
    for key in ("flops", "by_function", "by_class", "executed", "useful"):
        assert first[key] == second[key]


@pytest.mark.parametrize("phase", DECLARED)
def test_two_threads_count_as_one(counted, scene_path, phase):
    one, _ = counted(phase, "many")
    if not DECLARED[phase].threads:
        with pytest.raises(run.DriverError, match="one thread"):
            run.render(phase, scene_path("many"), 24, threads=2, target="render-count")
        return
    two, _ = counted(phase, "many", threads=2)
    assert one["flops"] == two["flops"] and one["by_function"] == two["by_function"]


@pytest.mark.parametrize("name", ["many", "turned"])
@pytest.mark.parametrize("phase", DECLARED)
def test_counting_does_not_change_the_picture(counted, scene_path, tmp_path, phase, name):
    made, counting = counted(phase, name)
    name = Path(made["scene"]).stem if "scene" in made else name
    run.render(phase, scene_path(name), made["height"], aov=True, out=tmp_path / "timing.exr", timed=False)
    timing = images.read(tmp_path / "timing.exr")
    for channel in images.AOVS:
        assert np.array_equal(counting[channel].view(np.uint32), timing[channel].view(np.uint32)), channel


# --- calls that geometry knows


@pytest.mark.parametrize("name", ["bare", "ball", "turned"])
@pytest.mark.parametrize("phase", SCALAR)
def test_evaluations_are_those_of_primary_rays_and_normals(counted, phase, name):
    """No mirror, no shadow: each ray evaluates as often as `evals` says, each hit four times more."""
    made, picture = counted(phase, name, height=36)
    hits = int((picture["id"] >= 0).sum())
    evals = int(picture["evals"].sum(dtype=np.float64))
    assert 0 < hits < picture["id"].size or name == "bare"
    assert calls(made, "sdf") == evals + 4 * hits
    assert calls(made, "ray_march", "step") == evals
    assert calls(made, "ray_march", "on") == evals - hits
    assert calls(made, "normal_at") == calls(made, "light_at") == calls(made, "trace", "hit") == hits
    assert calls(made, "trace") == picture["id"].size


@pytest.mark.parametrize(("name", "height"), [("many", 24), ("bare", 36), ("ideal", 24), ("scene0", 24)])
@pytest.mark.parametrize("phase", SCALAR)
def test_calls_follow_pixels_and_shapes(counted, phase, name, height):
    made, picture = counted(phase, name, height)
    shapes = store.read_json(ROOT / f"common/scenes/{name}.json")["shapes"] if name not in SCENES else None
    shapes = shapes or SCENES[name]["shapes"]
    assert calls(made, "get_direction") == picture["id"].size == made["width"] * made["height"]
    evaluations = calls(made, "sdf")
    for kind in SIZES:
        assert calls(made, f"sdf_{kind}") == evaluations * sum(one["type"] == kind for one in shapes), kind
    moves = sum(one["iterations"] for one in shapes if one["type"] == "mandelbox")
    assert calls(made, "sdf_mandelbox", "step") == evaluations * moves
    assert calls(made, "sdf", "shape") == calls(made, "apply_transform") == evaluations * len(shapes)
    marches = ("ray_march", "soft_shadow", "ideal_shadow", "hard_shadow")
    marched = sum(calls(made, march, "step") for march in marches)
    hits = calls(made, "normal_at")
    assert evaluations == marched + 4 * hits
    parts = made["by_function"]["sdf_octahedron"]["parts"]
    assert parts["edge"] + parts["face"] == parts["call"]
    assert calls(made, "trace") == picture["id"].size + calls(made, "trace", "mirror")


@pytest.mark.parametrize("phase", SCALAR)
def test_each_hit_of_a_lone_mirror_bounces_once(counted, phase):
    made, picture = counted(phase, "glass")
    hits = int((picture["id"] >= 0).sum())
    assert 0 < hits < picture["id"].size
    assert calls(made, "trace", "mirror") == calls(made, "trace", "hit") == hits
    assert calls(made, "trace") == calls(made, "ray_march") == picture["id"].size + hits


@pytest.mark.parametrize("phase", SCALAR)
def test_shadow_rays_go_where_the_scene_has_them(counted, phase):
    soft, hard, ideal, bare = (counted(phase, name)[0] for name in ("many", "hard", "ideal", "bare"))
    # From opt2 on: only where the surface faces the light.
    wanted = "facing" if "facing" in soft["by_function"]["light_at"]["parts"] else "lit"
    assert calls(soft, "soft_shadow") == calls(soft, "light_at", wanted) > 0
    assert calls(hard, "hard_shadow") == calls(hard, "light_at", wanted) > 0
    assert calls(ideal, "ideal_shadow") == calls(ideal, "light_at", wanted) > 0
    assert calls(soft, "hard_shadow") == calls(hard, "soft_shadow") == 0
    assert calls(soft, "ideal_shadow") == calls(hard, "ideal_shadow") == calls(ideal, "soft_shadow") == 0
    assert calls(bare, "hard_shadow") == calls(bare, "soft_shadow") == 0


# --- a feature that is not there costs nothing, from opt1 on


def test_the_baseline_takes_sines_whether_it_turns_or_not(counted):
    made, _ = counted("baseline", "ball")
    lit, shine = (calls(made, "light_at", part) for part in ("lit", "specular"))
    # Six per evaluation, the fog's exp per hit, fmax per lit point, fmax and pow where it shines.
    assert made["by_class"]["call"] == 6 * calls(made, "sdf") + calls(made, "trace", "hit") + lit + 2 * shine


def test_opt1_takes_no_sine_and_turns_only_what_is_turned(counted):
    made, _ = counted("opt1", "ball")
    lit, shine = (calls(made, "light_at", part) for part in ("lit", "specular"))
    assert made["by_class"]["call"] == lit + 2 * shine  # a sphere calls nothing: no sine, no exp
    assert calls(made, "apply_transform", "turn") == calls(made, "apply_transform", "wrap") == 0
    assert "rotate_point" not in made["by_function"]
    made, _ = counted("opt1", "many")
    evaluations, shapes = calls(made, "sdf"), SCENES["many"]["shapes"]
    for part, key in {"turn": "rotation_degrees", "wrap": "repeat"}.items():
        axes = sum(value != 0 for one in shapes for value in one.get(key, []))
        assert calls(made, "apply_transform", part) == evaluations * axes > 0


def test_opt2_turns_and_wraps_by_shape(counted):
    made, _ = counted("opt2", "many")
    for part, key in {"turn": "rotation_degrees", "wrap": "repeat"}.items():
        shapes = sum(key in one for one in SCENES["many"]["shapes"])
        assert calls(made, "apply_transform", part) == calls(made, "sdf") * shapes > 0


def test_a_spheres_distance_is_ten_operations(counted):
    """|p − c| − r: three differences, three squares, two sums, a root, a difference."""
    made, _ = counted("opt2", "ball")
    work = sum(made["by_function"][name]["machine"] for name in ("apply_transform", "sdf_sphere"))
    assert work == 10 * calls(made, "sdf")


# --- costs recounted from the source


class Term:
    """An operation on terms: equal ones are the same term, so that a set of them counts each once."""

    known: ClassVar[dict[tuple, Term]] = {}
    fresh = itertools.count()

    def __init__(self, *key):
        self.key = key

    @classmethod
    def of(cls, operation, a, b=None) -> Term | float:
        def plain(x):
            return x if isinstance(x, (int, float)) else x.key

        if operation in "+*":  # commutes
            a, b = sorted((a, b), key=lambda x: repr(plain(x)))
        key = (operation, plain(a), plain(b))
        return cls.known.setdefault(key, cls(*key))

    def __add__(self, o):
        return Term.of("+", self, o)

    def __sub__(self, o):
        return Term.of("-", self, o)

    def __mul__(self, o):
        return Term.of("*", self, o)

    def __rmul__(self, o):
        return Term.of("*", o, self)

    def __rsub__(self, o):
        return Term.of("-", o, self)


def operations(code: str, names: dict[str, Any]) -> dict[str, int]:
    """Distinct sums, products and roots of straight-line C that is Python, too."""
    Term.known = {}
    names["sqrt"] = lambda a: Term.of("sqrt", a, 0)
    for statement in filter(None, (part.strip() for part in code.split(";"))):
        for line in re.split(r",\s*(?=\w+ = )", statement):
            exec(textwrap.dedent(line.replace("\n", " ")), {}, names)
    kinds = [key[0] for key in Term.known]
    return {"add": kinds.count("+") + kinds.count("-"), "mul": kinds.count("*"), "sqrt": kinds.count("sqrt")}


def cost(phase: str, function: str, part: str) -> dict[str, int]:
    text = registry.find_phase(phase).file("costs.def").read_text()
    (numbers,) = re.findall(rf"^COST\({function}, {part},\s*1,([\d, ]+)\)", text, re.MULTILINE)
    return dict(zip(CLASSES, map(int, numbers.split(",")), strict=True))


def leaf(name: str) -> Term:
    return Term("leaf", name, next(Term.fresh))


@pytest.mark.parametrize("phase", SCALAR)
def test_a_step_of_the_bulb_costs_the_operations_of_its_source(phase):
    """Distinct ones: what is written twice is done once. The source is read, nothing is measured."""
    text = registry.find_phase(phase).file("sdf.h").read_text()
    shares_squares = "root = sqrt(m);" in text  # from opt2 on
    if shares_squares:
        body = text[text.index("root = sqrt(m);") : text.index("*at = ")]
    else:
        body = text[text.index("dz = 8.0 *") :]
        body = body[: body.index("vec_add(p, &raised" if "&raised" in body else "m = vec_dot(w, w)")]
        body = re.sub(r"struct vec3 raised = \{(.*)\};", r"w = (\1);", body, flags=re.DOTALL)
    body = re.sub(r"//.*|/\*.*?\*/|\\\n|\bdouble ", " ", body).replace("\\", " ")
    body = re.sub(r"\w+ > \S+ \? .*? : 0\.0;", "leaf('chosen');", body)  # a part of its own
    body = re.sub(r"COUNT\([^)]*\);", "", body)
    names = {n: leaf(n) for n in ("x", "y", "z", "m", "dz")} | {"leaf": leaf}
    names["w"] = type("W", (), {n: names[n] for n in "xyz"})
    point = [leaf(n) for n in "abc"]  # an array from opt2 on
    names["p"] = type("P", (list,), dict(zip("xyz", point, strict=True)))(point)
    found = operations(body, names)
    if shares_squares:
        found["mul"] -= 3  # x², y² and z² at its start are the ones that made m
    declared = cost(phase, "sdf_mandelbulb", "step")
    assert found == {kind: declared[kind] for kind in found}
    assert declared["div"] == declared["call"] == 0


# --- the timing build has none of it


MACRO = re.compile(r"\b(COUNT|ACTIVE)\(")


def lay(phase: str, folder: Path) -> None:
    """The phase's whole tree, whatever it derives from."""
    for name, path in patches.files(phase).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / name)


def strip(text: str) -> tuple[str, int]:
    """The source without COUNT(…) and ACTIVE(…), their semicolons kept; and how many there were."""
    times = 0
    while found := MACRO.search(text):
        end, depth = found.end(), 1
        while depth:
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        rest = text[end:]
        text = text[: found.start()] + (rest[1:] if rest.startswith(",") else rest)
        times += 1
    return text.replace('#include "counting/flops.h"\n', ""), times


def preprocessed(folder: Path, phase: str) -> dict[str, list[str]]:
    """Words that the timing build's compiler sees, by source file of the phase's copy under the folder, but
    for the nothing that a count is there; of a phase with variants by its widest.
    """
    found = {}
    for source in sorted((folder / phase).rglob("*.c")):
        flags = DECLARED[phase].cflags.split()
        for one in DECLARED[phase].variants[:1]:
            flags += [*one.flags.split(), f"-DLANES={one.lanes}", "-DVARIANT(a)=variant_##a"]
        includes = [
            f"-I{ROOT / 'common'}",
            "-iquote",
            phase,
            "-iquote",
            build.build(phase).parent,
        ]  # embedded.h
        command = [
            "gcc",
            "-std=c11",
            "-D_GNU_SOURCE",
            *flags,
            *includes,
            "-D_IMMINTRIN_H_INCLUDED",  # of the project's own lines: the compiler's are a hundred thousand
            "-E",
            "-P",
            str(source.relative_to(folder)),
        ]
        text = subprocess.check_output(command, cwd=folder, text=True)
        found[str(source.relative_to(folder))] = re.sub(r"\(\(void\)0\)\s*,?", "", text).split()
    return found


@pytest.mark.parametrize("phase", DECLARED)
def test_the_timing_build_has_none_of_it(tmp_path, phase):
    with_it, without = tmp_path / "with", tmp_path / "without"
    for folder in (with_it, without):
        lay(phase, folder / phase)
    stripped = 0
    for path in (without / phase).rglob("*.[ch]"):
        text, times = strip(path.read_text())
        stripped += times
        path.write_text(text)
        assert not re.search(r"\b(COUNT|ACTIVE|flops_\w+)\b|flops\.h", text), path.name
    assert stripped > 20
    assert preprocessed(with_it, phase) == preprocessed(without, phase)


# --- what is said when costs and source do not fit


@pytest.fixture
def tree(tmp_path):
    """A copy of the baseline with all that builds it."""
    shutil.copytree(ROOT / "common", tmp_path / "common")
    shutil.copytree(ROOT / "scripts" / "study", tmp_path / "scripts" / "study")
    shutil.copytree(ROOT / "phases" / "baseline", tmp_path / "phases" / "baseline")
    shutil.copy(ROOT / "Makefile", tmp_path)
    return tmp_path


def make(tree: Path) -> subprocess.CompletedProcess[str]:
    command = ["make", "-s", "-C", str(tree), "build/baseline/count/phase.o"]
    return subprocess.run(command, capture_output=True, text=True)


def test_a_part_without_a_cost_does_not_build(tree):
    costs = tree / "phases/baseline/costs.def"
    kept = [line for line in costs.read_text().splitlines() if not line.startswith("COST(clamp, not_below")]
    costs.write_text("\n".join(kept) + "\n")
    done = make(tree)
    assert done.returncode != 0
    assert re.search("error: .COST_clamp_not_below. undeclared", done.stderr)
    assert "baseline/sdf.h:" in done.stderr


def test_a_missing_file_is_one_clear_line(tree):
    (tree / "phases/baseline/costs.def").unlink()
    done = make(tree)
    assert done.returncode != 0
    said = [line for line in done.stderr.splitlines() if not line.startswith("make")]
    assert said == ["phases/baseline/costs.def is missing: FLOPs per function, see common/counting/flops.h"]


# --- a phase with threads of its own, in a few lines; opt5_threads is tests/phases/test_threads.py's


TOY = """
#include <pthread.h>
#include <stdlib.h>

#include "counting/flops.h"
#include "phase.h"

struct prepared {
    int threads;
};
struct band {
    struct frame *frame;
    int first, stride;
};

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    return NULL;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)model;
    struct prepared *prepared = malloc(sizeof *prepared);
    if (prepared)
        prepared->threads = threads;
    return prepared;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    (void)prepared, (void)model;
    return true;
}

void phase_release(struct prepared *prepared) {
    free(prepared);
}

static float shade(int row, int column) {
    COUNT(shade, call);
    float sum = 0;
    for (int i = 0; i < row % 5 + column % 3; i++)
        COUNT(shade, step), sum += 0.125f * (float)i;
    return sum;
}

static void *rows(void *data) {
    const struct band *band = data;
    struct frame *frame = band->frame;
    COUNT(rows, call);
    for (int row = band->first; row < frame->height; row += band->stride)
        for (int column = 0; column < frame->width; column++) {
            ACTIVE(column % 4 + 1);
            float *rgb = frame->rgb + 3 * ((size_t)row * (size_t)frame->width + (size_t)column);
            rgb[0] = rgb[1] = rgb[2] = shade(row, column);
        }
    return NULL;
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    (void)view;
    pthread_t threads[8];
    struct band bands[8];
    bool good = true;
    for (int i = 0; i < prepared->threads; i++) {
        bands[i] = (struct band){frame, i, prepared->threads};
        if (i > 0 && pthread_create(&threads[i], NULL, rows, &bands[i]) != 0)
            return false;
    }
    rows(&bands[0]);
    for (int i = 1; i < prepared->threads; i++)
        good = pthread_join(threads[i], NULL) == 0 && good;
    return good;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    (void)prepared, (void)points;
    for (size_t i = 0; i < count; i++)
        distance[i] = 0.0, nearest[i] = -1;
    return true;
}
"""
TOY_COSTS = """\
COST(rows, call,      1, 0, 0, 0, 0, 0, 0, 0, 0, 0)
COST(shade, call, LANES, 0, 0, 0, 0, 0, 0, 0, 0, 0)
COST(shade, step, LANES, 1, 1, 0, 0, 0, 0, 0, 0, 0) // 0.125·i; the sum
"""


@pytest.fixture(scope="module")
def toy(tmp_path_factory) -> Path:
    """build/toy/render-count of a phase that shares its rows among --threads threads."""
    tree = tmp_path_factory.mktemp("threads")
    for name in ("common", "phases/baseline", "scripts"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__", "ablations"))
    shutil.copy(ROOT / "Makefile", tree)
    folder = tree / "phases/toy"
    folder.mkdir()
    about = store.read_json(ROOT / "phases/baseline/phase.json")
    about |= {"name": "toy", "threads": True, "lanes": 4, "order": 99, "parent": "baseline"}
    store.write_json(folder / "phase.json", about)
    (folder / "toy.c").write_text(TOY)
    (folder / "costs.def").write_text(TOY_COSTS)
    subprocess.run(["make", "-s", "-C", str(tree), "build/toy/render-count"], check=True)
    return tree / "build/toy/render-count"


@settings(max_examples=12, deadline=None)
@given(height=st.integers(1, 40), width=st.integers(1, 40), threads=st.integers(2, 8))
@example(height=1, width=7, threads=2)  # the second thread has nothing to do
def test_any_number_of_threads_counts_as_one(toy, height, width, threads):
    """The counts of each function are those of one thread, and what the loops say; only `rows` runs anew."""
    shape = ["-n", str(height), "-w", str(width), "--json"]

    def count(number: int) -> dict[str, Any]:
        command = [toy, ROOT / "common/scenes/trio.json", *shape, "--threads", str(number)]
        return json.loads(subprocess.check_output(command, text=True).splitlines()[-1])

    one, several = count(1), count(threads)
    assert one["by_function"]["shade"] == several["by_function"]["shade"]
    for key in ("flops", "executed", "useful", "useful_paper"):
        assert one[key] == several[key]
    assert [made["by_function"]["rows"]["calls"] for made in (one, several)] == [1, threads]
    steps = [(row % 5 + column % 3, column % 4 + 1) for row in range(height) for column in range(width)]
    assert one["by_function"]["shade"]["parts"] == {"call": len(steps), "step": sum(n for n, _ in steps)}
    assert one["by_function"]["shade"]["lanes"] == sum(active for _, active in steps)
    assert one["executed"] == 4 * 2 * sum(n for n, _ in steps)
    assert one["useful"] == 2 * sum(n * active for n, active in steps)
