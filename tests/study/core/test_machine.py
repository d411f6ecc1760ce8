"""What is said of the machine."""

import json

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
