"""Declared against measured: folding, comparing, residues, the files of a run."""

from collections import Counter
from pathlib import Path

import msgspec
import pytest

from study.core import registry, store
from study.core.cli import StudyError
from study.counting import costs, flops
from study.counting.counts import Counts
from study.counting.schema import Declared, Flops, Function, Measurement, Row
from study.experiments.flops import columns


def counts(calls: int, adds: int) -> Counts:
    return Counts(calls=calls, instructions=adds, lanes=Counter({("add", "double", 64): adds}))


def measured(functions: dict[str, Counts], edges: dict | None = None, **changed) -> Measurement:
    about = {"backend": "by hand", "phase": "opt1", "variant": "calls", "scene": "s", "scene_hash": "0"}
    about |= {"width": 4, "height": 2, "outside": None, "calibrated": True, "edges": edges or {}}
    total = Counts.total(functions.values()).executed()
    executed = {name: one.executed() for name, one in functions.items()}
    return Measurement(**about | changed, total=total, functions=executed)


def stated(machine: int, phase: str = "opt1", lanes: int = 1, **functions: int) -> Declared:
    return Declared(
        phase=phase,
        lanes=lanes,
        scene="s",
        width=4,
        height=2,
        flops=Flops(machine=machine, paper=machine),
        by_function={name: Function(calls=1, lanes=1, machine=n, paper=n) for name, n in functions.items()},
        by_class={"compare": 0, "call": 0},
        executed=machine,
        useful=machine,
        useful_paper=machine,
    )


@pytest.fixture
def claimed(monkeypatch):
    """Says what costs.def and residues.def say: all FLOPs of the made-up functions are additions."""

    def say(kinds: dict | None = None, residues: dict | None = None) -> None:
        def by_kind(one: Declared) -> dict:
            adds = {name: Counter(add=f.machine) for name, f in one.by_function.items()}
            return adds if kinds is None else {"a": Counter(kinds)}

        monkeypatch.setattr(flops, "by_kind", by_kind)
        known = {} if residues is None else {"a": residues}
        monkeypatch.setattr(flops, "explained", lambda stated, variant: known)

    say()
    return say


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
def test_a_residue_explains_no_more_than_it_says(claimed, low, high, left):
    claimed(residues={"add": (low, high)})
    (row,) = flops.compare(stated(10600, a=10600), measured({"a": counts(1, 10000)}, variant="shipped"))
    assert row.relative_difference == pytest.approx(0.06)
    assert row.unexplained == pytest.approx(left)
    assert row.within is (abs(left) <= 0.01)
    assert row.explained_to == pytest.approx((high - low) / 10000)


@pytest.mark.parametrize(
    ("executed", "left"),
    [
        ({"add": 500, "mul": 9500}, 0),  # 2·x as x + x
        ({"sqrt": 1000, "mul": 9000}, 0.1),  # a missing minimum is no missing root
        ({"minmax": 400, "mul": 9000, "add": 600}, 0.0),
    ],
)
def test_kind_is_held_against_kind_but_sums_and_products_together(claimed, executed, left):
    minima = executed.get("minmax", 0)
    claimed({"minmax": minima, "mul": 10000 - minima}, {"minmax": (-1000, 0)})
    lanes = Counter({(kind, "double", 64): n for kind, n in executed.items()})
    (row,) = flops.compare(stated(10000, a=10000), measured({"a": Counts(1, lanes=lanes)}, variant="shipped"))
    assert row.relative_difference == 0
    assert row.within is (left == 0)


def compared(minima: int, compares: int, variant: str) -> Measurement:
    lanes = Counter({("add", "double", 64): 9000, ("minmax", "double", 64): minima})
    lanes["compare", "double", 64] = compares
    return measured({"a": Counts(calls=1, lanes=lanes)}, variant=variant)


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
def test_a_minimum_less_is_a_comparison_more(claimed, minima, compares, low, left):
    claimed({"add": 9000, "minmax": 1000}, {"minmax": (low, 0)})
    both = compared(minima, compares, "shipped"), compared(1000, 100, "calls")
    row = flops.compare(stated(10000, a=10000), *both)[0]
    assert row.unexplained == pytest.approx(left / (9000 + minima)) and row.explained_to == 0
    alone = flops.compare(stated(10000, a=10000), both[0])[0]
    assert alone.explained_to == pytest.approx(-low / (9000 + minima))  # without evidence: a range
    masked = flops.compare(stated(10000, lanes=16, a=10000), *both)[0]  # a masked minimum is no branch
    assert masked.explained_to == alone.explained_to


