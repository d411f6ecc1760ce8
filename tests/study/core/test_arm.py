"""arm64: cores by their numbers, what stands for x86-64's instruction sets, and the peaks of ports."""

from __future__ import annotations

import math

import msgspec
import pytest

from study.bounds import peaks
from study.core import machine, registry
from study.core.host import arm, topology
from study.core.registry import Spec
from study.core.run_schema import Context, Cpu


def core(cpu: int, maker: str, part: str, variant: str = "0x0", revision: str = "0") -> str:
    """A block of /proc/cpuinfo in the form of Linux (arch/arm64/kernel/cpuinfo.c)."""
    return (
        f"processor\t: {cpu}\nBogoMIPS\t: 48.00\nFeatures\t: fp asimd evtstrm crc32 atomics\n"
        f"CPU implementer\t: {maker}\nCPU architecture: 8\nCPU variant\t: {variant}\nCPU part\t: {part}\n"
        f"CPU revision\t: {revision}\n\n"
    )


@pytest.mark.parametrize(
    ("maker", "part", "name", "slug"),
    [
        ("0x41", "0xd0c", "Arm Neoverse N1", "arm-neoverse-n1-8-3340"),
        ("0x41", "0xd4f", "Arm Neoverse V2", "arm-neoverse-v2-8-3407"),
        ("0x61", "0x023", "Apple M1 Firestorm", "apple-m1-firestorm-8-35"),
        ("0x61", "0x000", "Apple silicon", "apple-silicon-8-0"),  # a container on a Mac
        ("0x41", "0xfff", "Arm part 0xfff", "arm-part-0xfff-8-4095"),
        ("0x99", "0xd0c", "maker 0x99 part 0xd0c", "maker-0x99-part-0xd0c-8-3340"),
    ],
)
def test_a_core_by_its_numbers(maker: str, part: str, name: str, slug: str) -> None:
    text = core(0, maker, part, "0x3", "1")
    found = machine.cpu(text)
    assert (found.model, found.family, found.model_number) == (name, 8, int(part, 16))
    assert found.stepping == 0x31 and found.flags[:2] == ["fp", "asimd"]
    assert machine.name(Context(cpu=found)) == name and machine.slug(text) == slug


def test_of_several_kinds_the_core_that_is_measured_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The little cores come first."""
    text = "".join(core(cpu, "0x41", "0xd05" if cpu < 4 else "0xd0b") for cpu in range(8))
    for cpu, name in ((7, "Cortex-A76"), (2, "Cortex-A55"), (8, "Cortex-A55")):
        monkeypatch.setattr(topology, "FASTEST", cpu)
        assert machine.cpu(text).microarchitecture == name


@pytest.mark.parametrize("word", ["", "unknown", "0xzz"])
def test_what_is_no_number(word: str) -> None:
    found = machine.cpu(core(0, word, word, word, word))
    assert (found.model_number, found.stepping, found.microarchitecture) == (0, 0, None)
    assert arm.number({}, "CPU part") == 0


def test_a_cpuinfo_of_x86_is_read_as_before() -> None:
    text = "processor\t: 0\nvendor_id\t: GenuineIntel\ncpu family\t: 6\nmodel\t\t: 207\nmodel name\t: X\n"
    assert (machine.cpu(text).model, machine.cpu(text).microarchitecture) == ("X", "Emerald Rapids")


def test_flags_are_told_by_either_name(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in (core(0, "0x41", "0xd0c"), "flags\t\t: fp asimd\n"):
        monkeypatch.setattr(registry.Path, "read_text", lambda *_, text=text, **__: text)
        assert {"fp", "asimd"} <= registry.cpu_flags.__wrapped__()


@pytest.fixture
def neon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "cpu_flags", lambda: frozenset({"fp", "asimd"}))
    registry.by_simde.cache_clear()
    yield
    registry.by_simde.cache_clear()


@pytest.mark.parametrize("limit", ["", "avx2", "none"])
def test_neon_stands_for_avx2_and_for_nothing_wider(
    neon: None, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    monkeypatch.setenv("STEPWISE_ISA_LIMIT", limit)
    assert not any(registry.missing_isa(phase) for phase in registry.phases().values())
    assert registry.missing_isa(Spec("opt2", "opt4")) == []
    for name in ("opt6_wide", "opt9_convex", "opt11_ideal"):
        assert registry.variant_here(registry.find_phase(name)).lanes == 8


def test_which_phases_simde_translates(neon: None) -> None:
    assert {"opt3", "opt4", "opt5_threads"} <= set(registry.by_simde())
    assert not {"baseline", "opt2", "opt6_wide", "opt9_convex"} & set(registry.by_simde())


def test_on_x86_none_is_translated(monkeypatch: pytest.MonkeyPatch) -> None:
    registry.by_simde.cache_clear()
    monkeypatch.setattr(registry, "cpu_flags", lambda: frozenset({"sse2", "avx2"}))
    assert registry.by_simde() == [] and registry.translated([], ["opt4"]) == ""


@pytest.mark.parametrize(("name", "fmas"), [("Neoverse N1", 2), ("Neoverse V1", 4), ("Cortex-A55", None)])
def test_peaks_are_of_128_bits(name: str, fmas: int | None) -> None:
    """Arm's Software Optimization Guides: two vector pipelines of N1, four of V1."""
    cpu = Cpu(microarchitecture=name, flags=["asimd"])
    assert peaks.widest(cpu) == 128 and peaks.widest(Cpu(flags=["avx2"])) == 512
    for precision, bits, lanes in (("single", 128, 4), ("double", 128, 2), ("double", 64, 1)):
        peak = peaks.peak(cpu, "fma", precision, bits)
        assert math.isnan(peak) if fmas is None else peak == fmas * lanes * 2
    assert math.isnan(peaks.peak(cpu, "fma", "single", 256))


def test_a_context_of_arm64_is_written_and_read() -> None:
    made = Context(schema=1, cpu=machine.cpu(core(0, "0x41", "0xd40")))
    assert msgspec.json.decode(msgspec.json.encode(made), type=Context).cpu.model == "Arm Neoverse V1"
