"""Ablations: patches that apply, build and draw the same picture; what is counted and timed of them."""

from __future__ import annotations

import difflib
import functools
import json
import math
import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import emitted
import numpy as np
import pytest
import started
from hypothesis import example, given
from hypothesis import strategies as st

from study.core import patches, registry, run
from study.core.build import build
from study.core.cli import StudyError
from study.core.patches import PatchError
from study.core.registry import ROOT, Spec
from study.counting import blocks, flops
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.ablations.measure import Ablation
from study.numbers import paper, stats, verdicts
from study.pictures import images

pytestmark = pytest.mark.slow

NAMES = [f"{phase}+{title}" for phase in registry.phases() for title in patches.titles(phase)]
BASES = sorted({name.partition("+")[0] for name in NAMES} - {"baseline"})
HEIGHT = 36
SCENES = ("scene0", "mandelbulb", "cubes")
# Counting builds that are run: for the others the compilers' look at the source must do.
COUNTED = [
    "baseline",
    "baseline+1_precomputed",
    "baseline+2_zero_skip",
    "baseline+3_inlined",
    "opt1+pointers",
]
COUNTED += ["opt1+bulb", "opt2", "opt2+norm_bounds", "opt2+fast_root_3"]
COUNTED += ["opt4", "opt4+rsqrt"]
JOBS = str(len(os.sched_getaffinity(0)))


def spec_of(name: str) -> Spec:
    spec = Spec.parse(name)
    if lacking := registry.missing_isa(spec):
        pytest.skip(f"the CPU lacks {', '.join(lacking)}")
    return spec


@functools.cache
def built() -> None:
    """Everything that the tests run, by one make. A patch that fails leaves the rest alone."""
    targets = [f"build/{name}/render" for name in ["baseline", *BASES, *NAMES]]
    targets += [f"build/{name}/render-count" for name in COUNTED]
    subprocess.run(["make", "-s", "-k", f"-j{JOBS}", *targets], cwd=ROOT, capture_output=True)


@functools.cache
def picture(name: str, scene: str, folder: Path) -> images.Picture:
    path = folder / f"{name}-{scene}.exr"
    run.render(name, ideas.find_scene(scene).path, HEIGHT, aov=True, out=path, timed=False)
    return images.read(path)


