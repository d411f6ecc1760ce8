"""Sweeps by rule: the plan, its rounds and its budget, with a clock and a driver that are made up."""

import argparse
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.core import commands, registry, store
from study.core.cli import StudyError
from study.core.run import DriverError
from study.core.run_schema import Configuration, Plan
from study.experiments.sweep import command as module
from study.experiments.sweep import plan as planning

# The plan


@pytest.mark.parametrize(
    ("text", "size"),
    [("720", (None, 720)), ("1", (None, 1)), ("800x600", (800, 600)), ("9x32768", (9, 32768))],
)
def test_sizes(text, size):
    assert module.size(text) == size


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "x", "8x", "x8", "0x8", "32768x32768", "20000", ""])
def test_bad_sizes_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError):
        module.size(text)


@pytest.mark.parametrize(
    ("names", "second_base", "specs"),
    [
        ("opt1 opt1 opt2", True, "opt1 opt2"),
        ("opt3 opt4", True, "opt3 opt4 opt2@opt3"),
        ("opt4 opt3", True, "opt4 opt3 opt2@opt4"),
        ("opt3 opt4", False, "opt3 opt4"),
        ("opt2@opt4 opt3 opt4", True, "opt2@opt4 opt3 opt4"),
        ("opt2@opt1 opt2", True, "opt2"),
        ("opt2@opt3 opt2@opt4", True, "opt2@opt3"),
        ("opt3@opt4 opt3", True, "opt3 opt2@opt3"),
        ("opt4 opt5_threads opt6_wide", True, "opt4 opt5_threads opt6_wide opt2@opt4"),
        ("opt6_wide opt4", True, "opt6_wide opt4 opt2@opt6_wide"),
    ],
)
def test_specs_are_different_programs_with_the_second_base(names, second_base, specs):
    found = planning.wanted_specs(names.split(), second_base)
    assert [str(spec) for spec in found] == specs.split()


# Rounds and budget


def config(number: int, scene: str, seconds: float) -> Configuration:
    about = {"spec": "opt1", "phase": "opt1", "flags_from": "opt1", "scene_hash": "h", "width": 16}
    return Configuration(config=f"c{number}", scene=scene, height=9, estimate_s=seconds, **about)


def planned(costs: dict[str, list[float]], budget=None, launches=4, seed=1) -> module.Sweep:
    numbers = iter(range(1000))
    configs = [config(next(numbers), scene, s) for scene, several in costs.items() for s in several]
    plan = Plan(seed=seed, launches=launches, reps=2, warmup=1, configurations=configs)
    return module.Sweep(None, plan, budget)


COSTS = st.dictionaries(
    st.sampled_from("abcdef"), st.lists(st.floats(0.01, 100), min_size=1, max_size=5), min_size=1
)


@settings(deadline=None)
@given(COSTS, st.floats(0, 1000))
def test_a_round_takes_whole_comparisons_within_the_budget(costs, budget):
    made = planned(costs, budget)
    chosen = made.round(0)
    taken = {scene for scene in costs if any(c.scene == scene for c in chosen)}
    for scene in costs:
        assert sum(c.scene == scene for c in chosen) in (0, len(costs[scene]))
    assert sum(c.estimate_s for c in chosen) <= budget
    left_out = [sum(costs[scene]) for scene in costs if scene not in taken]
    if left_out:  # nothing is left out that is cheaper than what is in, or that would still fit
        assert min(left_out) >= max((sum(costs[scene]) for scene in taken), default=0)
        assert sum(c.estimate_s for c in chosen) + min(left_out) > budget * (1 - 1e-9) - 0.1


def test_a_round_is_a_shuffle_that_the_seed_fixes():
    costs = {"a": [1.0] * 8, "b": [1.0] * 8}
    orders = [[c.config for c in planned(costs, seed=seed).round(n)] for seed in (1, 2) for n in (0, 1)]
    assert orders[0] == [c.config for c in planned(costs, seed=1).round(0)]
    assert len(set(map(tuple, orders))) == 4
    assert all(sorted(order) == sorted(orders[0]) for order in orders)


