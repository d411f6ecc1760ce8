"""Declared against measured: folding, comparing, Table 1's arithmetic, the files of a run, bad input."""

import gzip
import math
import os
import re
import shutil
import subprocess
import sys
from collections import Counter

import complete
import emitted
import msgspec
import pytest
import started

from study.core import registry, show, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.counting import blocks, costs, decode, flops, libm
from study.counting.counts import Counts, Measured
from study.experiments.flops import columns as flops_columns
from study.experiments.flops import table1

pytestmark = pytest.mark.slow


def counts(calls: int, adds: int, load: int = 0) -> Counts:
    return Counts(calls=calls, instructions=adds, lanes=Counter({("add", "double", 64): adds}), load=load)


def measured(functions: dict[str, Counts], edges: dict | None = None, **changed) -> Measured:
    total = Counts()
    for one in functions.values():
        total.merge(one)
    about = {
        "backend": "by hand",
        "phase": "opt1",
        "flags_from": "opt1",
        "variant": "calls",
        "scene": "s",
        "scene_hash": "0",
        "width": 4,
        "height": 2,
        "outside": None,
        "calibrated": True,
    }
    return Measured(**about | changed, total=total, functions=functions, edges=edges or {})


def stated(machine: int, **functions: int) -> dict:
    by_function = {name: {"calls": 1, "lanes": 1, "machine": n, "paper": n} for name, n in functions.items()}
    return {
        "phase": "opt1",
        "flags_from": "opt1",
        "lanes": 1,
        "scene": "s",
        "width": 4,
        "height": 2,
        "flops": {"machine": machine, "paper": machine},
        "by_function": by_function,
        "by_class": {"compare": 0, "call": 0},
        "executed": machine,
        "useful": machine,
        "useful_paper": machine,
    }


@pytest.fixture
def no_residues(monkeypatch):
    monkeypatch.setattr(flops, "explained", lambda stated, variant: {})
    as_additions(monkeypatch)


def as_additions(monkeypatch):
    """All FLOPs of the made-up functions are additions."""

    def by_kind(one):
        return {name: {"add": f["machine"]} for name, f in one["by_function"].items()}

    monkeypatch.setattr(flops, "by_kind", by_kind)


@pytest.mark.parametrize(
    ("low", "high", "left"),
    [
        (-600, -600, 0.0),  # 10600 declared, 10000 measured: all of it
        (-500, -500, 0.01),
        (-700, -500, 0.0),
        (-300, 0, 0.03),
        (-900, -800, 0.02),  # explains more than there is
        (0, 0, 0.06),
    ],
)
def test_a_residue_explains_no_more_than_it_says(monkeypatch, low, high, left):
    monkeypatch.setattr(flops, "explained", lambda stated, variant: {"a": {"add": (low, high)}})
    as_additions(monkeypatch)
    (row,) = flops.compare(stated(10600, a=10600), measured({"a": counts(1, 10000)}, variant="shipped"))
    assert row["relative_difference"] == pytest.approx(0.06)
    assert row["unexplained"] == pytest.approx(left)
    assert row["within"] is (abs(left) <= 0.01)


def test_a_missing_minimum_is_no_missing_product(monkeypatch):
    """1,000 minima fewer and 1,000 square roots more: the sum agrees, the kinds do not."""
    monkeypatch.setattr(flops, "explained", lambda stated, variant: {"a": {"minmax": (-1000, 0)}})
    monkeypatch.setattr(flops, "by_kind", lambda one: {"a": {"minmax": 1000, "sqrt": 9000}})
    by = measured({"a": Counts(calls=1, lanes=Counter({("sqrt", "double", 64): 10000}))}, variant="shipped")
    (row,) = flops.compare(stated(10000, a=10000), by)
    assert row["relative_difference"] == 0 and row["unexplained"] == pytest.approx(0.1) and not row["within"]


@pytest.mark.parametrize(
    ("declared", "executed", "doublings", "left"),
    [
        ((0, 100), (100, 0), 100, 0.0),  # 2·x as x + x, all of it
        ((0, 100), (100, 0), 60, 0.8),  # 40 sums of other things are no products
        ((0, 100), (100, 0), 0, 2.0),
        ((50, 50), (90, 10), 40, 0.0),
        ((50, 50), (10, 90), 100, 0.8),  # a product is no sum
        ((100, 0), (100, 0), 100, 0.0),  # the source's own x + x
    ],
)
def test_only_a_doubling_may_be_a_product(no_residues, monkeypatch, declared, executed, doublings, left):
    """(sums, products) declared and executed; what is left is off in both kinds."""
    monkeypatch.setattr(flops, "by_kind", lambda one: {"a": dict(zip(("add", "mul"), declared, strict=True))})
    lanes = Counter({(kind, "double", 64): n for kind, n in zip(("add", "mul"), executed, strict=True)})
    by = measured({"a": Counts(calls=1, lanes=lanes, doublings=doublings)}, variant="shipped")
    (row,) = flops.compare(stated(100, a=100), by)
    assert row["unexplained"] == pytest.approx(left) and row["within"] is (left == 0)


