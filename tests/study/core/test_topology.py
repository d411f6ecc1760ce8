"""Fast cores, siblings and caches from made-up sysfs trees."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core import machine, run
from study.core.host import topology
from study.core.run_schema import Pinned


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    root = tmp_path / "devices" / "system" / "cpu"
    root.mkdir(parents=True)
    monkeypatch.setattr(topology, "SYSTEM", root)
    return root


def add(root: Path, cpu: int, siblings: str, capacity: int = 0, khz: int = 0, l2: str = "1M") -> None:
    files = {"topology/core_cpus_list": siblings, "cache/index2/size": l2, "cache/index2/level": "2"}
    files |= {"cpu_capacity": str(capacity)} if capacity else {}
    files |= {"cpufreq/cpuinfo_max_freq": str(khz), "cpufreq/scaling_governor": "powersave"} if khz else {}
    for name, text in files.items():
        (root / f"cpu{cpu}" / name).parent.mkdir(parents=True, exist_ok=True)
        (root / f"cpu{cpu}" / name).write_text(text + "\n")


@pytest.fixture
def hybrid(system: Path) -> list[int]:
    """Two P-cores of two threads (0-3), the second the favoured one, four E-cores (4-7)."""
    for cpu in range(4):
        add(system, cpu, "0-1" if cpu < 2 else "2,3", khz=5000000 + 100000 * (cpu > 1), l2="2M")
    for cpu in range(4, 8):
        add(system, cpu, str(cpu), khz=3900000, l2="4M")
    for unit, cpus in (("cpu_core", "0-3"), ("cpu_atom", "4-7")):
        (system.parents[1] / unit).mkdir()
        (system.parents[1] / unit / "cpus").write_text(cpus + "\n")
    return list(range(8))


def test_a_hybrid_processor(hybrid) -> None:
    assert topology.fastest(hybrid) == 2  # and not 7, an E-core, nor 3, a second thread
    assert topology.spread(2, 2, hybrid) == {2, 0}
    assert topology.spread(2, 6, hybrid) == {2, 0, 4, 5, 6, 7}  # a core each before a second thread
    assert topology.spread(2, 7, hybrid) == {2, 0, 4, 5, 6, 7, 3}
    assert topology.spread(2, 99, hybrid) == set(hybrid)
    assert topology.spread(1, 2, hybrid) == {1, 2}  # and not 0, of the same core
    assert topology.fastest([4, 5]) == 5 and topology.fastest([3, 7]) == 3
    assert (topology.core_type(3), topology.core_type(4)) == ("P-core", "E-core")


def test_what_is_recorded_is_of_the_cpu_that_was_used(hybrid, monkeypatch) -> None:
    context = machine.context(6)
    assert context.pinned == Pinned(
        cpu=6, core_type="E-core", siblings=[6], max_khz=3900000, governor="powersave"
    )
    assert [cache.size for cache in context.caches] == ["4M"]
    assert machine.context(2).caches[0].size == "2M"
    monkeypatch.setattr(run, "USABLE", hybrid)
    assert run.cpu_set(2, 2) == {0, 2}


def test_capacities(system) -> None:
    """As arm64 and newer x86-64 kernels have them, with no name for the kinds."""
    for cpu, capacity in enumerate((1024, 1024, 400, 400)):
        add(system, cpu, str(cpu), capacity)
    assert topology.fastest(range(4)) == 1
    assert topology.core_type(3) == "capacity 400"


def test_cores_that_are_alike_and_a_tree_that_is_not_there(system) -> None:
    assert topology.fastest([0, 2, 5]) == 5 and topology.spread(5, 2, [0, 2, 5]) == {5, 0}
    assert topology.pinned(5) == Pinned(cpu=5, siblings=[5])
    for cpu in range(8):  # threads 4 to 7 are the second ones of cores 0 to 3
        add(system, cpu, f"{cpu % 4},{cpu % 4 + 4}")
    assert topology.fastest(range(8)) == 3
    assert {cpu % 4 for cpu in topology.spread(3, 4, range(8))} == {0, 1, 2, 3}
    assert topology.fastest([5, 7]) == 7


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda c: setattr(c.cpu, "logical_cpus", 999), "logical cpus 999"),
        (lambda c: setattr(c.cpu, "microcode", "0xdead"), "microcode 0xdead"),
        (lambda c: setattr(c, "kernel", "4.4"), "kernel 4.4"),
        (lambda c: setattr(c, "memory_kib", 1 << 20), "memory 1.0 GiB"),
        (lambda c: setattr(c.limits, "cpus", 0.25), "quota of CPUs 0.25"),
        (lambda c: setattr(c.cpu, "model", "Another"), "model Another"),
    ],
)
def test_what_differs_is_said(change, said) -> None:
    here, then = machine.context(), machine.context()
    then.memory_kib = round((here.memory_kib or 0) * 1.001)
    assert machine.differs(then, here) == []
    change(then)
    (found,) = machine.differs(then, here)
    assert found.startswith(said)