@functools.cache
def counts(name: str, scene: str) -> dict:
    built()
    return run.render(name, registry.find_scene(scene).path, HEIGHT, target="render-count", timed=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    built()
    return tmp_path_factory.mktemp("pictures")


# --- every patch there is


def test_the_steps_that_the_paper_credits_are_there():
    steps = {"1_precomputed", "2_zero_skip", "3_inlined", "pointers", "arrays", "bulb", "two_accumulators"}
    steps |= {"horizontal", "octahedron_order", "octahedron_no_exit", "fast_root_1", "rsqrt", "norm_bounds"}
    assert steps <= {name.partition("+")[2] for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_it_applies_to_the_sources_as_they_are(name):
    tree = patches.tree(name)
    path = patches.chain(name)[-1].path
    sources = [f for f in tree if f != "phase.json"]
    changed = [f for f in sources if without_line(tree[f]) != original(name, f)]
    assert changed, f"{path} changes nothing"


def original(name: str, file: str) -> str:
    return patches.files(name.partition("+")[0])[file].read_text()


def without_line(text: str) -> str:
    """A file of a tree without the #line that names the file in phases/ (patches.tree)."""
    return re.sub(r'^#line 1 "[^"]*"\n', "", text)


@pytest.mark.parametrize("name", NAMES)
def test_git_makes_the_same_tree_of_it(name, tmp_path):
    if not shutil.which("git"):
        pytest.skip("git is missing: it would check the project's own reader of patches")
    tree = patches.tree(name)
    for file in tree.keys() - {"phase.json"}:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(original(name, file))
    for patch in patches.chain(name):
        command = ["git", "-C", tmp_path, "apply", "--unsafe-paths", patch.path]
        environment = os.environ | {"GIT_CEILING_DIRECTORIES": str(tmp_path.parent)}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, f"{patch.path}: {done.stderr}"
    for file, text in tree.items():
        if file != "phase.json":
            assert (tmp_path / file).read_text() == without_line(text), f"{name}: {file}"


@pytest.mark.parametrize("name", NAMES)
def test_its_head_is_understood(name):
    (found, *_), broken = ablations.find([name])
    assert not broken
    assert found.spec == Spec.parse(name) and found.against != found.spec
    assert found.what and "(" in found.paper and found.scenes
    assert registry.find_phase(name).tolerance, f"{name}: held to no tolerance (its head may name a phase's)"


@pytest.mark.parametrize("name", NAMES)
def test_its_claim_is_the_papers(name):
    """results/paper/speedups.csv was typed from the text: the same value from the same section."""
    (found, *_), _ = ablations.find([name])
    if found.claim is not None:
        stated = paper.read("speedups")
        section = re.search(r"section [\d.]+\d", found.paper)
        assert section, f"{name}: names no section"
        assert found.claim in set(stated[stated["source"].str.contains(section[0], regex=False)]["value"])


@pytest.mark.parametrize("name", NAMES)
def test_it_builds_without_a_warning(name):
    built()
    targets = ["render", "render-count"] if name in COUNTED else ["render"]
    paths = [f"build/{name}/{target}" for target in targets]  # an old program may be there: make must agree
    done = subprocess.run(["make", "-s", *paths], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]


@functools.cache
def intrinsics(compiler: str, flags: tuple[str, ...], folder: Path) -> list[str]:
    """Words that have <immintrin.h>, parsed once for all sources read with these flags, before a source."""
    header = folder / f"{compiler}-{len(list(folder.iterdir()))}.h"
    header.write_text("#include <immintrin.h>\n")
    made = header.with_suffix(".h.gch" if compiler == "gcc" else ".pch")
    words = [word for word in flags if word != "-fsyntax-only"]
    done = subprocess.run([compiler, *words, "-x", "c-header", header, "-o", made], capture_output=True)
    assert done.returncode == 0, done.stderr
    return ["-include", str(header)] if compiler == "gcc" else ["-include-pch", str(made)]


def own_flags(flags: str) -> list[str]:
    """Of a variant, without how structs are copied: nothing is made of what is only read."""
    return [word for word in flags.split() if not word.startswith(registry.COPIES)]


@pytest.fixture(scope="module")
def parsed(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("intrinsics")


@pytest.mark.parametrize(
    ("name", "compiler"),
    [(n, c) for n in NAMES for c in ("gcc", "clang") if (c, n in COUNTED) != ("gcc", True)],
)
def test_clang_takes_it_and_gcc_the_counting_source(name, compiler, parsed):
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is missing: it would look at every ablation too")
    built()
    phase = registry.find_phase(name)
    flags = [*phase.cflags.split(), "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-Icommon"]
    counting = ["-DSTEPWISE_COUNT"] if compiler == "gcc" else []
    for lanes, own in [(v.lanes, own_flags(v.flags)) for v in phase.variants] or [(None, [])]:
        if lanes:  # as common/build/phase_info.py has it
            own += [f"-DLANES={lanes}", f"-DVARIANT(a)=lanes{lanes}_##a"]
        words = ["-std=c11", "-D_GNU_SOURCE", *flags, *own, *counting]
        first = intrinsics(compiler, tuple(words), parsed) if "-mavx" in " ".join(words) else []
        done = subprocess.run(
            [
                compiler,
                *words,
                "-iquote",
                phase.path,
                "-iquote",
                phase.path.parent,
                *first,
                *sorted(phase.path.rglob("*.c")),
            ],
            cwd=ROOT,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr[-2000:]


def pictured(name: str) -> list[str]:
    """SCENES, and what the head names beside common/scenes: made to order, for many shapes."""
    named = patches.chain(name)[-1].head.get("scenes", "").split()
    return [*SCENES, *(scene for scene in named if ideas.MADE.fullmatch(scene))]


@pytest.mark.parametrize(("name", "scene"), [(name, scene) for name in NAMES for scene in pictured(name)])
def test_its_picture_is_its_phases(name, scene, folder):
    spec_of(name)
    (ablation, *_), _ = ablations.find([name])
    found, reference = (picture(who, scene, folder) for who in (name, str(ablation.reference)))
    fractal = ideas.find_scene(scene).fractal
    metrics = images.compare(reference, found, (reference, found) if fractal else None)
    verdict, failed = ablations.judge(ablation, ideas.find_scene(scene), metrics)
    assert metrics["non_finite"] == 0
    assert verdict in ("identical", "within") or (ablation.error and verdict == "approximate"), failed


# --- what they count: known from the sources


def part(name: str, scene: str, function: str, part: str) -> int:
    return counts(name, scene)["by_function"][function]["parts"][part]


def test_precomputing_saves_six_calls_and_three_products_a_shape():
    before, after = (counts(name, "scene0") for name in ("baseline", "baseline+1_precomputed"))
    shapes = part("baseline", "scene0", "apply_transform", "call")
    assert before["flops"]["paper"] - after["flops"]["paper"] == 9 * shapes
    assert before["flops"]["machine"] - after["flops"]["machine"] == 3 * shapes


def test_skipping_zero_angles_saves_turns():
    before, after = (counts(f"baseline+{title}", "scene0") for title in ("1_precomputed", "2_zero_skip"))
    shapes = part("baseline+1_precomputed", "scene0", "rotate_point", "call")
    turns = part("baseline+2_zero_skip", "scene0", "rotate_point", "turn")
    assert 0 < turns < 3 * shapes
    assert before["flops"]["machine"] - after["flops"]["machine"] == 6 * (3 * shapes - turns)


def test_inlining_costs_no_flops():
    one, two = (counts(f"baseline+{title}", "scene0") for title in ("2_zero_skip", "3_inlined"))
    assert one["flops"] == two["flops"]


@pytest.mark.parametrize("scene", ["scene0", "mandelbulb"])
def test_pointers_save_next_to_none(scene):
    """Beside the distances opt1 has a few operations less per hit: −1 times a vector, in the light."""
    before, after = (
        counts(name, scene)["flops"]["machine"] for name in ("baseline+3_inlined", "opt1+pointers")
    )
    assert 0.999 * before < after <= before


def test_the_simplified_bulb_counts_as_opt2s():
    one, two = (counts(name, "mandelbulb")["by_function"]["sdf_mandelbulb"] for name in ("opt1+bulb", "opt2"))
    per_step = [c["machine"] / c["parts"]["step"] for c in (one, two)]
    assert per_step[0] == pytest.approx(per_step[1], rel=1e-3) and one["parts"]["step"] > 0


def test_the_root_of_the_bounds_test_is_one_a_step():
    with_roots, without = (counts(name, "scene0")["by_class"] for name in ("opt2+norm_bounds", "opt2"))
    tests = sum(part("opt2", "scene0", f, "on") for f in ("ray_march", "soft_shadow", "hard_shadow"))
    assert with_roots["sqrt"] - without["sqrt"] == tests > 0
    assert with_roots | {"sqrt": 0} == without | {"sqrt": 0}


def test_newton_steps_are_counted():
    name = "opt2+fast_root_3"
    assert part(name, "trio", "root", "newton") == 3 * part(name, "trio", "root", "call") > 0


@pytest.mark.parametrize("name", [n for n in NAMES if "costs" not in patches.chain(n)[-1].head])
def test_declared_costs_of_an_ablation_hold_against_the_blocks_that_ran(name):
    """In the build without inlining; an ablation that cannot say its costs says so in its head (costs:)."""
    spec, head = spec_of(name), patches.chain(name)[-1].head
    build(spec, "render-count")
    for scene in map(registry.find_scene, head.get("scenes", "scene0").split()):
        calls = flops.measure("blocks", spec, scene, 12, "calls")
        rows = flops.compare(flops.declared(spec, scene, 12), calls, calls)
        assert len(rows) > 10 and flops.failures(rows) == []


def test_what_costs_def_cannot_say_is_measured(monkeypatch, capsys):
    def measure(spec, path, height):
        if spec.phase == "opt2":
            raise StudyError("no assembler")
        return types.SimpleNamespace(total=types.SimpleNamespace(machine=70))

    monkeypatch.setattr(blocks, "measure", measure)
    cases = [(Spec.parse(name), "trio") for name in ("opt2", "opt2+norm_bounds")]
    assert ablations.measure_flops(cases, 9) == {cases[1]: {"machine": 70}}
    assert capsys.readouterr().err == "no FLOPs of opt2 on trio: no assembler\n"


def test_every_root_of_opt4_is_estimated():
    spec_of("opt4")
    before, after = (counts(name, "two_spheres") for name in ("opt4", "opt4+rsqrt"))
    assert after["by_class"]["sqrt"] == 0 < after["by_class"]["rsqrt"]
    assert before["by_class"]["rsqrt"] == 0 < before["by_class"]["sqrt"]


# The largest relative error of the fast inverse square root after Newton's steps: 3.44e-2 of the guess
# becomes 3/2·e² + e³/2 by each (C. Lomont, "Fast inverse square root" (2003), has 1.75e-3 for one).
@pytest.mark.parametrize(("steps", "error"), [(1, 1.752e-3), (2, 4.61e-6), (3, 3.19e-11)])
def test_error_of_the_fast_root(steps, error, tmp_path):
    name = f"opt2+fast_root_{steps}"
    scene = json.loads(registry.find_scene("trio").path.read_text())
    scene["shapes"] = [
        {"type": "sphere", "radius": 1.0, "material": s["material"]} for s in scene["shapes"][:1]
    ]
    path = tmp_path / "sphere.json"
    path.write_text(json.dumps(scene))
    subprocess.run(["make", "-s", f"build/{name}/probe"], cwd=ROOT, check=True, capture_output=True)
    points = np.random.default_rng(1).normal(size=(20_000, 3)) * 3
    raw = subprocess.run([ROOT / f"build/{name}/probe", path], input=points.tobytes(), capture_output=True)
    assert raw.returncode == 0, raw.stderr
    norm = np.linalg.norm(points, axis=1)
    off = np.abs(np.frombuffer(raw.stdout).reshape(-1, 2)[:, 0] + 1 - norm) / norm
    assert 0.9 * error < off.max() <= error * 1.001


def test_an_over_relaxed_step_goes_back_to_what_it_leapt_over(tmp_path):
    """1.6 of the first distance, 1 to the sphere above, ends behind the small one at 1.2 to 1.4."""
    spec_of("opt6_wide+over_relaxation")
    scene = json.loads(registry.find_scene("two_spheres").path.read_text())
    scene["camera"] |= {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": 2}
    scene["march"] |= {"max_steps": 100, "hit_distance": 1e-6}
    for shape, place, radius in zip(scene["shapes"], ([0, 2, 0], [0, 0, 1.3]), (1, 0.1), strict=True):
        shape |= {"position": place, "radius": radius}
    path = tmp_path / "leap.json"
    path.write_text(json.dumps(scene))
    run.render("opt6_wide+over_relaxation", path, 9, 9, aov=True, out=tmp_path / "leap.exr")
    made = images.read(tmp_path / "leap.exr")
    assert (made["id"] == 1).all() and made["Z"][4, 4] == pytest.approx(1.2, abs=1e-6)
    assert made["evals"].max() < 12  # and does not go back for ever


# --- applying patches

LINES = st.lists(st.sampled_from(["", "a", "b", "c", "-- x", "++ y", "@@ -1 +1 @@", "d d"]), max_size=30)


def patch_of(old: list[str], new: list[str], context: int = 3, path: Path = Path("p/x/ablations/t.patch")):
    diff = difflib.unified_diff(old, new, "a/f", "b/f", lineterm="", n=context)
    return patches.Patch(path, {}, tuple(diff), 1)


def text(lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


@example(["a"] * 9, ["a", "b", *"aaa", "b", *"aaa", "b", *"aa"], 0)  # three hunks whose places add up
@given(LINES, LINES, st.integers(0, 3))
def test_a_diff_is_undone_by_applying_it(old, new, context):
    assert patches.apply({"f": text(old)}, patch_of(old, new, context)) == {"f": text(new)}


def test_a_place_that_moved_is_found_but_not_guessed():
    old = [f"line {i}" for i in range(20)]
    new = [*old[:10], "added", *old[10:]]
    moved = ["first", "second", *old]
    assert patches.apply({"f": text(moved)}, patch_of(old, new)) == {
        "f": text([*moved[:12], "added", *moved[12:]])
    }
    with pytest.raises(PatchError, match=r"t\.patch:3: does not apply to x/f"):
        patches.apply({"f": text([*moved, *moved])}, patch_of(old, new))  # two places


def test_a_changed_line_of_context_is_refused_with_its_place():
    old = [f"line {i}" for i in range(20)]
    changed = [*old[:9], "edited", *old[10:]]
    with pytest.raises(
        PatchError, match=r"p/x/ablations/t\.patch:3: does not apply to x/f, which has changed"
    ):
        patches.apply({"f": text(changed)}, patch_of(old, [*old[:10], "added", *old[10:]]))


@pytest.mark.parametrize(
    ("diff", "words"),
    [
        (["--- a/g", "+++ b/g", "@@ -1 +1 @@", "-a", "+b"], r"names no file of the phase; there are f"),
        (["--- a/f", "+++ b/f", "@@ -1,2 +1,2 @@", "-a", "+b"], "the hunk ends early"),
        (["--- a/f", "+++ b/f", "@@ -1 +1 @@", "-a", "-b", "+b"], "not as many as its head says"),
        (["--- a/f", "+++ b/f", "nonsense"], "is no line of a unified diff"),
        (["@@ -1 +1 @@", "-a", "+b"], "a hunk before its file"),
    ],
)
def test_a_broken_diff_is_refused(diff, words):
    with pytest.raises(PatchError, match=words):
        patches.apply({"f": "a\n"}, patches.Patch(Path("p/x/ablations/t.patch"), {}, tuple(diff), 1))


HEAD = {"what": "w", "paper": "2× (x)", "direction": "added", "against": "opt1"}


def small_root(root: Path, **heads: dict[str, str | None]) -> Path:
    """A tree with opt1 and ablations of it that change ambient light; None removes a line of the head."""
    shutil.copytree(ROOT / "phases/opt1", root / "phases/opt1", ignore=shutil.ignore_patterns("ablations"))
    (root / "phases/opt1/ablations").mkdir()
    old = (root / "phases/opt1/shade.c").read_text().splitlines()
    new = [line.replace("0.01, color", "0.02, color") for line in old]
    diff = text(list(difflib.unified_diff(old, new, "a/shade.c", "b/shade.c", lineterm="")))
    for title, changes in heads.items():
        head = {k: v for k, v in (HEAD | changes).items() if v is not None}
        body = text([f"{key}: {value}" for key, value in head.items()]) + "\n" + diff
        (root / f"phases/opt1/ablations/{title}.patch").write_text(body)
    return root


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"what": None}, "its head lacks 'what"),
        ({"direction": "up"}, "direction is 'up', must be added or removed"),
        ({"colour": "red"}, r"t\.patch:5: 'colour: red' is no line 'key: value'"),
        ({"after": "gone"}, r"no ablation 'opt1\+gone', which .*t\.patch comes after; opt1 has t"),
        ({"after": "t"}, r"t\.patch: comes after itself"),
        ({"flags": "opt7"}, "no phase 'opt7'"),
    ],
)
def test_a_bad_head_is_refused(tmp_path, changes, words):
    small_root(tmp_path, t=changes)
    with pytest.raises(PatchError, match=words):
        patches.described("opt1+t", tmp_path)
    with pytest.raises(StudyError, match=words):
        registry.find_phase("opt1+t", tmp_path)


def test_a_head_line_may_go_on_and_may_not_come_twice(tmp_path):
    path = small_root(tmp_path, t={"what": "one\n  two"}) / "phases/opt1/ablations/t.patch"
    assert patches.read(path).head["what"] == "one two"
    path.write_text("what: again\n" + path.read_text())
    with pytest.raises(PatchError, match=r"t\.patch:2: a second 'what:'"):
        patches.read(path)
    path.write_text("what: only a head\n")
    with pytest.raises(PatchError, match="no diff"):
        patches.read(path)


def test_a_tree_is_written_once_and_without_leftovers(tmp_path):
    small_root(tmp_path, t={"flags": "opt1"})
    made = tmp_path / "out"
    patches.write("opt1+t", made, tmp_path)
    assert "0.02, color" in (made / "shade.c").read_text()
    assert json.loads((made / "phase.json").read_text())["name"] == "opt1+t"
    before = {path.name: path.stat().st_mtime_ns for path in made.iterdir()}
    (made / "old.c").write_text("")
    patches.write("opt1+t", made, tmp_path)
    assert {path.name: path.stat().st_mtime_ns for path in made.iterdir()} == before


def test_a_build_takes_over_what_the_patch_leaves_alone(tmp_path):
    """Of opt2's three sources, norm_bounds changes march.c."""
    name = "opt2+norm_bounds"
    words = ["make", f"BUILD={tmp_path}", f"{tmp_path}/{name}/phase.o"]

    def compiled() -> list[tuple[str, str]]:
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
        return re.findall(rf"/(\w+)\.c -o {tmp_path}/([^/]+)/assembly/", done.stdout)

    assert compiled() == [("march", "opt2"), ("render", "opt2"), ("shade", "opt2"), ("march", name)]
    assert compiled() == []
    parts = {
        part: [(tmp_path / of / f"objects/{part}.o").read_bytes() for of in ("opt2", name)]
        for part in ("march", "render", "shade")
    }
    assert {part for part, (a, b) in parts.items() if a == b} == {"render", "shade"}


# --- names


def test_an_ablation_is_a_phase_by_name():
    phase = registry.find_phase("opt2+horizontal")
    assert (phase.isa, phase.cflags) == (registry.find_phase("opt3").isa, registry.find_phase("opt3").cflags)
    assert phase.tolerance == registry.find_phase("opt2").tolerance
    assert "opt2+horizontal" not in registry.phases()
    assert str(Spec.parse("opt2+norm_bounds@opt3")) == "opt2+norm_bounds@opt3"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("opt1+arays", r"no ablation of opt1 'arays'; did you mean arrays\?"),
        ("opt1+", "no ablation of opt1 ''"),
        ("opt1+../../x", "no ablation of opt1"),
        ("op1+arrays", "no phase 'op1'; did you mean opt1"),
    ],
)
def test_an_unknown_ablation_is_refused_with_what_is_near(name, words):
    with pytest.raises(StudyError, match=words):
        Spec.parse(name)
    with pytest.raises(StudyError, match=words):
        ablations.find([name])


