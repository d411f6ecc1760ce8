"""What is said of the machine."""

import json
import os

import msgspec
import pytest

from study.core import cli, machine
from study.core.run_schema import Context


def cpuinfo(name, vendor, family, model, stepping=0):
    return (
        f"processor\t: 0\nvendor_id\t: {vendor}\ncpu family\t: {family}\nmodel\t\t: {model}\n"
        f"model name\t: {name}\nstepping\t: {stepping}\ncpu cores\t: 8\nflags\t\t: fpu sse2 avx2\n\n"
        f"processor\t: 1\nvendor_id\t: Another\nmodel name\t: another\n"
    )


XEON = cpuinfo("Intel(R) Xeon(R) Processor", "GenuineIntel", 6, 207)
RYZEN = cpuinfo("AMD Ryzen 9 7950X 16-Core Processor", "AuthenticAMD", 25, 97)
CORE = cpuinfo("Intel(R) Core(TM) i7-6700K CPU @ 4.00GHz", "GenuineIntel", 6, 94)


@pytest.mark.parametrize(
    ("text", "slug"),
    [(XEON, "intel-xeon-6-207"), (RYZEN, "amd-ryzen-9-7950x-25-97"), (CORE, "intel-core-i7-6700k-6-94")],
)
def test_slug_is_made_from_the_cpu(text, slug):
    assert machine.slug(text) == slug


@pytest.mark.parametrize(
    ("vendor", "family", "model", "stepping", "name"),
    [
        ("GenuineIntel", 6, 0xCF, 2, "Emerald Rapids"),
        ("GenuineIntel", 6, 0x5E, 3, "Skylake"),
        ("GenuineIntel", 6, 0x55, 4, "Skylake"),
        ("GenuineIntel", 6, 0x55, 7, "Cascade Lake"),
        ("GenuineIntel", 6, 0x55, 11, "Cooper Lake"),
        ("AuthenticAMD", 0x19, 0x61, 2, "Zen 4"),
        ("AuthenticAMD", 0x19, 0x21, 0, "Zen 3"),
        ("AuthenticAMD", 0x19, 0x01, 1, "Zen 3"),
        ("AuthenticAMD", 0x17, 0x71, 0, "Zen 2"),
        ("AuthenticAMD", 0x1A, 0x44, 0, "Zen 5"),
        ("AuthenticAMD", 0x19, 0xFF, 0, None),
        ("GenuineIntel", 6, 9999, 0, None),
        (None, 0, 0, 0, None),
    ],
)
def test_microarchitecture(vendor, family, model, stepping, name):
    assert machine.microarchitecture(vendor, family, model, stepping) == name


def test_a_hidden_model_is_told_by_what_it_can_do():
    """A hypervisor that gives Rocket Lake's number to a core with AMX: seen on a rented machine."""
    told = "\n".join(("vendor_id\t: GenuineIntel", "cpu family\t: 6", "model\t\t: 167", "flags\t\t: {}"))
    assert machine.cpu(told.format("avx2 avx512f")).microarchitecture == "Rocket Lake"
    hidden = machine.cpu(told.format("avx2 avx512f amx_tile"))
    assert hidden.microarchitecture == machine.SOME_AMX
    known = told.replace("167", "207")
    assert machine.cpu(known.format("avx512f amx_tile")).microarchitecture == "Emerald Rapids"


def test_first_processor_of_cpuinfo():
    found = machine.cpu(RYZEN)
    assert (found.vendor, found.family, found.model_number) == ("AuthenticAMD", 25, 97)
    assert (found.cores, found.flags) == (8, ["fpu", "sse2", "avx2"])
    assert machine.cpu("").flags == []  # unreadable: no crash


def test_a_sandbox_that_does_not_know_its_cpu():
    """gVisor: the model's name and the stepping are the word "unknown"."""
    text = cpuinfo("unknown", "GenuineIntel", 6, 143, "unknown").replace("cores\t: 8", "cores\t: none")
    found = machine.cpu(text)
    assert (found.model, found.stepping, found.cores) == ("GenuineIntel", 0, None)
    assert found.microarchitecture == "Sapphire Rapids" and machine.slug(text) == "genuineintel-6-143"


@pytest.mark.parametrize(
    "cpu, said",
    [
        ({"model": "AMD EPYC", "microarchitecture": "Zen 3"}, "AMD EPYC (Zen 3)"),
        ({"model": "AMD EPYC", "family": 31, "model_number": 7}, "AMD EPYC (family 31 model 7)"),
        ({"model": "Some CPU", "family": 0}, "Some CPU"),
        ({"microarchitecture": "Zen 3"}, "Zen 3"),
        (None, "unknown CPU"),
    ],
)
def test_a_cpu_in_words(cpu, said):
    assert machine.name({"cpu": cpu or {}}) == said
    assert machine.name(None) == "unknown CPU"


def test_context_says_what_it_must():
    context = machine.context()
    assert msgspec.convert(json.loads(json.dumps(cli.plain(context))), Context) == context
    assert context.machine == machine.slug() and context.libraries["numpy"]
    assert (context.memory_kib or 0) > 0 and "sse2" in context.cpu.flags


@pytest.mark.parametrize(
    ("file", "text", "key", "value"),
    [
        ("cpu/cpufreq/boost", "0\n", "boost", "0"),
        ("cpu/cpufreq/boost", "1\n", "boost", "1"),
        (f"cpu/cpu{machine.topology.FASTEST}/cpufreq/boost", "0\n", "boost", "0"),
        ("enabled", "always [madvise] never\n", "huge_pages", "madvise"),
        ("enabled", "[always] madvise never\n", "huge_pages", "always"),
        ("none", "", "boost", None),
        ("none", "", "huge_pages", None),
    ],
)
def test_settings_that_change_times_are_recorded(file, text, key, value, tmp_path, monkeypatch):
    """AMD's boost switch and transparent huge pages, by which two runs of one machine differ."""
    (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / file).write_text(text)
    monkeypatch.setattr(machine.topology, "SYSTEM", tmp_path / "cpu")
    monkeypatch.setattr(machine, "HUGE_PAGES", tmp_path / "enabled")
    assert getattr(machine.context(), key) == value


@pytest.mark.parametrize("command", ["cc1", "wrapper cc1", "'{}/a wrapper' cc1", "", "'"])
def test_the_compiler_is_what_make_calls(command, tmp_path, monkeypatch):
    """CC may be several words: ccache gcc."""
    for name, body in (("cc1", "echo one 1.2"), ("wrapper", 'exec "$@"'), ("a wrapper", 'exec "$@"')):
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "gcc").symlink_to(tmp_path / "cc1")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("CC", command.format(tmp_path))
    assert machine.context().compiler == "one 1.2"