def compared(minima: int, compares: int, variant: str) -> Measured:
    lanes = {
        ("add", "double", 64): 9000,
        ("minmax", "double", 64): minima,
        ("compare", "double", 64): compares,
    }
    return measured({"a": Counts(calls=1, lanes=Counter(lanes))}, variant=variant)


@pytest.mark.parametrize(
    ("minima", "compares", "low", "left"),
    [
        (400, 700, -1000, 0),  # 600 minima fewer, 600 comparisons more than the 100 of the other build
        (400, 650, -1000, 50),
        (400, 100, -1000, 600),  # no comparison stands for them
        (400, 900, -1000, 200),  # more than there are minima missing
        (400, 700, -500, 100),  # the residues allow no more
        (1000, 100, -1000, 0),
    ],
)
def test_a_minimum_less_is_a_comparison_more(monkeypatch, minima, compares, low, left):
    allowed = {"shipped": {"a": {"minmax": (low, 0)}}, "calls": {}}
    monkeypatch.setattr(flops, "explained", lambda stated, variant: allowed[variant])
    monkeypatch.setattr(flops, "by_kind", lambda one: {"a": {"add": 9000, "minmax": 1000}})
    both = compared(minima, compares, "shipped"), compared(1000, 100, "calls")
    row = flops.compare(stated(10000, a=10000), *both)[0]
    assert row["unexplained"] == pytest.approx(left / (9000 + minima)) and row["explained_to"] == 0
    alone = flops.compare(stated(10000, a=10000), both[0])[0]
    assert alone["explained_to"] == pytest.approx(-low / (9000 + minima))  # without evidence: a range


def test_a_masked_minimum_is_no_branch(monkeypatch):
    """Of a phase of 16 lanes: 600 minima fewer, no comparison more; 50 beyond what its residue allows."""
    for low, left in ((-1000, 0), (-550, 50)):
        allowed = {"shipped": {"a": {"minmax": (low, 0)}}, "calls": {}}
        monkeypatch.setattr(flops, "explained", lambda stated, variant, of=allowed: of[variant])
        monkeypatch.setattr(flops, "by_kind", lambda one: {"a": {"add": 9000, "minmax": 1000}})
        both = compared(400, 100, "shipped"), compared(1000, 100, "calls")
        row = flops.compare(stated(10000, a=10000) | {"lanes": 16}, *both)[0]
        assert row["unexplained"] == pytest.approx(left / 9400), low


def test_a_raw_pass_needs_no_explanation(monkeypatch):
    monkeypatch.setattr(flops, "explained", lambda stated, variant: {"a": {"add": (-200, 0)}})
    as_additions(monkeypatch)
    (row,) = flops.compare(stated(10064, a=10064), measured({"a": counts(1, 10000)}, variant="shipped"))
    (*_, verdict), *_ = show.table([row], flops_columns.VALIDATION).cells
    assert row["explained_to"] > 0.01 and verdict == ("✓ within 1\u00a0%", "good")


def math_rows(monkeypatch, tmp_path, edges: dict, lanes: int = 1, variant: str = "calls") -> dict[str, dict]:
    """f is executed 10 times with a sine, a cosine and an fabs, g 5 times with a pow."""
    (tmp_path / "costs.def").write_text(
        "COST(f, call, 1, 0, 0, 0, 0, 0, 0, 0, 0, 3)\nCOST(g, call, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1)\n"
    )
    (tmp_path / "residues.def").write_text("RESIDUE(both, f, call, call, -1, -1) // fabs\n")
    phase = msgspec.structs.replace(registry.find_phase("baseline"), path=tmp_path, lanes=lanes)
    monkeypatch.setattr(registry, "find_phase", lambda name: phase)
    one = stated(1) | {"by_function": {"f": {"parts": {"call": 10}}, "g": {"parts": {"call": 5}}}}
    found = libm.compare(one, measured({"f": counts(10, 1), "g": counts(5, 1)}, edges, variant=variant))
    return {row["scope"].removeprefix(libm.MATH): row for row in found}