# --- rows


def ablation(added: bool = True, paper: str = "1.3× (x)", error: str | None = None) -> Ablation:
    specs = Spec.parse("opt1+arrays"), Spec.parse("opt1")
    return Ablation(*specs, added, "w", paper, error, None, ("scene0",))


@pytest.mark.parametrize(("added", "gain"), [(True, 2.0), (False, 0.5)])
def test_the_gain_is_the_steps_whichever_side_has_it(added, gain):
    scene = registry.find_scene("scene0")
    mine, base = (Spec.parse("opt1+arrays"), "scene0"), (Spec.parse("opt1"), "scene0")
    metrics = dict.fromkeys(ablations.ERRORS, 0.0) | {"identical": True, "psnr_db": math.inf}
    made = {(Spec.parse(who), case): metrics for who in ("baseline", "opt1") for case in (mine, base)}
    flops = {mine: {"machine": 300}, base: {"machine": 400}}
    times = {mine: [5.0] * 6, base: [10.0] * 6}
    row = ablations.row(ablation(added), scene, (16, 9), times, made, flops)
    assert row["gain"].value == row["gain"].low == gain
    assert row["flops_ratio"] == (0.75 if added else 4 / 3)
    assert row["verdict"] == "identical"
    assert (row["paper_value"], row["flops_by"]) == (1.3, "declared costs")


