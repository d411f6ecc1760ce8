"""--shard K/N: the parts are all of the work, each unit once, and joined they are what one run writes."""

from __future__ import annotations

import argparse
import json
import sys

import pytest
import started
from hypothesis import given
from hypothesis import strategies as st

from study.core import cli
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments import experiment, shards
from study.experiments.shards import Shard

STEPWISE = ROOT / "scripts" / "stepwise"
SHARDED = {name: one.sharded for name, one in experiment.find_all().items() if one.sharded}


@given(st.integers(1, 700).flatmap(lambda units: st.tuples(st.just(units), st.integers(1, units))))
def test_the_parts_are_all_units_in_order_each_once_and_alike_in_size(pair: tuple[int, int]) -> None:
    units, of = pair
    parts = [shards.part(range(units), Shard(number, of)) for number in range(1, of + 1)]
    assert [unit for one in parts for unit in one] == list(range(units))
    sizes = {len(one) for one in parts}
    assert min(sizes) >= 1 and max(sizes) - min(sizes) <= 1


def test_more_shards_than_units_are_refused_and_no_shard_is_everything() -> None:
    with pytest.raises(StudyError, match=r"--shard 1/4: .* 3"):
        shards.part("abc", Shard(1, 4))
    assert shards.part("abc", None) == ["a", "b", "c"]


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "1/0", "-1/2", "1/2/3", "a/b", "1/2 ", "", "1/٣"])
def test_what_is_no_shard_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="K/N"):
        shards.parse(text)


def test_a_shard_is_read_and_its_file_has_another_name() -> None:
    assert shards.parse("2/8") == Shard(2, 8)
    assert shards.file_name("accuracy.json", Shard(2, 8)) == "accuracy.shard-2-of-8.json"
    assert shards.file_name("accuracy.json", None) == "accuracy.json"


def made(number: int, of: int, **more: object) -> dict[str, object]:
    return {"shard": {"number": number, "of": of}, "tool": "a", "rows": [number], "skipped": ["x"], **more}


def test_joined_by_hand() -> None:
    """Rows one after another; what each shard says of the whole (a phase that cannot run) is said once."""
    parts = [made(1, 3), made(2, 3, skipped=["x", "z"]), made(3, 3, skipped=["x", "y"])]
    whole = {"tool": "a", "rows": [1, 2, 3], "skipped": ["x", "z", "y"]}
    assert shards.join(parts, ["rows", "skipped"]) == whole


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ([made(1, 2)], "1 to 1"),
        ([made(1, 2), made(1, 2)], "once"),
        ([made(2, 2), made(1, 2)], "in order"),
        ([made(1, 2), made(2, 3)], "1 to 2"),
        ([{"rows": []}], "1 to 1"),
        ([made(1, 2), made(2, 2, tool="b")], "'tool'"),
    ],
)
def test_what_is_no_whole_is_not_joined(parts: list[dict[str, object]], said: str) -> None:
    with pytest.raises(StudyError, match=said):
        shards.join(parts, ["rows", "skipped"])


def stepwise(*words: object) -> str:
    done = started.run([sys.executable, STEPWISE, *map(str, words)])
    assert done.returncode in (cli.OK, cli.FAILED), done.stderr
    return done.stderr


CASES = {
    "accuracy": ["--phase", "opt1", "opt4", "--scene", "trio", "mandelbulb", "-n", "16"],
    "animation": ["--scene", "spheres40_animated", "--phase", "opt4", "--frames", "4", "-n", "16"],
    "random": ["--kind", "any", "cache", "--seeds", "1", "--scenes", "1", "--executions", "500"],
    "truth": ["--scene", "trio", "two_spheres", "mandelbulb", "-n", "12"],
    "stability": ["--phase", "baseline", "opt4", "--case", "7", "8", "21", "--strengths", "few"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_two_shards_joined_are_the_bytes_of_one_run(name: str, tmp_path) -> None:
    words, file = CASES[name], SHARDED[name].file
    stepwise(name, *words, "--run", tmp_path / "whole")
    for number in (2, 1):
        stepwise(name, *words, "--run", tmp_path / str(number), "--shard", f"{number}/2")
        assert not (tmp_path / str(number) / file).exists()  # of which any reader would think it is the whole
    parts = [
        json.loads((tmp_path / str(n) / shards.file_name(file, Shard(n, 2))).read_text()) for n in (1, 2)
    ]
    whole = shards.join(parts, SHARDED[name].lists)
    assert json.dumps(whole, indent=2) + "\n" == (tmp_path / "whole" / file).read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["stability", "--case", "7", "8", "--shard", "1/3"], "--shard 1/3: "),
        (["accuracy", "--phase", "opt1", "--scene", "trio", "--shard", "2/2"], " 1"),
        (["accuracy", "--shard", "3/2"], "argument --shard: '3/2'"),
    ],
)
def test_bad_shards_are_one_line(words: list[str], said: str, tmp_path, stepwise) -> None:
    done = stepwise(*words, "--run", tmp_path / "run")
    assert done.returncode == cli.BAD_INPUT and said in done.stderr.splitlines()[-1]
    assert not (tmp_path / "run").exists()
