"""`stepwise flops` for real, and Table 1: what the phases declare against the blocks that ran."""

import dataclasses
import os
import subprocess
import sys

import emitted
import pytest
import started

from study.core import cli, commands, registry
from study.core.registry import ROOT, Spec
from study.counting import costs, flops
from study.counting.schema import Declared, Executed, Flops, Function, Measurement, Row
from study.experiments.flops import chapter, table1

DECLARING = sorted(name for name in registry.phases() if costs.declares(name))
CHECKED = [name for name in DECLARING if name in registry.ladder()]


def picture(phase: str, paper: int, machine: int, **more) -> Declared:
    about = {"phase": phase, "scene": "scene0", "width": 1280, "height": 720, "by_function": {}}
    about |= {"by_class": {"compare": 0, "call": 0}, "useful": machine, "useful_paper": paper}
    return Declared(**about | {"executed": machine} | more, flops=Flops(paper=paper, machine=machine))


def test_table1_against_the_paper_and_by_hand():
    sdf = {"sdf": Function(lanes=50, calls=50, machine=100, paper=100)}
    base = picture("baseline", 100, 100, by_function=sdf)
    more = {"executed": 60, "useful": 30, "useful_paper": 30, "by_class": {"compare": 5, "call": 0}}
    first, second = table1.rows([base, picture("opt1", 60, 70, by_function=sdf, **more)])
    assert first.paper_gflop == pytest.approx(20.68) and first.cut is None
    assert first.flop_per_evaluation == 2 and first.evaluations_million == 50e-6
    assert second.cut == pytest.approx(0.7)  # half of its 60 are useful: 30 of 100 are left
    assert second.paper_cut == pytest.approx(0.51)
    giga = [second.paper_convention_gflop, second.machine_convention_gflop, second.compare_gop]
    assert giga == pytest.approx([60e-9, 70e-9, 5e-9])
    assert second.useful_share == 0.5


def test_a_phase_without_costs_has_what_was_measured():
    total = Executed(calls=1, machine=25, instructions=9, operations=[], load_bytes=0, store_bytes=0)
    about = {"backend": "blocks", "variant": "shipped", "total": total, "functions": {}, "outside": None}
    about |= {"calibrated": True, "scene": "scene0", "width": 1280, "height": 720}
    bare = Declared(phase="opt9_convex", scene="scene0", width=1280, height=720, by_function={})
    several = [Measurement(phase=name, **about) for name in ("opt9_convex", "baseline")]
    rows = table1.rows([picture("baseline", 100, 50), bare], several)
    assert [(row.phase, row.measured_gflop, row.measured_cut) for row in rows] == [
        ("baseline", None, None),
        ("opt9_convex", 25e-9, 0.5),
    ]
    assert rows[1].gflop == 25e-9 and table1.terms([bare]) == []


def test_flops_per_evaluation_stand_only_where_evaluations_are_the_work():
    """A Mandelbulb that is drawn almost without `sdf`: two shapes, four iterations."""
    own = {name: Function(lanes=80, calls=10) for name in ("sdf", "sdf_plane", "sdf_mandelbulb")}

    def evaluations(**more: Function) -> int | None:
        return table1.evaluations(picture("opt4", 1, 1, scene="mandelbulb", by_function=own | more))

    assert evaluations() == evaluations(bulb_step=Function(lanes=2 * 4 * 80, calls=80)) == 80
    assert evaluations(bulb_step=Function(lanes=2 * 4 * 80 + 1, calls=81)) is None
    assert evaluations(sdf=Function(lanes=0, calls=0)) is None


def test_every_function_of_the_ladder_that_declares_costs_has_a_term():
    names = {
        cost.function
        for phase in ("baseline", "opt1", "opt2", "opt3", "opt4")
        for cost in costs.of_phase(phase)
    }
    assert {name for name in names if table1.term_of(name) == table1.OTHER} <= {"exp_of", "log_of"}


@pytest.mark.slow
@pytest.mark.parametrize("phase", DECLARING)
def test_costs_def_reads_as_the_compiler_reads_it(phase):
    """Parts and their FLOPs by Python, against a picture's by the counting build."""
    if not registry.cpu_supports(registry.find_phase(phase)):
        pytest.skip("the CPU lacks what it needs")
    beside = registry.find_phase(phase).family == registry.SYSTEMS  # not every one of them draws a torus
    made = flops.declared(Spec(phase, phase), registry.find_scene("two_spheres" if beside else "trio"), 12)
    lines = {(c.function, c.part): c for c in costs.of_phase(phase)}
    lanes = registry.variant_here(registry.find_phase(phase)).lanes
    parts = {(f, p): n for f, one in made.by_function.items() for p, n in one.parts.items()}
    assert parts.keys() == lines.keys()
    for kind, total in made.by_class.items():
        by_hand = sum(
            n * lines[key].per_lane[kind] * (lanes if lines[key].width == "LANES" else 1)
            for key, n in parts.items()
        )
        if kind == "call":  # a function that stands for a math.h call is one, whatever is inside
            by_hand += sum(
                n * lanes for (f, p), n in parts.items() if lines[f, p].stands_for_call and p == "call"
            )
        assert by_hand == total, kind