def interval(low: float, high: float, launches: int = 6) -> stats.Interval:
    return stats.Interval((low + high) / 2, low, high, launches, launches >= 6)


@pytest.mark.parametrize(
    ("paper", "low", "high", "failed", "verdict"),
    [
        ("1.3× (x)", 1.3, 1.4, [], verdicts.HOLDS),
        ("1.3× extra (x)", 1.2, 1.4, [], verdicts.WITHIN),
        ("1.3× (x)", 1.1, 1.29, [], verdicts.FAILS),
        ("no gain (x)", 0.9, 1.04, [], verdicts.HOLDS),
        ("no gain (x)", 1.01, 1.03, [], verdicts.HOLDS),
        ("no gain (x)", 0.9, 1.9, [], verdicts.WITHIN),
        ("no gain (x)", 1.06, 1.1, [], verdicts.FAILS),
        ("not satisfying (x)", 1.5, 1.6, ["psnr_db"], verdicts.HOLDS),
        ("not satisfying (x)", 1.5, 1.6, [], verdicts.FAILS),
        ("not satisfying (x)", 0.8, 0.9, [], verdicts.HOLDS),
        ("chosen against (x)", 0.8, 0.9, [], ""),
    ],
)
def test_claims_are_held_against_the_interval(paper, low, high, failed, verdict):
    assert ablation(paper=paper).holds(interval(low, high), failed) == verdict
    if verdict:
        assert ablation(paper=paper).holds(interval(low, high, 5), failed) == verdicts.FEW