@pytest.mark.parametrize(
    "edges",
    [
        {"f": {"sincos": 10, "g": 5}, "g": {"pow": 5, "memcpy": 7}},
        {"f": {"sin": 10, "cosf": 10}, "g": {"helper": 5}, "helper": {"__pow_finite@plt": 5}},
    ],
)
def test_math_calls_are_held_against_calls_into_libm(monkeypatch, tmp_path, edges):
    rows = math_rows(monkeypatch, tmp_path, edges)
    seen = {name: (row["counted"], row["measured"], row["within"]) for name, row in rows.items()}
    assert seen == {"total": (35, 25, True), "f": (30, 20, True), "g": (5, 5, True)}
    assert math_rows(monkeypatch, tmp_path, edges, variant="shipped").keys() == {"total"}


@pytest.mark.parametrize(
    ("edges", "wrong"),
    [
        ({"f": {"sin": 10}, "g": {"pow": 5}}, {"total", "f"}),  # the cosine is not called
        ({"f": {"sincos": 10}}, {"total", "g"}),
        ({"f": {"sincos": 10, "fabs": 10}, "g": {"pow": 5}}, {"total", "f"}),  # was said to be an instruction
        ({}, {"total", "f", "g"}),
    ],
)
def test_math_calls_that_are_not_made_are_found(monkeypatch, tmp_path, edges, wrong):
    rows = math_rows(monkeypatch, tmp_path, edges)
    assert {name for name, row in rows.items() if not row["within"]} == wrong
    assert len(flops.failures(rows.values())) == len(wrong)


def test_a_phase_with_lanes_calls_no_libm(monkeypatch, tmp_path):
    assert math_rows(monkeypatch, tmp_path, {}, lanes=8)["total"]["within"]
    assert not math_rows(monkeypatch, tmp_path, {"f": {"pow": 1}}, lanes=8)["total"]["within"]


@pytest.mark.parametrize(
    ("line", "good"),
    [
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0,0) // why", True),
        ("COST(f, call, LANES, 0, 1, 2, 3, 4, 5, 6, 7, 8)", True),
        ("COST(f, call, 1, 0 0 0 0 0 0 0 0 0)", False),
        ("COST(f, call, 1, 000000000)", False),
        ("COST(f, call, 4, 0,0,0,0,0,0,0,0,0)", False),
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0,0,)", False),
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0)", False),
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0,0) why", False),
    ],
)
def test_a_cost_line_has_nine_numbers_and_a_width(tmp_path, line, good):
    (tmp_path / "costs.def").write_text(f"// a comment\n{line}\n")
    if good:
        assert len(costs.read(tmp_path / "costs.def")) == 1
    else:
        with pytest.raises(StudyError, match=r"costs\.def:2: COST\(function, part, LANES or 1, nine numbers"):
            costs.read(tmp_path / "costs.def")


def executed(code: str) -> Counts:
    """Of instructions given as bytes, each run once."""
    found = Counts()
    for one in decode.Disassembler().decode(bytes.fromhex(code)):
        found.add(one, 1)
    return found


@pytest.mark.parametrize(
    ("code", "lanes"),
    [
        ("f20f58c0", 1),  # addsd xmm0, xmm0
        ("660f58c0", 2),  # addpd xmm0, xmm0
        ("c5fd58c1", 0),  # vaddpd ymm0, ymm0, ymm1
        ("c5f558c1", 4),  # vaddpd ymm0, ymm1, ymm1
        ("f20f58c1", 0),  # addsd xmm0, xmm1
        ("f20f5cc0", 0),  # subsd xmm0, xmm0
        ("660f28c8 f20f58c8", 1),  # movapd xmm1, xmm0; addsd xmm1, xmm0
        ("660f28c8 f20f59c9 f20f58c8", 0),  # … and xmm1 squared between
        ("660f28c8 eb00 f20f58c8", 0),  # … and a jump between: a block may be entered in its middle
        ("f20f10c8 660f58c8", 0),  # movsd xmm1, xmm0; addpd: the upper halves are not the same
        ("f20f11442408 f20f58442408", 1),  # movsd [rsp+8], xmm0; addsd xmm0, [rsp+8]
        ("f20f11442408 f20f110f f20f58442408", 0),  # … and a store elsewhere, which may be there
    ],
)
def test_a_doubling_is_known_by_its_operands(code, lanes):
    assert executed(code).doublings == lanes


@pytest.mark.parametrize("code", ["dbf1", "dff1", "dbe9", "dfe9", "d8d1", "ded9", "660f2fc1", "660fc2c101"])
def test_every_comparison_is_one(code):
    """fcomi, fcomip, fucomi, fucomip, fcom, fcompp, comisd, cmppd"""
    found = executed(code)
    assert set(found.by_kind()) == {"compare"} and found.machine == 0


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("c4e37140c2f1", "vdpps"),
        ("660f3a41c131", "dppd"),
        ("62f2f5482cc2", "vscalefpd"),
        ("62f3f54850c201", "vrangepd"),
        ("d9fe", "fsin"),
    ],
)
def test_arithmetic_that_is_not_counted_is_refused_by_name(code, name):
    with pytest.raises(StudyError, match=f"{name} was executed"):
        executed(code)
    Counts().add(decode.Disassembler().decode(bytes.fromhex(code))[0], 0)  # never executed: no harm