@pytest.mark.parametrize(
    ("counted", "within"),
    [(10000, True), (10100, True), (9900, True), (10101, False), (9899, False), (0, False)],
)
@pytest.mark.parametrize("kind", ["add", "any"])
def test_one_percent_is_the_limit(claimed, counted, within, kind):
    """By kinds, and by a back end that does not tell them apart."""
    by = measured({"a": Counts(1, lanes=Counter({(kind, "double", 64): 10000}))}, variant="shipped")
    (row,) = flops.compare(stated(counted, a=counted), by)
    assert row.within is within and bool(flops.failures([row])) is not within


def test_nothing_measured_is_a_failure(claimed):
    (row,) = flops.compare(stated(5, a=5), measured({"a": counts(1, 0)}, variant="shipped"))
    assert flops.failures([row])


def test_functions_are_judged_unless_they_are_small(claimed):
    by = measured({"a": counts(1, 10000), "b": counts(1, 5), "helper": counts(3, 60)}, {"a": {"helper": 3}})
    rows = {row.scope: row for row in flops.compare(stated(10065, a=10060, b=1), by, by)[2:]}
    assert rows["a"].within and rows["a"].judged
    assert not rows["b"].within and not rows["b"].judged
    assert "helper" not in rows


def test_a_scalar_total_with_libm_inside_is_not_judged(claimed):
    by = measured({"a": counts(1, 15000)}, variant="shipped", backend="pmu")
    for phase, lanes, failed in (("opt1", 1, 0), ("opt4", 8, 1)):
        rows = flops.compare(stated(10000, phase, lanes, a=10000), by)
        assert len(flops.failures(rows)) == failed


def test_calls_must_be_equal():
    for functions, within in (({"a": counts(1, 1)}, True), ({"a": counts(1000, 1)}, False), ({}, False)):
        (row,) = flops.compare_calls(stated(1, a=1), measured(functions))
        assert row.within is within


def row(**changed) -> Row:
    about = {"phase": "opt1", "flags_from": "opt1", "scene": "s", "scope": "total", "backend": "blocks"}
    about |= {"counted": 1, "measured": 100, "relative_difference": 0.06, "unexplained": 0.0}
    return Row(**about | changed)


def test_a_verdict_says_what_was_proved():
    verdicts = [
        columns._within(row(relative_difference=0.001, explained_to=0.08)),
        columns._within(row(explained_to=0.08)),
        columns._within(row(within=False)),
        columns._within(row(judged=False)),
    ]
    assert [text[0] for text in verdicts] == ["✓", "✓", "✗", "n"] and "8.0" in verdicts[1]


# --- costs.def and residues.def


@pytest.fixture
def phase(tmp_path, monkeypatch):
    """The folder of a phase of `lanes` with the costs.def and residues.def that a test writes."""

    def lay(costs_def: str, residues_def: str, lanes: int = 1) -> Path:
        (tmp_path / "costs.def").write_text(costs_def)
        (tmp_path / "residues.def").write_text(residues_def)
        made = msgspec.structs.replace(registry.find_phase("baseline"), path=tmp_path, lanes=lanes)
        monkeypatch.setattr(registry, "find_phase", lambda name: made)
        return tmp_path

    return lay


@pytest.mark.parametrize(
    ("line", "good"),
    [
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0,0) // why", True),
        ("COST(f, call, LANES, 0, 1, 2, 3, 4, 5, 6, 7, 8)", True),
        ("COST(f, call, 1, 0 0 0 0 0 0 0 0 0)", False),
        ("COST(f, call, 4, 0,0,0,0,0,0,0,0,0)", False),
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0)", False),
        ("COST(f, call, 1, 0,0,0,0,0,0,0,0,0) why", False),
    ],
)
def test_a_cost_line_has_nine_numbers_and_a_width(tmp_path, line, good):
    (tmp_path / "costs.def").write_text(f"// a comment\n{line}\n")
    if good:
        assert len(costs.read(tmp_path / "costs.def")) == 1
    else:
        with pytest.raises(StudyError, match=r"costs\.def:2: "):
            costs.read(tmp_path / "costs.def")


@pytest.mark.parametrize(
    "line",
    [
        "RESIDUE(calls, f, call, mul, 3)",
        "RESIDUE(calls, f, call, mul, 3, 2)",
        "RESIDUE(debug, f, call, mul, 3, 3)",
        "RESIDUE(calls, f, call, compare, 3, 3)",
        "RESIDUE(calls, f, step, mul, 3, 3)",  # no such part
    ],
)
def test_a_bad_residue_is_named(phase, line):
    phase("COST(f, call, LANES, 0,0,0,0,0,0,0,0,0)\n", f"{line}\n")
    with pytest.raises(StudyError, match=r"residues\.def"):
        costs.residues_of("mine", costs.of_phase("mine"))