def test_a_step_that_was_given_up_says_why():
    row = {"paper": "not satisfying (x)", "paper_value": None, "claim": verdicts.HOLDS, "failed": ["psnr_db"]}
    assert ablations.said(row | {"gain": interval(0.8, 0.9)}).endswith(": too wrong and no faster")
    assert ablations.said(row | {"gain": {"high": 1.9}}).endswith(": too wrong")
    assert ablations.said(row | {"failed": [], "gain": {"high": 0.9}}).endswith(": no faster")
    assert ablations.said(row | {"paper": "no gain", "gain": {"high": 0.9}}).endswith(": no faster")
    assert ablations.said(row | {"paper_value": 1.3, "gain": {"high": 0.9}}) == verdicts.HOLDS
    assert ablations.said(row | {"claim": verdicts.FAILS, "gain": {"high": 1.9}}) == verdicts.FAILS


def test_an_approximation_may_be_off_but_not_undefined():
    scene = registry.find_scene("scene0")
    off = {"identical": False, "non_finite": 0}
    assert ablations.judge(ablation(error="coarse"), scene, off)[0] == "approximate"
    assert ablations.judge(ablation(), scene, off)[0] == "OUTSIDE"
    assert ablations.judge(ablation(error="coarse"), scene, off | {"non_finite": 1})[0] == "OUTSIDE"