def test_of_masked_lanes_the_active_ones_are_doubled():
    (one,) = decode.Disassembler().decode(bytes.fromhex("660f58c0"))
    found = Counts()
    found.add(one, 3, 5)  # of the six lanes of three sums five
    assert (found.doublings, found.machine, found.instructions) == (5, 5, 3)


def test_doublings_survive_json_and_splitting():
    one = executed("660f58c0")
    assert Counts.from_json(one.to_json()) == one
    assert [part.doublings for part in one.split([1, 1])] == [1, 1]


def test_a_scalar_total_with_libm_inside_is_not_judged(no_residues, monkeypatch):
    by = measured({"a": counts(1, 15000)}, variant="shipped", backend="pmu")
    one = stated(10000, a=10000)
    for lanes, failed in ((1, 0), (8, 1)):
        phase = msgspec.structs.replace(registry.find_phase("opt4"), lanes=lanes)
        monkeypatch.setattr(registry, "find_phase", lambda name, phase=phase: phase)
        rows = flops.compare(one, by)
        assert rows[0]["relative_difference"] == pytest.approx(-1 / 3) and len(flops.failures(rows)) == failed


def test_a_function_that_was_not_seen_was_not_called():
    (row,) = flops.compare_calls(stated(1, a=1), measured({}))
    assert not row["within"]


def test_a_wide_range_says_how_wide(monkeypatch):
    monkeypatch.setattr(flops, "explained", lambda stated, variant: {"a": {"add": (-800, 0)}})
    as_additions(monkeypatch)
    (row,) = flops.compare(stated(10600, a=10600), measured({"a": counts(1, 10000)}, variant="shipped"))
    (*_, verdict), *_ = show.table([row], flops_columns.VALIDATION).cells
    assert verdict == ("✓ explained to within 8.0\u00a0%", "good")


def test_a_back_end_without_kinds_is_held_against_the_sum(no_residues):
    by = measured({"a": Counts(calls=1, lanes=Counter({("any", "double", 64): 10000}))}, variant="shipped")
    assert flops.compare(stated(10050, a=10050), by)[0]["within"]
    assert not flops.compare(stated(10150, a=10150), by)[0]["within"]


def test_residues_are_parts_times_lanes_times_flops(tmp_path, monkeypatch):
    """Of opt4, eight lanes: three products for each of 10 calls, and a fused one counts two."""
    (tmp_path / "costs.def").write_text(
        "COST(f, call, LANES, 0,0,0,0,0,0,0,0,0)\nCOST(g, call, 1, 0,0,0,0,0,0,0,0,0)\n"
    )
    (tmp_path / "residues.def").write_text(
        "// why\nRESIDUE(calls, f, call, mul, 3, 3) // a\n"
        "RESIDUE(both, f, call, fma, -1, 1)\nRESIDUE(shipped, g, call, add, 0, 2)\n"
    )
    phase = msgspec.structs.replace(registry.find_phase("opt4"), path=tmp_path)
    monkeypatch.setattr(registry, "find_phase", lambda name: phase)
    one = {"phase": "opt4", "by_function": {name: {"parts": {"call": 10}} for name in ("f", "g")}}
    assert flops.explained(one, "calls") == {"f": {"mul": (240, 240), "fma": (-160, 160)}}
    assert flops.explained(one, "shipped") == {"f": {"fma": (-160, 160)}, "g": {"add": (0, 20)}}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("RESIDUE(calls, f, call, mul, 3)", "least, most"),
        ("RESIDUE(calls, f, call, mul, 3, 2)", "least, most"),
        ("RESIDUE(debug, f, call, mul, 3, 3)", "least, most"),
        ("RESIDUE(calls, f, call, compare, 3, 3)", "least, most"),
        ("RESIDUE(calls, f, call, mul, 3, 3) why", "least, most"),
        ("RESIDUE(calls, f, step, mul, 3, 3)", "no line f, step"),
    ],
)
def test_a_bad_residue_is_named(tmp_path, line, message):
    known = [costs.Cost("f", "call", "1", {})]
    (tmp_path / "residues.def").write_text(line + "\n")
    with pytest.raises(StudyError, match=rf"residues\.def:1: .*{message}"):
        costs.residues(tmp_path / "residues.def", known)


