"""Quotas and throttling of control groups, versions 1 and 2, from made-up trees."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from study.core import machine
from study.core.host import quotas
from study.experiments.sweep import command as sweep
from study.report import facts


@pytest.fixture
def tree(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    def make(cgroup: str, files: dict[str, str]) -> None:
        monkeypatch.setattr(quotas, "CGROUP", tmp_path / "self")
        monkeypatch.setattr(quotas, "MOUNTED", tmp_path / "fs")
        (tmp_path / "self").write_text(cgroup)
        for name, text in files.items():
            (tmp_path / "fs" / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "fs" / name).write_text(text)

    return make


STAT = "usage_usec 1\nnr_periods 9\nnr_throttled {}\nthrottled_usec 5\n"


def test_version_2_the_narrowest_group_above(tree) -> None:
    tree(
        "0::/pod/box\n",
        {
            "pod/cpu.max": "150000 100000\n",
            "pod/box/cpu.max": "max 100000\n",
            "pod/box/cpu.stat": STAT.format(3),
            "pod/cpu.stat": STAT.format(4),
            "pod/box/memory.max": "max\n",
            "pod/memory.max": "4294967296\n",
        },
    )
    assert quotas.limits() == {"cpus": 1.5, "memory_bytes": 1 << 32, "throttled": 7}


def test_version_2_of_a_namespace_that_shows_the_root(tree) -> None:
    tree("0::/../../x\n", {"cpu.max": "50000 100000", "cpu.stat": STAT.format(0)})
    assert quotas.limits() == {"cpus": 0.5, "memory_bytes": None, "throttled": 0}


def test_version_1(tree) -> None:
    tree(
        "4:memory:/box\n3:cpu,cpuacct:/box\n1:name=systemd:/\n",
        {
            "cpu,cpuacct/box/cpu.cfs_quota_us": "200000",
            "cpu,cpuacct/box/cpu.cfs_period_us": "100000",
            "cpu,cpuacct/cpu.cfs_quota_us": "-1",
            "cpu,cpuacct/cpu.cfs_period_us": "100000",
            "cpu,cpuacct/box/cpu.stat": "nr_throttled 8\n",
            "memory/box/memory.limit_in_bytes": "1000",
            "memory/memory.limit_in_bytes": "9223372036854771712",
        },
    )
    assert quotas.limits() == {"cpus": 2.0, "memory_bytes": 1000, "throttled": 8}


def test_version_1_writes_no_limit_as_a_number(tree) -> None:
    tree("4:memory:/\n", {"memory/memory.limit_in_bytes": "9223372036854771712"})
    assert quotas.limits()["memory_bytes"] is None


def test_nothing_there(tree) -> None:
    tree("0::/\n", {})
    assert quotas.limits() == {"cpus": None, "memory_bytes": None, "throttled": None}
    assert quotas.notices({}) == []


def test_run_and_report_say_it() -> None:
    context = {"cpu": {"usable_cpus": 2}, "limits": {"cpus": 1.0, "throttled": 3}}
    (quota,) = quotas.notices(context)
    assert quota.startswith(
        "this container may use 1 CPUs' time (its quota) on 2 CPUs: times of more threads"
    )
    less = context | {"limits": {"cpus": 0.5}}  # which one thread uses up
    assert quotas.notices(less)[0].endswith("on 2 CPUs: all times are the quota's")
    context["end"] = {"limits": {"throttled": 40}}
    assert quotas.notices(context)[1] == "throttled 37 times while it was measured (nr_throttled)"
    shown = dict(facts.machine(SimpleNamespace(context=context, frames=pd.DataFrame())))
    assert "throttled 37 times" in shown["limits"]
    assert quotas.notices(context | {"limits": {"cpus": 2.0, "throttled": 40}}) == []
    assert set(machine.context()["limits"]) == {"cpus", "memory_bytes", "throttled"}


@pytest.mark.slow
def test_a_sweep_says_how_often_it_was_throttled(monkeypatch, tmp_path, capsys) -> None:
    """By the end of the sweep the group was throttled 5 times more than at its begin."""
    counts = iter([3, 8])
    monkeypatch.setattr(quotas, "throttled", lambda: next(counts))
    words = ["sweep", "--phase", "opt2", "--scene", "trio", "-n", "2", "--launches", "1"]
    monkeypatch.setattr("sys.argv", [*words, "--results", str(tmp_path)])
    before = os.sched_getaffinity(0)
    try:
        assert sweep.main() == 0
    finally:
        os.sched_setaffinity(0, before)
    assert "warning: throttled 5 times while it was measured" in capsys.readouterr().err
