"""Ablations: that they build and draw the same picture; what is counted and timed of them."""

from __future__ import annotations

import functools
import json
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from builds import JOBS
from study.core import cli, commands, patches, registry, run
from study.core.build import build, build_together
from study.core.cli import StudyError
from study.core.registry import Spec
from study.counting import flops
from study.experiments.ablations import command, counted, ideas
from study.experiments.ablations import measure as ablations
from study.experiments.ablations.measure import Ablation
from study.experiments.ablations.schema import Ablations, Ideas, Row
from study.numbers import paper, stats, verdicts
from study.pictures import images

pytestmark = pytest.mark.slow

NAMES = [f"{phase}+{title}" for phase in registry.phases() for title in patches.titles(phase)]
BASES = sorted({name.partition("+")[0] for name in NAMES} - {"baseline"})
HEIGHT = 36
SCENES = ("scene0", "mandelbulb", "cubes")
DECLARED = [name for name in NAMES if name.startswith(("baseline", "opt1+", "opt2", "opt3", "opt4"))]


def spec_of(name: str) -> Spec:
    spec = Spec.parse(name)
    if lacking := registry.missing_isa(spec):
        pytest.skip(f"the CPU lacks {', '.join(lacking)}")
    return spec


@functools.cache
def picture(name: str, scene: str, folder: Path) -> images.Picture:
    path = folder / f"{name}-{scene}.exr"
    run.render(name, ideas.find_scene(scene).path, HEIGHT, aov=True, out=path, timed=False)
    return images.read(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    build_together([(Spec.parse(name), "render") for name in ["baseline", *BASES, *NAMES]], JOBS)
    return tmp_path_factory.mktemp("pictures")


# --- every patch there is


@pytest.mark.parametrize("name", NAMES)
def test_its_head_is_understood(name):
    (found, *_), broken = ablations.find([name])
    assert not broken
    assert found.spec == Spec.parse(name) and found.against != found.spec
    assert found.what and "(" in found.paper and found.scenes
    assert registry.find_phase(name).tolerance
    # results/paper/speedups.csv was typed from the text: the same value from the same section.
    if found.claim is not None:
        stated = paper.read("speedups")
        section = re.search(r"section [\d.]+\d", found.paper)
        assert section, f"{name}: names no section"
        assert found.claim in set(stated[stated["source"].str.contains(section[0], regex=False)]["value"])


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", NAMES)
def test_it_builds_without_a_warning(name):
    build(name)


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


@pytest.mark.parametrize("name", [n for n in DECLARED if "costs" not in patches.chain(n)[-1].head])
def test_declared_costs_of_an_ablation_hold_against_the_blocks_that_ran(name):
    """In the build without inlining; an ablation that cannot say its costs says so in its head (costs:)."""
    spec, head = spec_of(name), patches.chain(name)[-1].head
    build(spec, "render-count")
    for scene in map(registry.find_scene, head.get("scenes", "scene0").split()):
        calls = flops.measure("blocks", spec, scene, 12, "calls")
        rows = flops.compare(flops.declared(spec, scene, 12), calls, calls)
        assert len(rows) > 10 and flops.failures(rows) == []


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
    points = np.random.default_rng(1).normal(size=(20_000, 3)) * 3
    raw = subprocess.run([build(name, "probe"), path], input=points.tobytes(), capture_output=True)
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


# --- rows and the command


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


def test_an_approximation_may_be_off_but_not_undefined():
    scene = registry.find_scene("scene0")
    off = {"identical": False, "non_finite": 0}
    assert ablations.judge(ablation(error="coarse"), scene, off)[0] == "approximate"
    assert ablations.judge(ablation(), scene, off)[0] == "OUTSIDE"
    assert ablations.judge(ablation(error="coarse"), scene, off | {"non_finite": 1})[0] == "OUTSIDE"


def ablation(added: bool = True, paper: str = "1.3× (x)", error: str | None = None) -> Ablation:
    specs = Spec.parse("opt1+arrays"), Spec.parse("opt1")
    return Ablation(*specs, added, "w", paper, error, ("scene0",))


def made(added: bool = True, base_ns: float = 10.0, paper: str = "1.3× (x)") -> Row:
    scene = registry.find_scene("scene0")
    mine, base = (Spec.parse("opt1+arrays"), "scene0"), (Spec.parse("opt1"), "scene0")
    metrics = dict.fromkeys(("fraction_over_1_255", "max_abs", "mask_mismatch_ppm"), 0.0)
    metrics |= {"identical": True, "psnr_db": math.inf, "non_finite": 0}
    judged = {(Spec.parse(who), case): metrics for who in ("baseline", "opt1") for case in (mine, base)}
    times = {mine: [5.0] * 6, base: [base_ns] * 6}
    return ablations.row_of(ablation(added, paper), scene, (16, 9), times, judged)


@pytest.mark.parametrize(("added", "gain"), [(True, 2.0), (False, 0.5)])
def test_the_gain_is_the_steps_whichever_side_has_it(added, gain):
    row = made(added)
    assert row.gain.value == row.gain.low == gain
    assert (row.verdict, row.psnr_db, row.paper_value) == ("identical", None, 1.3)


def test_a_step_that_was_given_up_says_why():
    slow, fast = (made(base_ns=ns, paper="not satisfying (x)") for ns in (4.0, 10.0))
    assert slow.claim == verdicts.HOLDS and ablations.said(slow).endswith(": no faster")
    without = ablations.said(slow)
    slow.failed = ["psnr_db"]
    assert ablations.said(slow) not in (without, verdicts.HOLDS, verdicts.FAILS)
    assert ablations.said(fast) == fast.claim == verdicts.FAILS


def called(*words: object) -> cli.Outcome:
    return commands.called("ablations", list(map(str, words)))[0]


def test_the_table(tmp_path):
    names = ("opt2+norm_bounds", "opt2+fast_root_3")
    assert called("-n", 9, "--run", tmp_path, "--phase", *names).ended == 0
    found = Ablations.load(tmp_path / "ablations.json")
    rows = {(row.ablation, row.scene): row for row in found.rows}
    assert rows.keys() == {(name, scene) for name in names for scene in ("scene0", "mandelbulb")}
    row = rows["opt2+norm_bounds", "scene0"]
    assert (row.width, row.height, row.step, row.against) == (16, 9, "removed", "opt2")
    value, low, high = row.gain.ends
    assert low <= value <= high and value == pytest.approx(row.ms.ends[0] / row.against_ms.ends[0])
    assert row.verdict in ("identical", "within")
    assert found.failures == found.skipped == [] and found.launches == 10


COUNTS = "opt12_fused+span_clock"


def test_counts_are_shares_and_core_cycles_of_all_pixels(tmp_path, monkeypatch):
    """Two frames of 100 pixels: a core cycle is half a tick, and the frame has 4 a pixel that no line has."""

    def render(name, path, height, width, *, told, **how):
        Path(told["STEPWISE_COUNTS"]).write_text("50 1000 sky\n150 2000 plane, dark\n")
        frame = {"warmup": False, "core_cycles": 19.0 * width * height, "tsc_cycles": 38.0 * width * height}
        return {"frames": [frame | {"warmup": True, "core_cycles": 1e9}, frame, frame]}

    monkeypatch.setattr(run, "render", render)
    monkeypatch.setattr(counted, "HEIGHT", 9)
    rows = counted.measure([COUNTS], launches=6, seed=1, cpu=0)
    assert [(row.name, row.share, row.cycles.value) for row in rows] == [
        ("sky", 0.25, 2.5),
        ("plane, dark", 0.75, 5.0),
        (counted.REST, 0.0, 11.5),
    ]
    run_folder = tmp_path / "zen9"
    run_folder.mkdir()
    result = Ideas(schema=1, rows=[], skipped=[], failures=[], counted=rows)
    (run_folder / "ideas.json").write_text(json.dumps(cli.plain(result)))
    text = f"before\n{counted.BEGIN}\n| old |\n| --- |\n\nafter\n"
    made = counted.lesson("opt12_fused", text, run_folder)
    assert made.startswith(f"before\n{counted.BEGIN}\n| class of span") and made.endswith(" |\n\nafter\n")
    assert "old" not in made and "| sky | 25.0 % | 10 |" in made
    assert counted.lesson("opt12_fused", made, run_folder) == made
    assert counted.lesson("opt11_ideal", text, run_folder) == text


def test_ideas_have_a_file_of_their_own(tmp_path):
    """Each on the scenes of its head, and against its phase's own picture."""
    spec_of("opt6_wide")
    words = ["-n", 9, "--launches", 1, "--run", tmp_path, "--scene", "scene0"]
    assert called("--ideas", *words, "--phase", "opt6_wide+awake", "opt6_wide+rsqrt").ended == 0
    (row,) = Ideas.load(tmp_path / "ideas.json").rows
    assert (row.ablation, row.scene, row.reference) == ("opt6_wide+awake", "scene0", "baseline")
    assert row.idea and row.lines
    assert (row.change_psnr_db, row.change_max_abs) == (None, 0)  # not one bit


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--phase", "opt1+arays"], "arrays"),
        (["--scene", "scene9"], "scene9"),
        (["--phase", "opt1+bulb", "--scene", "trio"], "trio"),
        (["--cpu", "999"], "999"),
    ],
)
def test_names_that_there_are_not(words, said):
    with pytest.raises(StudyError, match=said):
        called(*words)


def test_a_wrong_picture_fails_and_so_does_a_patch_that_does_not_apply(tmp_path, monkeypatch):
    wrong = made()
    wrong.verdict, wrong.failed = "OUTSIDE", ["identical: no"]
    monkeypatch.setattr(command.Study, "measure", lambda self: [wrong])
    stale = {"opt1+stale": StudyError("does not apply")}
    monkeypatch.setattr(command, "find", lambda names: ([ablation()], stale))
    found = called("-n", 9, "--run", tmp_path)
    assert found.ended == cli.FAILED and len(found.failed) == 2
    assert [one.ablation for one in Ablations.load(tmp_path / "ablations.json").failures] == ["opt1+stale"]
    monkeypatch.setattr(command, "find", lambda names: ([], stale))
    with pytest.raises(StudyError, match="does not apply"):
        called("-n", 9, "--run", tmp_path)