def play(made: module.Sweep, budget=float("inf"), crash=(), actual=None) -> list[tuple[str, int]]:
    """Let the sweep measure with a clock and a driver that are made up; returns (config, launch).

    `crash`: configs, or (config, round); `actual`: config -> seconds where they are not as estimated.
    """
    clock, launched = [0.0], []
    made.deadline = budget

    def launch(config: Configuration) -> None:
        number = made.done(config)
        launched.append((config.config, number))
        clock[0] += (actual or {}).get(config.config, config.estimate_s)
        if {config.config, (config.config, made.now)} & set(crash):
            raise DriverError(-11, "killed by SIGSEGV")
        made.frames[(config.config, number)] = set(range(-1, made.plan.reps))

    made.launch = launch
    real, module.time.monotonic = module.time.monotonic, lambda: clock[0]
    try:
        made.measure()
    finally:
        module.time.monotonic = real
    return launched


def test_without_budget_every_configuration_is_launched_once_a_round():
    made = planned({"a": [1, 2], "b": [3]}, launches=3)
    launched = play(made)
    for number in range(3):
        assert sorted(launched[3 * number : 3 * number + 3]) == [(f"c{c}", number) for c in range(3)]
    assert len(launched) == 9


def test_fewer_launches_are_spread_over_the_rounds():
    made = planned({"a": [1, 2]}, launches=6)
    made.plan.configurations[0].launches = 3
    assert made.remaining() == 3 * 1 + 6 * 2
    launched = play(made)
    assert [name for name, _ in launched].count("c0") == 3 and len(launched) == 9
    rounds = [launched.index(("c1", number)) for number in range(6)]
    for number in range(3):  # one in each two rounds
        place = launched.index(("c0", number))
        assert rounds[2 * number] - 1 <= place <= rounds[2 * number] + 1


def test_a_comparison_left_out_for_a_round_comes_back_when_it_fits():
    costs = {"dear": [10], "cheap": [4]}
    both = [("c0", 0), ("c1", 0), ("c1", 1)]
    assert sorted(play(planned(costs, launches=2), budget=27)) == both
    assert sorted(play(planned(costs, launches=2), budget=28)) == [*both[:1], ("c0", 1), *both[1:]]
    # Beside the cheap one it does not fit, but then that one takes less than expected.
    assert play(planned(costs, launches=1), budget=13) == [("c1", 0)]
    assert play(planned(costs, launches=1), budget=13, actual={"c1": 2}) == [("c1", 0), ("c0", 0)]


def test_a_crash_is_recorded_and_the_rest_goes_on(tmp_path, capsys):
    made = planned({"a": [1, 1, 1]}, launches=4)
    made.run = store.Run(tmp_path / "run")
    launched = play(made, crash={"c1"})
    assert [name for name, _ in launched].count("c1") == module.MOST_CRASHES
    assert [name for name, _ in launched].count("c0") == 4
    assert [(f.scene, f.launch, f.status) for f in made.run.plan.failures] == [("a", 0, -11)] * 2
    assert "SIGSEGV" in capsys.readouterr().err


def test_a_lost_launch_is_made_up_for_in_a_round_of_its_own(tmp_path):
    """The second of four rounds is lost: its launch is of the third, the last of a fifth."""
    made = planned({"a": [1, 1]}, launches=4)
    made.run, made.rounds = store.Run(tmp_path / "run"), 7
    rounds = []
    made.frames = Noted(lambda key: rounds.append((*key, made.now)))
    play(made, crash={("c1", 8)})
    assert sorted(rounds) == [
        *(("c0", launch, 7 + launch) for launch in range(4)),
        *(("c1", launch, 7 + launch + (launch > 0)) for launch in range(4)),
    ]