def test_each_scene_and_phase_has_its_picture():
    """720 where it was counted, also beside a larger one; else the largest. Other flags are left out."""
    sizes = [("scene0", "baseline", 90), ("scene0", "baseline", 720), ("scene0", "baseline", 1080)]
    sizes += [("trio", "baseline", 90), ("trio", "baseline", 45), ("scene0", "opt1", 180)]
    several = [picture(phase, 1, 1, scene=scene, height=height) for scene, phase, height in sizes]
    several.append(picture("opt1", 1, 1, height=360, flags_from="opt2"))
    shown = {(one.scene, one.phase, one.height) for one in chapter._pictures(several)}
    assert shown == {("scene0", "baseline", 720), ("trio", "baseline", 90), ("scene0", "opt1", 180)}


def test_back_ends_are_summed_apart():
    def row(backend: str, within: bool = True) -> Row:
        about = {"phase": "opt1", "flags_from": "opt1", "scene": "s", "counted": 1, "measured": 1}
        return Row(**about, scope="calls of sdf", backend=backend, within=within)

    rows = [row("blocks"), row("blocks"), row("ptrace"), row("ptrace", within=False)]
    _, *said = chapter._said(rows, rows)
    assert "2 of 2" in said[0] and "blocks" in said[0]
    assert "1 of 2" in said[1] and "ptrace" in said[1]


def command(*arguments: object, **environment: str) -> subprocess.CompletedProcess:
    words = [sys.executable, str(ROOT / "scripts" / "stepwise"), "flops", *map(str, arguments)]
    return started.run(words, env=os.environ | environment, timeout=300)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--phase", "optt1"], "opt1"),
        (["--scene", "scene1", "-n", 9], "scene0"),
        (["-n", 0], "at least 1"),
        (["--backend", "ptrace"], "--validate"),
        (["--run", "/nowhere"], "not a run"),
    ],
)
def test_bad_arguments_are_status_2(arguments, said, stepwise):
    done = stepwise("flops", *arguments)
    assert done.returncode == 2 and said in done.stderr


def test_phases_that_the_cpu_lacks_are_left_out():
    done = command("--phase", "opt4", "-n", 9, STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 3 and "avx2" in done.stderr


@pytest.mark.slow
def test_what_was_measured_is_shown_without_a_run():
    done = command("--measure", "--phase", "baseline", "--scene", "trio", "-n", 9, "--json")
    found = emitted.result(done.stdout)
    (one,), (row,) = found["measured"], found["table1"]
    assert done.returncode == 0 and one["backend"] == "blocks" and one["total"]["machine"] > 0
    assert row["phase"] == "baseline" and row["width"] == 16 and row["paper_gflop"] is None


@pytest.mark.slow
@pytest.mark.parametrize("phase", CHECKED)
def test_declared_costs_hold_against_the_blocks_that_ran(phase):
    """The whole chain on a scene with a mirror, soft shadows, fog and a rotation."""
    if not registry.cpu_supports(registry.find_phase(phase)):
        pytest.skip("the CPU lacks what it needs")
    done = command("--validate", "--phase", phase, "--scene", "trio", "-n", 24, "--json")
    assert done.returncode == 0, done.stderr
    rows = emitted.result(done.stdout)["rows"]
    assert len([row for row in rows if row["judged"]]) > 10 and all(row["calibrated"] for row in rows)
    if phase == "opt2":  # where gcc makes branches of minima, and the raw difference is some 10 %
        (row,) = (row for row in rows if (row["scope"], row["variant"]) == ("total", "shipped"))
        assert row["explained_to"] + row["unexplained"] < 0.01


@pytest.mark.slow
def test_a_wrong_cost_is_found(monkeypatch):
    """One sum too many in the sphere's distance: exit status 1, and the function named."""

    def wrong(name: str) -> list[costs.Cost]:
        lines = costs.read(registry.find_phase(name).file("costs.def"))
        return [
            dataclasses.replace(one, per_lane=one.per_lane | {"add": 2})
            if one.function == "sdf_sphere"
            else one
            for one in lines
        ]

    monkeypatch.setattr(costs, "of_phase", wrong)
    words = ["--validate", "--phase", "baseline", "--scene", "spheres40", "-n", "8"]
    found, _ = commands.called("flops", words)
    assert found.ended == cli.FAILED
    assert any("spheres40 sdf_sphere" in line for line in found.failed)
    assert "phases/baseline/costs.def" in found.failed[-1]
