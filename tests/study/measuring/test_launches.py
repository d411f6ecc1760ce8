"""Launches by turns: on which CPUs, told what, in which order."""

from __future__ import annotations

import itertools
import os

import pytest

from study.core import run
from study.core.registry import find_scene
from study.measuring import launches


def test_every_launch_comes_once_a_round() -> None:
    """Meanwhile this process is not on the measured CPU, and the environment's size varies."""
    seen: list[str] = []
    about = set()

    def once(name: str, pad: int) -> float:
        seen.append(name)
        about.add((pad, run.FASTEST in os.sched_getaffinity(0)))
        return float(len(seen))

    times = launches.interleaved({name: lambda pad, n=name: once(n, pad) for name in "abc"}, 4, seed=1)
    assert [sorted(seen[i : i + 3]) for i in range(0, 12, 3)] == [["a", "b", "c"]] * 4
    assert len({tuple(seen[i : i + 3]) for i in range(0, 12, 3)}) > 1, "always the same order"
    assert sorted(itertools.chain(*times.values())) == [float(i) for i in range(1, 13)]
    assert len(about) > 6 and {on for _, on in about} == {len(run.USABLE) == 1}
    assert os.sched_getaffinity(0) == set(run.USABLE)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_launch_is_on_as_many_cpus_as_it_has_threads(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    said = []

    def lines(arguments, cpus, env_bytes, timed=True, more=None):
        said.append((cpus, env_bytes, more))
        frames = [{"ns": ns, "warmup": ns > 5e6} for ns in (9e6, 1e6, 2e6, 4e6)]
        return iter(
            [str({"frames": frames}).replace("'", '"').replace("True", "true").replace("False", "false")]
        )

    monkeypatch.setattr(run, "_lines", lines)
    monkeypatch.setattr(run, "build", lambda *_: "render")
    told = {"STEPWISE_RODS": "down=5"}
    scene = find_scene("trio")
    assert launches.milliseconds("rods", scene, (32, 18), 2, 123, told, threads=threads) == 2
    assert said == [(run.cpu_set(run.FASTEST, threads), 123, told)]
    assert len(said[0][0]) == min(threads, len(run.USABLE))


def test_gains_are_of_the_other_over_this() -> None:
    found = launches.gain([30.0] * 6, [2.0] * 6)
    assert (found.gain, found.gain_low, found.gain_high) == (15.0, 15.0, 15.0)
    assert launches.timed([3.0] * 6).launches == [3.0] * 6