@pytest.fixture
def derived(tmp_path, monkeypatch):
    """The folder of `mine`, derived from opt4, whose f is known to have three products more."""
    for name in ("opt4", "mine"):
        (tmp_path / "phases" / name).mkdir(parents=True)
    shutil.copy(ROOT / "phases" / "opt4" / "phase.json", tmp_path / "phases" / "opt4")
    about = {"title": "mine", "family": "ladder", "order": 9, "parent": "opt4", "idea": "", "paper": None}
    store.write_json(tmp_path / "phases" / "mine" / "phase.json", about | {"name": "mine", "derives": "opt4"})
    (tmp_path / "phases" / "opt4" / "costs.def").write_text("COST(f, call, LANES, 0,100,0,0,0,0,0,0,0)\n")
    (tmp_path / "phases" / "opt4" / "residues.def").write_text("RESIDUE(both, f, call, mul, 3, 3) // why\n")
    monkeypatch.setattr(registry, "find_phase", lambda name: registry.phases(tmp_path)[name])
    return tmp_path / "phases" / "mine"


def products(phase: str) -> dict:
    """The row of a picture with 103 products a lane where 100 are declared."""
    one = stated(8000) | {"phase": phase, "lanes": 8}
    one["by_function"] = {"f": {"parts": {"call": 10}, "machine": 8000, "calls": 10}}
    by = Counts(calls=1, lanes=Counter({("mul", "single", 256): 8240}))
    (row,) = flops.compare(one, measured({"f": by}, variant="shipped"))
    return row


def shown(row: dict) -> list[str]:
    named = {column.name: column.text(row) for column in flops_columns.VALIDATION}
    return [named["the compiler's doing, known"], named["verdict"]]


@pytest.mark.parametrize(
    ("own", "known", "verdict"),
    [
        (None, "+2.91\u00a0% (inherited from opt4: not confirmed)", "✗ OUTSIDE 1\u00a0%"),
        ("", "–", "✗ OUTSIDE 1\u00a0%"),
        ("RESIDUES_OF(opt4) // read anew\n", "+2.91\u00a0%", "✓ within 1\u00a0%"),
        ("RESIDUE(both, f, call, mul, 3, 3) // why\n", "+2.91\u00a0%", "✓ within 1\u00a0%"),
    ],
)
def test_inherited_residues_are_marked_and_explain_nothing(derived, own, known, verdict):
    assert shown(products("opt4")) == ["+2.91\u00a0%", "✓ within 1\u00a0%"]
    if own is not None:
        (derived / "residues.def").write_text(own)
    row = products("mine")
    assert shown(row) == [known, verdict] and row["within"] is verdict.startswith("✓")
    assert row["inherited_from"] == ("opt4" if own is None else None)


@pytest.mark.parametrize("own", [None, "RESIDUES_OF(opt4) // read anew\n"])
def test_an_inherited_residue_of_a_part_that_is_gone_is_no_error(derived, own):
    if own is not None:
        (derived / "residues.def").write_text(own)
    (derived / "costs.def").write_text("COST(g, call, LANES, 0,100,0,0,0,0,0,0,0)\n")
    assert costs.residues_of(registry.find_phase("mine"), costs.read(derived / "costs.def")) == []


def test_every_derived_phase_of_ours_has_residues_of_its_own():
    inherited = {name: phase.inherits("residues.def") for name, phase in registry.phases().items()}
    assert {name: by for name, by in inherited.items() if by} == {}


def test_helpers_are_folded_into_their_callers_by_calls():
    """dot (30 adds in 10 calls) is called 8 times by a, twice by norm; norm 3 times by b: by hand
    a gets 24, norm 6, all of which goes on to b with norm's own 9."""
    found = flops.fold(
        measured(
            {"a": counts(1, 100), "b": counts(1, 200), "norm": counts(3, 9), "dot": counts(10, 30)},
            {"a": {"dot": 8}, "norm": {"dot": 2}, "b": {"norm": 3}},
        ),
        {"a", "b"},
    )
    assert {name: one.machine for name, one in found.items()} == {"a": 124, "b": 215}
    assert {name: one.calls for name, one in found.items()} == {"a": 1, "b": 1}


def test_a_named_helper_stays_and_an_uncalled_function_is_not_lost():
    functions = {"a": counts(1, 100), "dot": counts(10, 30), "entry": counts(1, 7)}
    found = flops.fold(measured(functions, {"a": {"dot": 10}}), {"a", "dot"})
    assert {name: one.machine for name, one in found.items()} == {"a": 100, "dot": 30, "entry": 7}


def test_folding_keeps_the_total():
    functions = {name: counts(2, n) for name, n in (("a", 11), ("b", 12), ("c", 13), ("d", 14))}
    edges = {"a": {"b": 1, "c": 1}, "b": {"c": 1, "d": 2}, "c": {"d": 5}}
    assert sum(c.machine for c in flops.fold(measured(functions, edges), {"a"}).values()) == 50


