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


TWO = {"pod/cpu.max": "150000 100000\n", "pod/box/cpu.max": "max 100000\n", "pod/box/memory.max": "max\n"}
TWO |= {"pod/memory.max": "4294967296\n", "pod/box/cpu.stat": STAT.format(3), "pod/cpu.stat": STAT.format(4)}
ONE = {"cpu,cpuacct/box/cpu.cfs_quota_us": "200000", "cpu,cpuacct/box/cpu.cfs_period_us": "100000"}
ONE |= {"cpu,cpuacct/cpu.cfs_quota_us": "-1", "cpu,cpuacct/cpu.cfs_period_us": "100000"}
ONE |= {"cpu,cpuacct/box/cpu.stat": "nr_throttled 8\n", "memory/box/memory.limit_in_bytes": "1000"}
NO_LIMIT = {"memory/memory.limit_in_bytes": "9223372036854771712"}


@pytest.mark.parametrize(
    ("cgroup", "files", "limits"),
    [
        ("0::/pod/box\n", TWO, Limits(cpus=1.5, memory_bytes=1 << 32, throttled=7)),  # the narrowest above
        ("0::/../../x\n", {"cpu.max": "50000 100000"}, Limits(cpus=0.5)),  # a namespace that shows the root
        (
            "4:memory:/box\n3:cpu,cpuacct:/box\n",
            ONE | NO_LIMIT,
            Limits(cpus=2.0, memory_bytes=1000, throttled=8),
        ),
        ("3:cpuacct,cpu:/box\n", ONE, Limits(cpus=2.0, throttled=8)),  # in another order than the mount
        ("3:cpuset,cpu:/box\n", {**ONE, "cpuset/cpu.stat": "nr_throttled 5"}, Limits(cpus=2.0, throttled=8)),
        ("torn\n0::/\n", {"cpu.stat": "nr_throttled\nnr_throttled many\n"}, Limits()),
        ("4:memory:/\n", NO_LIMIT, Limits()),
        ("0::/\n", {}, Limits()),
    ],
)
def test_limits_of_versions_1_and_2(tree, cgroup: str, files: dict[str, str], limits: Limits) -> None:
    tree(cgroup, files)
    assert quotas.limits() == limits


def test_what_is_noticed() -> None:
    assert quotas.notices(Context()) == []
    context = Context(cpu=Cpu(usable_cpus=2), limits=Limits(cpus=1.0, throttled=3))
    assert len(quotas.notices(context)) == 1 and "on 2 CPUs" in quotas.notices(context)[0]
    context.end = End(limits=Limits(throttled=40))
    assert "throttled 37 times" in quotas.notices(context)[1]
    context.limits = Limits(cpus=2.0, throttled=40)
    assert quotas.notices(context) == []