def test_residues_are_parts_times_lanes_times_flops(phase):
    """Eight lanes: three products for each of 10 calls, and a fused one counts two."""
    phase(
        "COST(f, call, LANES, 0,0,0,0,0,0,0,0,0)\nCOST(g, call, 1, 0,0,0,0,0,0,0,0,0)\n",
        "// why\nRESIDUE(calls, f, call, mul, 3, 3) // a\n"
        "RESIDUE(both, f, call, fma, -1, 1)\nRESIDUE(shipped, g, call, add, 0, 2)\n",
    )
    one = stated(1, lanes=8)
    one.by_function = {name: Function(calls=10, parts={"call": 10}) for name in ("f", "g")}
    assert flops.explained(one, "calls") == {"f": {"mul": (240, 240), "fma": (-160, 160)}}
    assert flops.explained(one, "shipped") == {"f": {"fma": (-160, 160)}, "g": {"add": (0, 20)}}


def test_a_derived_phase_has_its_ancestors_residues(tmp_path, monkeypatch):
    """Those of the parts that it has itself."""
    about = store.read_json(registry.ROOT / "phases" / "opt4" / "phase.json")
    mine = {name: about[name] for name in ("title", "order", "idea", "paper")}
    mine |= {"name": "mine", "parent": "opt4", "derives": "opt4"}
    for name, data in (("opt4", about), ("mine", mine)):
        store.write_json(tmp_path / "phases" / name / "phase.json", data)
    (tmp_path / "phases" / "opt4" / "costs.def").write_text("COST(f, call, LANES, 0,100,0,0,0,0,0,0,0)\n")
    (tmp_path / "phases" / "opt4" / "residues.def").write_text("RESIDUE(both, f, call, mul, 3, 3) // why\n")
    monkeypatch.setattr(registry, "find_phase", lambda name: registry.phases(tmp_path)[name])
    assert len(costs.residues_of("mine", costs.of_phase("mine"))) == 1
    (tmp_path / "phases" / "mine" / "costs.def").write_text("COST(g, call, LANES, 0,100,0,0,0,0,0,0,0)\n")
    assert costs.residues_of("mine", costs.of_phase("mine")) == []


# --- folding


@pytest.mark.parametrize(
    ("functions", "edges", "named", "found"),
    [
        # dot (30 adds in 10 calls) is called 8 times by a, twice by norm; norm 3 times by b: by hand
        # a gets 24, norm 6, all of which goes on to b with norm's own 9.
        (
            {"a": (1, 100), "b": (1, 200), "norm": (3, 9), "dot": (10, 30)},
            {"a": {"dot": 8}, "norm": {"dot": 2}, "b": {"norm": 3}},
            {"a", "b"},
            {"a": 124, "b": 215},
        ),
        (
            {"a": (1, 100), "dot": (10, 30), "entry": (1, 7)},
            {"a": {"dot": 10}},
            {"a", "dot"},
            {"a": 100, "dot": 30, "entry": 7},
        ),
        (
            {"a": (2, 11), "b": (2, 12), "c": (2, 13), "d": (2, 14)},
            {"a": {"b": 1, "c": 1}, "b": {"c": 1, "d": 2}, "c": {"d": 5}},
            {"a"},
            {"a": 50},
        ),
    ],
)
def test_helpers_are_folded_into_their_callers_by_calls(functions, edges, named, found):
    made = flops.fold(measured({name: counts(*n) for name, n in functions.items()}, edges), named)
    assert {name: one.machine for name, one in made.items()} == found
    assert all(one.calls == functions[name][0] for name, one in made.items())


# --- the files of a run


def test_counts_json_is_added_to_and_newer_replaces_older(tmp_path):
    path = tmp_path / "counts.json"
    flops.write(path, [stated(1)], [measured({"a": counts(1, 1)})])
    other = stated(3)
    other.scene = "t"
    flops.write(path, [stated(2), other], [measured({"a": counts(1, 2)}), measured({}, scene="t")])
    found = flops.read(path)
    assert [one.flops.machine for one in found.declared] == [2, 3]
    assert [(one.scene, one.total.machine) for one in found.measured] == [("s", 2), ("t", 0)]
    assert Counts.of(found.measured[0].functions["a"]) == counts(1, 2)


def test_validation_json_keeps_what_was_not_measured_again(tmp_path):
    path = tmp_path / "validation.json"
    flops.write_validation(path, [row(), row(scene="t")])
    flops.write_validation(path, [row(counted=2)])
    assert [(one.scene, one.counted) for one in flops.read_validation(path)] == [("t", 1), ("s", 2)]