@pytest.mark.parametrize(
    ("counted", "within"),
    [(10000, True), (10100, True), (9900, True), (10101, False), (9899, False), (0, False)],
)
def test_one_percent_is_the_limit(counted, within, no_residues):
    (row,) = flops.compare(stated(counted, a=counted), measured({"a": counts(1, 10000)}, variant="shipped"))
    assert row["within"] is within
    assert bool(flops.failures([row])) is not within


def test_nothing_measured_or_nan_is_a_failure(no_residues):
    (row,) = flops.compare(stated(5, a=5), measured({"a": counts(1, 0)}, variant="shipped"))
    assert math.isnan(row["relative_difference"]) and flops.failures([row])
    assert flops.failures([row | {"relative_difference": math.nan, "within": abs(math.nan) <= 0.01}])


def test_functions_are_judged_unless_they_are_small(no_residues):
    by = measured({"a": counts(1, 10000), "b": counts(1, 5), "helper": counts(3, 60)}, {"a": {"helper": 3}})
    rows = {r["scope"]: r for r in flops.compare(stated(10065, a=10060, b=1), by, by)[2:]}
    assert rows["a"]["within"] and rows["a"]["judged"]
    assert not rows["b"]["within"] and not rows["b"]["judged"]
    assert "helper" not in rows


def test_calls_must_be_equal():
    (row,) = flops.compare_calls(stated(1, a=1), measured({"a": counts(1, 1)}))
    assert row["within"]
    (row,) = flops.compare_calls(stated(1, a=1), measured({"a": counts(1000, 1)}))
    assert not row["within"]


def test_counts_json_is_added_to_and_newer_replaces_older(tmp_path):
    path = tmp_path / "counts.json"
    flops.write(path, [stated(1)], [measured({"a": counts(1, 1)})])
    flops.write(
        path,
        [stated(2), stated(3) | {"scene": "t"}],
        [measured({"a": counts(1, 2)}), measured({}, scene="t")],
    )
    rows, many = flops.read(path)
    assert [row["flops"]["machine"] for row in rows] == [2, 3]
    assert [(one.scene, one.total.machine) for one in many] == [("s", 2), ("t", 0)]
    assert many[0].functions["a"].lanes == Counter({("add", "double", 64): 2})


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"schema": 1}', '{"declared": [], "measured": [{"phase": "p"}]}']
)
def test_a_foreign_or_truncated_counts_json_is_one_line(tmp_path, text):
    (tmp_path / "counts.json").write_text(text)
    with pytest.raises(StudyError, match=r"counts\.json"):
        flops.read(tmp_path / "counts.json")


def test_a_published_runs_counts_are_packed_and_the_plain_file_goes_first(tmp_path):
    plain, packed = tmp_path / "counts.json", tmp_path / "counts.json.gz"
    packed.write_bytes(gzip.compress(complete.text("counts.json", {"declared": [stated(7)]}).encode()))
    assert flops.read(plain)[0] == [stated(7)]
    packed.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(StudyError, match=r"counts\.json\.gz: not a whole gzip file"):
        flops.read(plain)
    complete.write(plain, {"declared": [stated(8)]})
    assert flops.read(plain)[0] == [stated(8)]


def test_table1_against_the_paper_and_by_hand():
    base = stated(100) | {"phase": "baseline", "scene": "scene0", "width": 1280, "height": 720}
    base["by_function"] = {"sdf": {"lanes": 50, "calls": 50, "machine": 100, "paper": 100}}
    half = base | {
        "phase": "opt1",
        "flops": {"paper": 60, "machine": 70},
        "by_class": base["by_class"] | {"compare": 5},
        "executed": 60,
        "useful": 30,
        "useful_paper": 30,
    }
    first, second = table1.rows([base, half])
    assert first["paper_gflop"] == pytest.approx(20.68) and first["cut"] is None
    assert first["flop_per_evaluation"] == 2 and first["evaluations_million"] == 50e-6
    assert second["cut"] == pytest.approx(0.7)  # half of its 60 are useful: 30 of 100 are left
    assert second["paper_cut"] == pytest.approx(0.51)
    giga = [second[name] for name in ("paper_convention_gflop", "machine_convention_gflop", "compare_gop")]
    assert giga == pytest.approx([60e-9, 70e-9, 5e-9])
    assert (second["useful_share"], second["flop_per_pixel"]) == (0.5, 60 / (1280 * 720))