def test_every_case_is_timed_once_a_round_in_random_order(monkeypatch):
    asked = []

    def frames(spec, path, height, width, cpu, env_bytes):
        asked.append((str(spec), env_bytes))
        yield {"ns": 7}

    monkeypatch.setattr(run, "frames", frames)
    before = os.sched_getaffinity(0)
    cases = [(Spec.parse(name), "scene0") for name in ("baseline", "opt1", "opt2")]
    times = ablations.measure(cases, 9, 8, 1, run.FASTEST)
    assert times == {case: [7.0] * 8 for case in cases}
    rounds = [tuple(name for name, _ in asked[i : i + 3]) for i in range(0, 24, 3)]
    assert all(set(one) == {"baseline", "opt1", "opt2"} for one in rounds) and len(set(rounds)) > 2
    assert len({padding for _, padding in asked}) > 12
    assert os.sched_getaffinity(0) == before


# --- the command


def command(*arguments: str, root: Path = ROOT, **environment: str) -> subprocess.CompletedProcess:
    words = [sys.executable, root / "scripts/stepwise", "ablations", *arguments]
    return started.run(words, env=os.environ | environment)


def test_the_table(tmp_path):
    built()
    small = ["-n", "9", "--run", str(tmp_path), "--seed", "1"]
    done = command(*small, "--phase", "opt2+norm_bounds", "opt2+fast_root_3", "--json")
    assert done.returncode == 0, done.stderr
    found = emitted.result(done.stdout)
    assert found == json.loads((tmp_path / "ablations.json").read_text())
    rows = {(row["ablation"], row["scene"]): row for row in found["rows"]}
    names = ("opt2+norm_bounds", "opt2+fast_root_3")
    assert rows.keys() == {(name, scene) for name in names for scene in ("scene0", "mandelbulb")}
    row = rows["opt2+norm_bounds", "scene0"]
    assert (row["width"], row["height"], row["step"], row["against"]) == (16, 9, "removed", "opt2")
    assert row["gain"]["low"] <= row["gain"]["value"] <= row["gain"]["high"]
    assert row["gain"]["value"] == pytest.approx(row["ms"]["value"] / row["against_ms"]["value"])
    assert row["verdict"] in ("identical", "within") and row["flops_ratio"] < 1
    assert found["failures"] == found["skipped"] == []

    done = command(
        *small, "--phase", "opt1+bulb", "--launches", "1", "--no-flops", "--scene", "mandelbulb", "trio"
    )
    assert done.returncode == 0, done.stderr
    assert "insufficient" in done.stdout and "1.38×" in done.stdout and verdicts.FEW in done.stdout


