"""Quotas and throttling of control groups, versions 1 and 2, from made-up trees."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core.host import quotas
from study.core.run_schema import Context, Cpu, End, Limits


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
    assert quotas.limits() == Limits(cpus=1.5, memory_bytes=1 << 32, throttled=7)


def test_version_2_of_a_namespace_that_shows_the_root(tree) -> None:
    tree("0::/../../x\n", {"cpu.max": "50000 100000", "cpu.stat": STAT.format(0)})
    assert quotas.limits() == Limits(cpus=0.5, memory_bytes=None, throttled=0)


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
    assert quotas.limits() == Limits(cpus=2.0, memory_bytes=1000, throttled=8)


def test_version_1_writes_no_limit_as_a_number(tree) -> None:
    tree("4:memory:/\n", {"memory/memory.limit_in_bytes": "9223372036854771712"})
    assert quotas.limits().memory_bytes is None


def test_nothing_there(tree) -> None:
    tree("0::/\n", {})
    assert quotas.limits() == Limits(cpus=None, memory_bytes=None, throttled=None)
    assert quotas.notices(Context()) == []


def test_what_is_noticed() -> None:
    context = Context(cpu=Cpu(usable_cpus=2), limits=Limits(cpus=1.0, throttled=3))
    assert len(quotas.notices(context)) == 1 and "on 2 CPUs" in quotas.notices(context)[0]
    context.end = End(limits=Limits(throttled=40))
    assert "throttled 37 times" in quotas.notices(context)[1]
    context.limits = Limits(cpus=2.0, throttled=40)
    assert quotas.notices(context) == []