def test_flops_per_evaluation_stand_only_where_evaluations_are_the_work():
    """opt8_streams draws a Mandelbulb almost without `sdf`: 51,380 evaluations for 15 GFLOP say nothing."""
    about = {"scene": "mandelbulb", "width": 1280, "height": 720}  # two shapes, four iterations
    own = {name: {"lanes": 80, "calls": 10} for name in ("sdf", "sdf_plane", "sdf_mandelbulb")}
    assert table1.evaluations(about | {"by_function": own}) == 80
    loop = own | {"bulb_step": {"lanes": 2 * 4 * 80, "calls": 80}}
    assert table1.evaluations(about | {"by_function": loop}) == 80
    beside = own | {"bulb_step": {"lanes": 2 * 4 * 80 + 1, "calls": 81}}
    assert table1.evaluations(about | {"by_function": beside}) is None
    assert table1.evaluations(about | {"by_function": {"sdf": {"lanes": 0, "calls": 0}}}) is None
    published = registry.ROOT / "results" / "reference" / "zen5-2026-11-25"
    for row in table1.rows(flops.read(published / "counts.json")[0]):
        alone = row["phase"] in ("opt9_convex", "opt10_scene") or (
            row["phase"] == "opt8_streams" and row["scene"] == "mandelbulb"
        )
        assert (row["flop_per_evaluation"] is None) == (row["evaluations_million"] is None) == alone, row


@pytest.mark.parametrize(
    "phase", sorted(name for name, p in registry.phases().items() if p.file("costs.def").exists())
)
def test_costs_def_reads_as_the_compiler_reads_it(phase):
    """Parts and their paper FLOPs by Python, against a picture's by the counting build."""
    beside = registry.find_phase(phase).family == registry.SYSTEMS  # not every one of them draws a torus
    scene = registry.find_scene("two_spheres" if beside else "trio")
    made = flops.declared(Spec(phase, phase), scene, 12)
    declared = {(c.function, c.part): c for c in costs.read(registry.find_phase(phase).file("costs.def"))}
    lanes = registry.variant_here(registry.find_phase(phase)).lanes
    parts = {(f, p): n for f, one in made["by_function"].items() for p, n in one["parts"].items()}
    assert parts.keys() == declared.keys()
    for kind, total in made["by_class"].items():
        by_hand = sum(
            n * declared[key].per_lane[kind] * (lanes if declared[key].width == "LANES" else 1)
            for key, n in parts.items()
        )
        if kind == "call":  # a function that stands for a math.h call is one, whatever is inside
            by_hand += sum(
                n * lanes for (f, p), n in parts.items() if declared[f, p].stands_for_call and p == "call"
            )
        assert by_hand == total, kind


def test_a_line_that_is_no_cost_is_named(tmp_path):
    (tmp_path / "costs.def").write_text("// fine\nCOST(a, call, 1, 1, 2)\n")
    with pytest.raises(StudyError, match=r"costs\.def:2: .*nine numbers"):
        costs.read(tmp_path / "costs.def")


def command(*arguments: object, **environment: str) -> subprocess.CompletedProcess:
    words = [sys.executable, str(ROOT / "scripts" / "stepwise"), "flops", *map(str, arguments)]
    return started.run(words, env=os.environ | environment, timeout=300)


def test_table1_of_a_small_picture_as_json():
    done = command("--phase", "baseline", "--scene", "cubes", "-n", 9, "--json")
    assert done.returncode == 0, done.stderr
    (row,) = emitted.result(done.stdout)["table1"]
    assert row["phase"] == "baseline" and row["width"] == 16 and row["paper_gflop"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--phase", "optt1"], "no phase 'optt1'; did you mean opt1"),
        (["--scene", "scene1", "-n", 9], "no scene 'scene1'; did you mean scene0"),
        (["-n", 0], "whole numbers from 1"),
        (["--backend", "qemu"], "measures nothing by itself: add --validate or --measure"),
        (["--run", "/nowhere"], "not a run"),
    ],
)
def test_bad_arguments_are_one_line(arguments, message):
    done = command(*arguments)
    assert done.returncode == 2 and message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_what_was_measured_is_shown_without_a_run():
    done = command("--measure", "--phase", "baseline", "--scene", "trio", "-n", 9, "--json")
    (one,) = emitted.result(done.stdout)["measured"]
    assert done.returncode == 0 and one["backend"] == "blocks" and one["total"]["machine"] > 0
    done = command("--measure", "--phase", "baseline", "--scene", "trio", "-n", 9)
    assert f"{one['total']['machine'] / 1e9:.4}" in done.stdout.strip().splitlines()[-1]