def test_ideas_have_a_file_of_their_own(tmp_path):
    """Each on the scenes of its head, which may be made to order, and against its phase's own picture."""
    spec_of("opt9_convex")
    built()
    small = ["-n", "9", "--launches", "1", "--run", str(tmp_path), "--json"]
    small += ["--scene", "scene0", "scattered-256"]
    names = ["opt9_convex+no_query", "opt6_wide+awake", "opt6_wide+rsqrt"]
    done = command("--ideas", *small, "--phase", *names)
    assert done.returncode == 0, done.stderr
    found = emitted.result(done.stdout)
    assert found == json.loads((tmp_path / "ideas.json").read_text())
    rows = {(row["ablation"], row["scene"]): row for row in found["rows"]}
    assert set(rows) == {("opt9_convex+no_query", "scattered-256"), ("opt6_wide+awake", "scene0")}
    query, awake = rows["opt9_convex+no_query", "scattered-256"], rows["opt6_wide+awake", "scene0"]
    assert (query["reference"], awake["reference"]) == ("opt9_convex", "baseline")
    assert query["idea"] and query["lines"] > 100 and query["flops_ratio"] is None
    assert (awake["change_psnr_db"], awake["change_max_abs"]) == (None, 0)  # not one bit


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--phase", "opt1+arays"], 2, "no ablation of opt1 'arays'; did you mean arrays?"),
        (["--phase", "op1"], 2, "no phase 'op1'"),
        (["--scene", "scene9"], 2, "no scene 'scene9'"),
        (["--phase", "opt1+bulb", "--scene", "trio"], 2, "no ablation of these matters on trio"),
        (["-n", "0"], 2, "'0': must be a whole number of at least 1"),
        (["--cpu", "999"], 2, "CPU 999 is not available"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(arguments, status, words):
    done = command(*arguments)
    assert (done.returncode, done.stdout) == (status, "")
    assert words in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_a_cpu_without_the_instructions_is_said():
    done = command("--phase", "opt4", STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 3
    assert "this CPU lacks avx2" in done.stderr


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Path:
    """A tree of its own with opt1: an ablation that is wrong, and one that does not apply any more."""
    root = tmp_path_factory.mktemp("other")
    for name, without in (("common", ()), ("scripts", ()), ("phases/baseline", ("ablations",))):
        ignore = shutil.ignore_patterns("__pycache__", *without)
        shutil.copytree(ROOT / name, root / name, ignore=ignore)
    shutil.copy(ROOT / "Makefile", root)
    for name in ("baseline", "opt1"):
        build(name)
    for name in ("common", "baseline", "opt1"):  # sources with their times: of these make finds nothing to do
        parsed = shutil.ignore_patterns("parsed")  # headers that another make may be writing
        shutil.copytree(ROOT / "build" / name, root / "build" / name, ignore=parsed)
    small_root(root, wrong={"scenes": "scene0"}, stale={})
    stale = root / "phases/opt1/ablations/stale.patch"
    stale.write_text(stale.read_text().replace("0.01", "0.015"))
    return root


def test_a_wrong_picture_is_shown_failing_and_so_is_a_patch_that_does_not_apply(other):
    done = command("--phase", "opt1", "-n", "9", "--launches", "1", "--no-flops", root=other)
    assert done.returncode == 1
    assert "OUTSIDE" in done.stdout
    assert "FAIL opt1+wrong on scene0: identical: not equal bit for bit" in done.stderr
    assert "FAIL opt1+stale: " in done.stderr and "does not apply to opt1/shade.c" in done.stderr


def test_only_a_patch_that_does_not_apply(other):
    done = command("--phase", "opt1+stale", "-n", "9", "--no-flops", root=other)
    assert (done.returncode, done.stdout) == (2, "")
    assert "phases/opt1/ablations/stale.patch:" in done.stderr
    assert "does not apply to opt1/shade.c, which has changed there; make the patch again" in done.stderr
    assert not (other / "build/opt1+stale/source").exists()