class Noted(dict):
    """Tells of every key that is set."""

    def __init__(self, tell) -> None:
        super().__init__()
        self.tell = tell

    def __setitem__(self, key, value) -> None:
        self.tell(key)
        super().__setitem__(key, value)


@pytest.mark.parametrize("digest, said", [(None, "scene cubes"), ("0" * 64, "build/opt1/render")])
def test_a_changed_scene_or_program_is_not_mixed_in(tmp_path, digest, said):
    made = planned({"cubes": [1]})
    made.run = store.Run(tmp_path)
    made.plan.binaries["opt1"] = digest or planning.sha256(module.build(registry.Spec("opt1", "opt1")))
    with pytest.raises(StudyError, match=said):
        made.launch(made.configs[0])
    assert not (tmp_path / "frames.jsonl").exists()


def test_scenes_of_one_content_are_told_apart(monkeypatch):
    """A copy of a scene, before its first change: launches of the one must not count as the other's."""
    picture = {"frames": [{"ns": 1e6}], "width": 16, "height": 9, "scene_hash": "h"}
    monkeypatch.setattr(planning.run, "render", lambda *_, **__: picture)
    monkeypatch.setattr(planning, "build", lambda spec: Path(__file__))
    options = {"phase": ["baseline"], "scene": ["cubes", "trio"], "n": [(None, 9)], "threads": [1]}
    options |= {"second_base": False, "hit_distance": None, "max_steps": None, "budget": None, "cpu": 0}
    options |= {"seed": 1, "launches": 1, "reps": 3, "warmup": 1, "long": None, "few": None}
    configurations = planning.make_plan(argparse.Namespace(**options)).configurations
    assert len({one.config for one in configurations}) == len(configurations) == 2


@pytest.mark.parametrize(
    ("long", "asked", "once"),
    [(0.25, [180], [False, False]), (0.09, [180], [False, True]), (0.019, [90], [True, True])],
)
def test_whether_a_frame_is_long_is_seen_at_its_own_size(monkeypatch, long, asked, once):
    """Made up: 20 ms at n = 45, at 90 as long again, at 180 100 ms; by its pixels 80 and 320. A tiny frame
    says that both heights are near to --long, only one is, or the larger is long by far."""
    sizes = []

    def render(spec, path, height, width, **how):
        if height != planning.CALIBRATION_HEIGHT:
            sizes.append(height)
            assert (how["reps"], how["warmup"]) == (1, 0)
        ns = {45: 20e6, 90: 20e6, 180: 100e6}[height]
        return {"frames": [{"ns": ns}], "width": width, "height": height, "scene_hash": "h"}

    monkeypatch.setattr(planning.run, "render", render)
    monkeypatch.setattr(planning, "build", lambda spec: Path(__file__))
    options = {"phase": ["baseline"], "scene": ["cubes"], "n": [(None, 90), (None, 180)], "threads": [1]}
    options |= {"second_base": False, "hit_distance": None, "max_steps": None, "budget": None, "cpu": 0}
    options |= {"seed": 1, "launches": 1, "reps": 3, "warmup": 1, "long": long, "few": 0.09}
    plan = planning.make_plan(argparse.Namespace(**options))
    assert [one.once for one in plan.configurations] == once and sizes == asked
    guessed, seen = {90: 0.08, 180: 0.32}, {90: 0.02, 180: 0.1}
    known = guessed | {height: seen[height] for height in asked}
    assert [one.launches for one in plan.configurations] == [3 * (known[n] > 0.09) for n in (90, 180)]


@pytest.mark.parametrize(
    ("words", "added"),
    [
        ([], True),
        (["--no-second-base"], False),
        (["--phase", "opt3", "opt4"], False),
        (["--phase", "opt3", "opt4", "--second-base"], True),
        (["--phase", "mine", *registry.ladder()], True),
    ],
)
def test_only_a_sweep_of_the_whole_ladder_adds_a_second_base(words, added):
    parser = commands.parser_for("sweep", module)
    assert module.with_defaults(parser.parse_args(words)).second_base is added
