"""scripts/stepwise try: a phase beside its parent."""

import os
import re
import subprocess
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import emitted
import msgspec
import pytest

from study.commands import try_
from study.core import cli, patches, registry
from study.core.registry import ROOT, Spec
from study.numbers import stats

SMALL = ("--scene", "trio", "-n", "18", "--launches", "2", "--seed", "1")


@pytest.fixture
def tried(monkeypatch, capsys):
    """Runs it in this process: exit status, standard output."""
    monkeypatch.setattr(try_, "SIZES", (45,))

    def call(*words: str) -> tuple[int, str]:
        return emitted.told("try", *words, *SMALL), capsys.readouterr().out

    return call


@pytest.mark.slow
def test_an_ablation_beside_its_phase_as_json(tried):
    """One object; the step that is taken out of opt1 changes no bit and costs calls."""
    status, out = tried("opt2+norm_bounds", "--json")
    said = emitted.whole(out)
    assert (status, said["command"], said["status"], said["run"]) == (0, "try", "ok", None)
    result = said["result"]
    about = {"scene": "trio", "width": 32, "height": 18, "timed_height": 45, "launches": 2, "seed": 1}
    assert about.items() <= result.items()
    parent, mine = result["sides"]
    assert (parent["name"], mine["name"]) == ("opt2", "opt2+norm_bounds") and result["same_bits"]
    assert mine["baseline"]["identical"] and mine["fails"] == [] and mine["lanes_at_work"] == 1
    assert result["ratio"]["value"] == pytest.approx(parent["ms"]["value"] / mine["ms"]["value"], rel=0.2)
    assert mine["flops"] > parent["flops"] and mine["parts"].keys() == parent["parts"].keys()
    changed = {name: (old, new) for name, old, new in result["calls"]}
    for name, (old, new) in changed.items():
        assert (old, new) == (parent["parts"][name]["call"], mine["parts"][name]["call"]) and old != new
    assert Path(result["picture"]).is_file()


@pytest.mark.slow
@pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()["opt4"])), reason="the CPU lacks what opt4 needs"
)
def test_a_phase_outside_its_tolerance_ends_with_status_1_and_says_which(tried, monkeypatch):
    """opt4's floats, if they had to be identical to baseline's doubles."""
    demanding = {"smooth": {"identical": True, "reason": "a test"}}
    strict = msgspec.structs.replace(registry.phases()["opt4"], tolerance=demanding)
    monkeypatch.setitem(registry.phases(ROOT), "opt4", strict)
    compared, told = try_.compared, []
    monkeypatch.setattr(try_, "compared", lambda args: told.append(compared(args)) or told[0])
    status, out = tried("opt4")
    assert status == cli.FAILED and "  identical: " in out
    parent, mine = told[0].sides
    assert mine.fails and not parent.fails


@pytest.mark.parametrize(
    ("name", "costs"),
    [
        ("opt2", "opt2"),
        ("opt12_fused", "opt11_ideal"),
        ("opt5_threads+bands", "opt5_threads"),
        ("opt2+norm_bounds", "opt2+norm_bounds"),
    ],
)
def test_costs_that_are_inherited_are_said_to_be(name, costs):
    """A derived phase declares what its ancestor did, whatever its own files do."""
    assert try_.stated_by(name) == costs
    truth = SimpleNamespace(width=2, height=1, shown=SimpleNamespace(psnr_db=60), of="", wrong_ppm=0)
    metrics = {"identical": True, "fraction_over_1_255": 0}
    side = try_.Side(name, truth, metrics, [], 1.0, flops=8, costs=costs)
    (declared,) = [cell for title, cell in try_.cells(side).items() if "declared" in title]
    assert declared.startswith("4") and (costs in declared) == (costs != name)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["opt1+nothing"], "nothing"),
        (["opt11", "--watch"], "opt1"),
        (["baseline"], "--against"),
    ],
)
def test_a_bad_name_is_said_with_what_would_be_right(words, said):
    with pytest.raises(cli.StudyError, match=said):
        emitted.told("try", *words)


@pytest.mark.parametrize("goal", ["try", "demo", "verify", "hotspots"])
@pytest.mark.parametrize("word", ["NAME", "PHASE"])
def test_both_words_name_a_phase_to_make(goal, word):
    named = {key: text for key, text in os.environ.items() if not key.startswith("MAKE")}
    words = ["make", "-n", goal, f"{word}=opt3"]
    done = subprocess.run(words, cwd=ROOT, env=named, capture_output=True, text=True)
    assert re.search(rf"scripts/stepwise {goal} (--phase )?opt3\b", done.stdout), done.stdout + done.stderr


# --- by hand


def counted(**calls: int) -> SimpleNamespace:
    return SimpleNamespace(by_function={name: SimpleNamespace(calls=n) for name, n in calls.items()})


def test_calls_that_changed_the_largest_difference_first():
    parent = counted(same=5, less=1000, more=10, gone=3, near=1_000_000)
    mine = counted(same=5, less=400, more=90, new=7, near=1_000_900)
    assert try_.calls(parent, mine) == [("less", 1000, 400), ("more", 10, 90), ("new", 0, 7), ("gone", 3, 0)]


@pytest.mark.parametrize(
    ("low", "high", "told"), [(1.1, 1.3, True), (0.7, 0.9, True), (0.9, 1.3, False), (1.0, 1.3, False)]
)
def test_a_ratio_whose_interval_holds_one_tells_nothing(low, high, told):
    ratio = stats.Interval((low + high) / 2, low, high, 10, True)
    assert try_.doubtful(ratio) is not told


# --- --watch


@pytest.fixture
def watched(monkeypatch, tmp_path):
    """`watch` of two phases whose only source is a file here; the runs, with the time of each."""
    source = tmp_path / "march.c"
    source.write_text("")
    monkeypatch.setattr(try_, "POLL", 0.01)
    monkeypatch.setattr(patches, "files", lambda name: {"march.c": source})
    runs: list[tuple[float, list]] = []

    def start(touched: Path, after: float) -> list[tuple[float, list]]:
        """Watches until the second run; `touched` is saved `after` seconds behind the first."""

        def save() -> None:
            time.sleep(after)
            os.utime(touched, (1, 1))

        def run(command: list, check: bool) -> None:
            runs.append((time.monotonic(), command))
            if len(runs) == 2:
                raise KeyboardInterrupt
            threading.Thread(target=save).start()

        monkeypatch.setattr(subprocess, "run", run)
        with pytest.raises(KeyboardInterrupt):
            emitted.told("try", "opt2+norm_bounds", "--watch", "--scene", "trio")
        return runs

    return start


def test_watch_runs_again_after_a_save_and_not_before(watched, tmp_path):
    (first, command), (second, again) = watched(tmp_path / "march.c", 0.3)
    assert 0.3 <= second - first < 5
    assert command == again and command[2:6] == ["try", "opt2+norm_bounds", "--against", "opt2"]


def test_the_patch_of_an_ablation_is_watched_and_its_phase_json():
    both = (Spec.parse("opt2"), Spec.parse("opt2+norm_bounds"))
    names = {str(path.relative_to(ROOT)) for path in try_.files(both)}
    watched = ("ablations/norm_bounds.patch", "phase.json", "march.c")
    assert {f"phases/opt2/{name}" for name in watched} <= names