def test_phases_that_the_cpu_lacks_are_left_out_and_named():
    done = command("--phase", "opt4", "-n", 9, STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 3 and "avx2" in done.stderr


@pytest.mark.parametrize(
    ("phase", "scene"),
    [
        *((p, "trio") for p in sorted(registry.ladder()) if registry.cpu_supports(registry.find_phase(p))),
        *((p, "mandelbulb") for p in ("opt8_streams", "opt9_convex")
          if registry.cpu_supports(registry.find_phase(p))),
    ],
)  # fmt: skip
def test_declared_costs_hold_against_the_blocks_that_ran(phase, scene):
    """The whole chain on a scene with a mirror, soft shadows, fog and a rotation; and where a Mandelbulb is
    marched alone, by functions that no other scene has."""
    done = command("--validate", "--phase", phase, "--scene", scene, "-n", 24, "--json")
    rows = emitted.result(done.stdout)["rows"]
    assert done.returncode == 0, done.stderr
    assert {"phase", "scene", "counted", "measured", "backend", "relative_difference"} <= rows[0].keys()
    assert len([row for row in rows if row["judged"]]) > 10 and all(row["calibrated"] for row in rows)
    assert {"shipped", "calls"} == {row["variant"] for row in rows if row["scope"] == f"{libm.MATH}total"}


@pytest.mark.parametrize(
    ("phase", "scene", "there", "least"),
    [
        ("fixed_float", "spheres40", {"intersect", "occluded", "direct_light", "camera_direction"}, 1e-3),
        (
            "packets",
            "spheres40",
            {"sphere_interval", "bundle_frustum", "camera_rays", "square_root", "lighting_at"},
            2e-3,
        ),
        ("rods_simd", "trio", {"packet_distance", "march_step", "sdf_torus", "calls of rod_step"}, 2e-3),
    ],
)
def test_a_systems_costs_hold_where_its_scenes_are(phase, scene, there, least):
    """Forty mirrors, and a torus among balls: masked sums are explained, nothing else is off by one or
    two FLOPs in a thousand."""
    if not registry.cpu_supports(registry.find_phase(phase)):
        pytest.skip("the CPU lacks what it needs")
    done = command("--validate", "--phase", phase, "--scene", scene, "-n", 24, "--json")
    rows = [row for row in emitted.result(done.stdout)["rows"] if row["judged"]]
    assert done.returncode == 0, done.stderr
    assert there <= {row["scope"] for row in rows}
    assert all(row["unexplained"] < least for row in rows), [(r["scope"], r["unexplained"]) for r in rows]


def test_opt2s_branches_are_explained_to_less_than_one_percent():
    """Where gcc makes branches of minima, and the raw difference is some 10 %."""
    done = command("--validate", "--phase", "opt2", "--scene", "scene0", "-n", 24, "--json")
    rows = emitted.result(done.stdout)["rows"]
    (row,) = (row for row in rows if (row["scope"], row["variant"]) == ("total", "shipped"))
    assert done.returncode == 0 and row["explained_to"] + row["unexplained"] < 0.01


def test_a_wrong_cost_is_found(tmp_path):
    """One product too many in the sphere's distance of a copy: exit status 1, and the function named."""
    copy = tmp_path / "tree"
    shutil.copytree(
        ROOT, copy, symlinks=True, ignore=shutil.ignore_patterns(".git", "build", "results", ".hypothesis")
    )
    shutil.copytree(ROOT / "common" / "build", copy / "common" / "build")  # sources, whatever their name
    shutil.copytree(ROOT / "results" / "paper", copy / "results" / "paper")
    for target in ("render-count", *blocks.TARGETS.values()):
        build("baseline", target)
    for built in ("common", "baseline", "calibration"):  # what costs.def has no part in is not made again
        parsed = shutil.ignore_patterns("parsed")  # headers that another make may be writing
        shutil.copytree(ROOT / "build" / built, copy / "build" / built, ignore=parsed)
    path = copy / "phases" / "baseline" / "costs.def"
    text = path.read_text()
    assert "COST(sdf_sphere, call,               1,  1," in text
    path.write_text(
        text.replace(
            "COST(sdf_sphere, call,               1,  1,", "COST(sdf_sphere, call,               1,  2,"
        )
    )
    words = [sys.executable, str(copy / "scripts" / "stepwise"), "flops", "--validate", "--phase", "baseline"]
    done = started.run([*words, "--scene", "spheres40", "-n", "8"], timeout=300)
    assert "phases/baseline/costs.def: declare there what the code does" in done.stderr
    assert done.returncode == 1 and "baseline spheres40 sdf_sphere (calls): declared" in done.stderr, (
        done.stderr
    )


def test_every_declared_function_has_a_term():
    for path in sorted((registry.ROOT / "phases").rglob("costs.def")):
        names = set(re.findall(r"^COST\((\w+),", path.read_text(), re.MULTILINE))
        assert names, path
        assert {name for name in names if table1.term_of(name) == table1.OTHER} == set(), path
    assert table1.term_of("bulb_iterate") == "distance functions"
    assert table1.term_of("a_new_phase_calls_it_so") == table1.OTHER
