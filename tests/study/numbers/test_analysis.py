"""Launches of a configuration from its frames, and what is said of their noise."""

from __future__ import annotations

import re

import complete
import pandas as pd
import pytest

from study.core.run_schema import Frame
from study.numbers import analysis, noise
from study.numbers.analysis import Cell, Facts


def cell(times: list[float], spec: str = "opt1") -> Cell:
    return Cell("s", spec, 16, 9, 1, Facts(), pd.DataFrame({"ns": times}, dtype=float))


def test_a_launch_counts_by_the_median_of_its_timed_frames_in_its_first_ones_round():
    rows = []
    for launch, (timed, rounds) in enumerate((((5, 1, 30), (4, 5, 6)), ((10, 20), (7, 7)))):
        about = {"launch": launch, "config": "c", "phase": "opt1", "flags_from": "opt1", "scene": "s"}
        about |= {"prepare_ns": 100, "width": 16, "height": 9, "threads": 1}
        for number, (ns, turn) in enumerate(((1000, 3), *zip(timed, rounds, strict=True)), -1):
            told = about | {"frame": number, "warmup": number < 0, "ns": ns, "round": turn}
            rows.append(complete.filled(told, Frame) | {"spec": "opt1"})
    frames = pd.DataFrame(rows)
    (found,) = analysis.cells_of(frames)
    assert found.values.ns.tolist() == [5, 15] and found.values.frames.tolist() == [3, 2]
    assert found.values.index.tolist() == [4, 7]
    assert found.values.setup_first_ns.tolist() == [1100, 1100] and not found.facts.unwarmed
    assert analysis.cells_of(frames.drop(columns="round"))[0].values.index.isna().all()


WHY = "general: cc took longer than its time limit, 60 s"


@pytest.mark.parametrize(
    ("kernels", "said", "of"),
    [
        (["generated", "generated"], "generated", []),
        ([WHY, WHY], WHY, []),
        ([WHY, "generated", "generated"], WHY, ["1", "3"]),
        (["generated", WHY], WHY, ["1", "2"]),
    ],
)
def test_one_that_had_no_kernel_does_not_hide_among_those_that_had(kernels, said, of) -> None:
    found = analysis.kernel_said(pd.Series(kernels))
    assert found.startswith(said) and re.findall(r"\d+", found.removeprefix(said)) == of
    assert analysis.kernel_said(pd.Series([None, None])) is None


def test_what_is_far_apart_is_told_apart():
    times = [100.0, 101, 99, 100.5, 99.5, 100.2]
    some = [cell(times, "a"), cell(times[::-1], "same"), cell([2 * ns for ns in times], "far")]
    (said,) = noise.indistinguishable([*some, cell(times, "third")])
    assert all(pair in said for pair in ("a and same", "a and third", "same and third")) and "far" not in said
    (said,) = noise.indistinguishable([cell(times[:2], "a"), cell([9.0] * 2, "b")])
    assert "3 launches" in said


@pytest.mark.parametrize(
    "times",
    [
        [100, 101, 99, 100, 102, 100],
        [100, 100, 100, 100, 100, 104],  # far by the spread of the others, but under 5 %
        [100, 100, 100, 100, 100, 105],  # and no more than that
        [120, 110, 90, 105, 95, 112],  # over 5 % off, but so are all
    ],
)
def test_a_wobble_is_no_outlier(times):
    assert noise.remarks(pd.DataFrame(), [cell(times)]) == []


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([150, 100, 101, 99, 100, 101], "1.49 times"),
        ([150, 100, 101], "1.49 times"),
        ([100, 101, 150, 99, 100, 101], "1 of 6 launches"),
    ],
)
def test_slow_launches_are_named(times, words):
    (warning,) = noise.remarks(pd.DataFrame(), [cell(times)])
    assert warning.startswith("opt1 s n=9 ") and words in warning
