"""build/ceilings: its kernels do the work they are credited with. No time is judged."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import emitted
import msgspec
import pytest
import started
from complete import round_ceilings
from elftools.elf.elffile import ELFFile

from study.bounds import ceilings, peaks
from study.bounds.ceilings import Ceilings
from study.core import machine, store
from study.core.build import build
from study.core.run_schema import Cpu
from study.counting.decode import Decoded, decode

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "common" / "ceilings"
# Mixes: additions and multiplications of one body.
MIXES = {"add_mul": (7, 7), "add_2mul": (5, 9), "two_add_mul": (9, 5)}
NAMES = {"add+mul": "add_mul", "add+2mul": "add_2mul", "2add+mul": "two_add_mul"}
KINDS = (*ceilings.KINDS, *MIXES)
PACKED = {"sd": ("double", 64), "pd": ("double", 0), "ss": ("single", 32), "ps": ("single", 0)}
WIDTHS = (128, 256, 512)
OPERATIONS = {"minmax": 192, "sqrt": 40, "rsqrt": 40}  # of one round of the loop; 56 of the others


@pytest.fixture(scope="module")
def program() -> Path:
    return build(".", "ceilings")


@pytest.fixture(scope="module")
def output(program: Path) -> dict:
    done = subprocess.run([program, "--samples", "5"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def loops(program: Path) -> dict[str, list[Decoded]]:
    """Function → the instructions of its loop: from the target of its last jump backwards up to that jump."""
    found = {}
    with program.open("rb") as file:
        elf = ELFFile(file)
        text = elf.get_section_by_name(".text")
        for symbol in elf.get_section_by_name(".symtab").iter_symbols():
            begin, size = symbol["st_value"] - text["sh_addr"], symbol["st_size"]
            if symbol["st_info"]["type"] != "STT_FUNC" or not size or begin < 0:
                continue
            code = decode(text.data()[begin : begin + size], symbol["st_value"])
            back = [
                one
                for one in code
                if one.mnemonic.startswith("j") and symbol["st_value"] <= one.target < one.address
            ]
            if back:
                found[symbol.name] = [o for o in code if back[-1].target <= o.address <= back[-1].address]
    return found


def kernels() -> list[tuple[str, str, int]]:
    """Kind, suffix of its mnemonics, width of its registers."""
    return [
        (kind, suffix, width)
        for kind in KINDS
        for suffix in PACKED
        for width in (WIDTHS if suffix[0] == "p" else (128,))
    ]


@pytest.mark.parametrize(("kind", "suffix", "width"), kernels())
def test_a_loop_holds_the_operations_it_is_credited_with(
    loops: dict, kind: str, suffix: str, width: int
) -> None:
    code = loops[f"{kind}_{suffix}_{width}"]
    precision, scalar = PACKED[suffix]
    counted = Counter(one.kind for one in code if one.kind)
    assert {(one.precision, one.bits) for one in code if one.kind} == {(precision, scalar or width)}
    wanted = {kind: OPERATIONS.get(kind, 4 * 14)}
    if kind in MIXES:
        wanted = {name: 4 * n for name, n in zip(("add", "mul"), MIXES[kind], strict=True)}
    if kind in ("sqrt", "rsqrt"):
        wanted["add"] = 4 * 4  # so that the operands rise
    if kind == "minmax":
        wanted["add"] = 1
    assert counted == wanted
    assert not any(one.load or one.store for one in code)
    assert len(code) == sum(wanted.values()) + 2  # and the counting of the loop


@pytest.mark.parametrize("motion", ["load", "store", "copy"])
@pytest.mark.parametrize("bits", [64, 128, 256, 512])
def test_a_loop_moves_the_bytes_it_is_credited_with(loops: dict, motion: str, bits: int) -> None:
    code = loops[f"{motion}_{bits}"]
    load, store_ = (sum(getattr(one, way) for one in code) for way in ("load", "store"))
    moved = 16 * bits // 8
    assert (load, store_) == (moved * (motion != "store"), moved * (motion != "load"))
    assert {one.load + one.store for one in code} == {0, bits // 8}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('RUN14(TWO, "mul" #P)', 'RUN14(TWO, "div" #P)'),  # another operation
        ('"dec %[loops]\\n\\tjnz 1b', '"dec %[loops]\\n\\tjns 1b'),  # one round too many
        ('" " #I "*" #BYTES "(%[p]), %%" R #I', '" " #I "*8(%[p]), %%" R #I'),  # another address
        ('", " #I "*" #BYTES "(%[p])', '", 8+" #I "*" #BYTES "(%[p])'),  # stored elsewhere
    ],
)
def test_a_kernel_whose_work_is_wrong_gives_no_figure(tmp_path: Path, old: str, new: str) -> None:
    for path in SOURCE.glob("*.[ch]"):
        (tmp_path / path.name).write_text(path.read_text(encoding="utf-8").replace(old, new))
    command = ["gcc", "-std=c11", "-D_GNU_SOURCE", "-O1", f"-I{ROOT / 'common'}", *tmp_path.glob("*.c")]
    command += [ROOT / "common" / "timing" / "timer.c", "-lm", "-o", tmp_path / "made"]
    subprocess.run(command, check=True)
    done = subprocess.run([tmp_path / "made", "--samples", "5"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)


@pytest.mark.slow
def test_figures_are_for_as_much_work_as_a_loop_holds(loops: dict, output: dict) -> None:
    scalar = {("double", 64): "sd_128", ("single", 32): "ss_128"}
    for row in output["ceilings"]:
        if "precision" in row:
            packed = f"{'pd' if row['precision'] == 'double' else 'ps'}_{row['bits']}"
            kind = NAMES.get(row["name"], row["name"])
            code = loops[f"{kind}_{scalar.get((row['precision'], row['bits']), packed)}"]
            kinds = ("add", "mul") if kind in MIXES else (kind,)
            assert row["loop_operations"] == sum(one.kind in kinds for one in code)
        else:
            code = loops[f"{row['name']}_{row['bits']}"]
            assert row["loop_bytes"] == sum(one.load + one.store for one in code)


# What is written


@pytest.mark.slow
def test_every_ceiling_is_there_once(output: dict) -> None:
    found = Counter((r["name"], r.get("precision"), r.get("level"), r["bits"]) for r in output["ceilings"])
    names = (*ceilings.KINDS, *ceilings.TOGETHER)
    compute = {
        (name, precision, None, bits)
        for name in names
        for precision, widths in (("double", (64, 128, 256, 512)), ("single", (32, 128, 256, 512)))
        for bits in widths
    }
    bandwidth = {
        (name, None, level, bits)
        for name in ("load", "store", "copy")
        for level in ceilings.LEVELS
        for bits in (64, 128, 256, 512)
    }
    assert set(found) == compute | bandwidth and set(found.values()) == {1}


@pytest.mark.slow
def test_figures_of_a_ceiling_agree(output: dict) -> None:
    measured = [row for row in output["ceilings"] if row["value"] is not None]
    assert measured
    for row in measured:
        assert row["worst"] <= row["low"] <= row["median"] <= row["high"] and row["median"] <= row["value"]
        assert 3 <= row["samples"] <= 5
        if "precision" in row:
            lanes = row["bits"] // {"double": 64, "single": 32}[row["precision"]]
            per_instruction = lanes * (2 if row["name"] == "fma" else 1)
        else:
            per_instruction = row["bits"] / 8  # a copy's pair is two
        assert row["instructions_per_core_cycle"] * per_instruction == pytest.approx(row["value"], rel=1e-4)
        # Both are best ones, of clocks that may have moved in between: by less than to the half or twice.
        assert 0.5 < row["per_second"] / (row["value"] * row["core_hz"]) < 2
        if row.get("level"):
            assert row["working_set_bytes"] & (row["working_set_bytes"] - 1) == 0


@pytest.mark.slow
def test_working_sets_lie_between_the_caches(output: dict) -> None:
    sets = {row["level"]: row["working_set_bytes"] for row in output["ceilings"] if row.get("level")}
    sizes = output["cache_bytes"]
    if sizes["L1"] and sizes["L2"]:
        assert sizes["L1"] / 4 < sets["L1"] <= sizes["L1"] / 2
        assert sizes["L2"] / 4 < sets["L2"] <= sizes["L2"] / 2
    if sets["L3"]:
        assert sizes["L2"] < sets["L3"] < sizes["L3"]
    if sets["memory"]:
        assert sets["memory"] > max(sizes.values()) and sets["memory"] <= 512 << 20


@pytest.mark.slow
def test_what_the_cpu_lacks_is_null_with_a_reason(program: Path) -> None:
    environment = os.environ | {"STEPWISE_ISA_LIMIT": "none"}
    command = [program, "--samples", "5"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    limits = made(json.loads(done.stdout))
    assert math.isnan(limits.flops("fma", "double", 64)) and math.isnan(limits.bandwidth("L1", 256))
    sse = next(r for r in limits.ceilings if (r.name, r.precision, r.bits) == ("add", "single", 128))
    assert sse.reason is not None if sse.value is None else sse.value > 0  # of a host too busy to measure
    reasons = {row.reason for row in limits.ceilings if row.value is None and row.precision}
    assert {reason.split()[-1] for reason in reasons} >= {"fma", "avx", "avx512f", "avx512vl"}


@pytest.mark.parametrize("arguments", [["--samples", "4"], ["--samples", "5x"], ["--samples"], ["x"]])
def test_bad_arguments_are_status_2(program: Path, arguments: list[str]) -> None:
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr


# What is read


def made(data: dict) -> Ceilings:
    return msgspec.convert(data, Ceilings)


def test_what_ceilings_say() -> None:
    limits = made(round_ceilings())
    assert (limits.flops("add", "double", 256), limits.rate("add", "double", 256)) == (8, 2)
    assert (limits.issue("double", 256), limits.bandwidth("L1", 256)) == (3, 128)
    lacking = limits.flops("add", "double", 512), limits.flops("rsqrt", "double", 256)
    assert all(map(math.isnan, (*lacking, limits.issue("double", 512), limits.bandwidth("L1", 512))))


@pytest.mark.parametrize(
    ("change", "tsc_hz", "other"),
    [
        ({}, 2.5e9, False),
        ({}, 2.51e9, False),
        ({}, math.nan, False),  # not known
        ({}, 2.6e9, True),
        ({"model": "B"}, 2.5e9, True),
        ({"stepping": 2}, 2.5e9, True),  # clouds have one name for several
        ({"stepping": None}, 2.5e9, False),
        ({"flags": ["avx"], "microcode": "0x2"}, 2.5e9, False),
    ],
)
def test_machines_are_told_apart(change: dict, tsc_hz: float, other: bool) -> None:
    cpu = Cpu(model="A", vendor="V", family=6, model_number=207, stepping=1)
    changed = msgspec.structs.replace(cpu, **change)
    assert ceilings.other_cpu(cpu, changed, (2.5e9, tsc_hz)) == other
    assert not ceilings.other_cpu(cpu, Cpu(), (2.5e9, math.nan))
    assert ceilings.describe(cpu, 2.5e9) == "A (6/207/1), timer 2.500 GHz"


@pytest.mark.parametrize(
    ("name", "precision", "bits", "peak"),
    [
        ("Emerald Rapids", "double", 64, 4),  # two a cycle, an FMA is two
        ("Emerald Rapids", "single", 32, 4),
        ("Emerald Rapids", "double", 256, 16),
        ("Emerald Rapids", "single", 512, 64),
        ("Kaby Lake", "single", 256, 32),  # the paper's i7-7700
        ("Kaby Lake", "single", 512, None),
        ("Cascade Lake", "single", 512, None),  # one unit or two, by product
        ("Sandy Bridge", "single", 256, None),  # has no FMA
        ("Alder Lake", "single", 256, None),  # a hybrid
        ("Zen 3", "double", 256, 16),
        ("Zen 4", "single", 512, 32),
        ("Zen", "single", 256, 16),
        (None, "single", 256, None),
    ],
)
def test_the_peak_is_ports_times_lanes_times_two(
    name: str | None, precision: str, bits: int, peak: float | None
) -> None:
    for kind, of in (("fma", 1), ("add", 2)):
        here = peaks.peak(Cpu(microarchitecture=name), kind, precision, bits)
        assert math.isnan(here) if peak is None else here == peak / of


EMERALD = {"microarchitecture": "Emerald Rapids"}


def fmas(cpu: dict | None = None, **values: float | None) -> Ceilings:
    """FMA ceilings alone, `d256` for double precision and 256 bits; flop per core cycle."""
    rows = []
    for name, value in values.items():
        element, bits = (64 if name[0] == "d" else 32), int(name[1:])
        one = {"name": "fma", "precision": "double" if element == 64 else "single", "bits": bits}
        one |= {"unit": "flop/core cycle", "value": value, "reason": "the core clock never held still"}
        if value is not None:
            one |= dict.fromkeys(("median", "low", "high", "per_second"), value)
            one["instructions_per_core_cycle"] = value / 2 / (bits // element)
        rows.append(one)
    data = {"schema": 1, "tsc_hz": 2.5e9, "core_hz": 4e9, "ceilings": rows, "cpu": cpu or {}}
    return made(data)


def numbers(said: list[str]) -> list[list[str]]:
    return [re.findall(r"[\d.]+", line) for line in said]


def test_fma_ceilings_that_do_not_agree_are_told() -> None:
    """Single precision has twice the lanes; of scalars as many. 13.5 and 30.5 are 2.26 apart."""
    good = fmas(d64=4.0, s32=4.0, d256=16.0, s256=31.6)
    assert good.steady() and good.remarks() == []
    bad = fmas(d64=4.0, s32=3.8, d256=13.5, s256=30.5)
    assert numbers(bad.doubts()) == [["0.95", "1"], ["256", "2.26", "2"]]
    assert not bad.steady() and len(bad.remarks()) == 1


def test_ceilings_are_held_against_the_ports() -> None:
    """Both disturbed alike agree; and 64 flop a cycle are all that two FMAs of 16 floats are."""
    alike = {"d256": 13.5, "s256": 27.0}
    assert fmas(**alike).steady() and not fmas(EMERALD, **alike).steady()
    assert numbers(fmas(EMERALD, **alike).doubts()) == [["256", "13.5", "16"], ["256", "27", "32"]]
    for value, above in ((64.1, False), (64.3, True)):  # the clock is known to 0.3 %
        one = fmas(EMERALD, d512=32.0, s512=value)
        assert one.steady() != above and ("64.3 of 64" in " ".join(one.remarks())) == above
    lost = fmas(EMERALD, d256=None, s256=32.0)
    assert not lost.steady()


def test_it_measures_again_until_they_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each ceiling is the best that the ports allow; no more than the tries that are granted."""
    runs = [
        fmas(EMERALD, d256=13.5, s256=32.0, d512=31.9, s512=66.0),
        fmas(EMERALD, d256=15.9, s256=25.0, d512=20.0, s512=45.9),
        fmas(EMERALD, d256=12.0, s256=31.0, d512=31.0, s512=63.9),
        fmas(EMERALD, d256=16.0, s256=32.0, d512=32.0, s512=64.0),
    ]
    monkeypatch.setattr(ceilings, "build", lambda *_: Path("ceilings"))
    for tries, made, values in ((6, 3, [15.9, 32.0, 31.9, 63.9]), (2, 2, [15.9, 32.0, 31.9, 45.9])):
        left = iter(runs)
        monkeypatch.setattr(ceilings, "_once", lambda *_, left=left: next(left))
        found = ceilings.measure(tries=tries)
        assert (found.tries, [one.value for one in found.ceilings]) == (made, values)
        assert found.steady() == (tries == 6)
    several = {"d256": 17.0, "s256": 40.0, "d512": 33.0}, {"d256": 19.0, "s256": None, "d512": None}
    for one, other in (several, several[::-1]):  # none allowed: the nearest to it, and rather than none
        found = fmas(EMERALD, **one).better(fmas(EMERALD, **other))
        assert [one.value for one in found.ceilings] == [17.0, 40.0, 33.0]


@pytest.mark.slow
def test_the_script_keeps_them_with_the_run(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "scripts" / "stepwise"), "ceilings", "--samples", "5", "--json"]
    command += ["--run", str(tmp_path)]
    assert started.run(command).returncode == 2  # not a run
    store.write_json(tmp_path / "plan.json", {})
    done = started.run(command)
    assert done.returncode == 0, done.stderr
    limits = Ceilings.load(tmp_path / "ceilings.json")
    assert emitted.result(done.stdout)["ceilings"] == store.read_json(tmp_path / "ceilings.json")["ceilings"]
    cpu = msgspec.to_builtins(machine.cpu()) | {"stepping": 99}
    assert limits.compiler and limits.cpu and limits.cpu.model == cpu["model"]
    # A run of another machine cannot have its ceilings measured here.
    before = (tmp_path / "ceilings.json").read_bytes()
    store.write_json(tmp_path / "context.json", {"cpu": cpu})
    done = started.run(command)
    assert (done.returncode, done.stdout) == (2, "")
    assert (tmp_path / "ceilings.json").read_bytes() == before
