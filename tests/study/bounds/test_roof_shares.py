"""study/bounds/roof_shares.py: the roof of an operation mix, by hand, with ceilings of round numbers."""

import json
import math
import shutil
from pathlib import Path

import msgspec
import pytest
from complete import ROUND_RATES, round_ceilings
from hypothesis import given
from hypothesis import strategies as st

from study.bounds import ceilings, roof, roof_shares
from study.core import registry, store
from study.numbers import analysis

FIXTURE = Path(__file__).resolve().parents[2] / "fixtures" / "run"


@pytest.fixture
def limits() -> ceilings.Ceilings:
    return msgspec.convert(round_ceilings(), ceilings.Ceilings)


def test_the_busiest_resource_sets_the_roof(limits: ceilings.Ceilings) -> None:
    lanes = {
        ("fma", "double", 256): 400,  # 100 instructions
        ("mul", "double", 256): 200,  # 50
        ("add", "double", 256): 400,  # 100
        ("div", "double", 256): 8,  # 2
        ("sqrt", "double", 256): 8,  # 2
        ("compare", "double", 256): 100,  # 25
    }
    made = roof_shares.mix(lanes, limits)
    wanted = {"multiply": 75, "add": 50, "divider": 2 * 8 + 2 * 16, "issue": 279 / 3}
    assert made.cycles == pytest.approx(wanted)
    assert (made.flops, made.bound, made.unpriced) == (800 + 200 + 400 + 8 + 8, "issue", 0)
    assert made.roof == pytest.approx(1416 / 93)
    made = roof_shares.mix(
        lanes | {("div", "double", 256): 32}, limits
    )  # 8 divisions: 64 cycles, and 32 of roots
    assert (made.bound, made.roof) == ("divider", pytest.approx(1440 / 96))


def test_widths_and_precisions_add_up(limits: ceilings.Ceilings) -> None:
    lanes = {("div", "double", 64): 3, ("sqrt", "single", 32): 2, ("div", "single", 256): 16}
    made = roof_shares.mix(lanes, limits)
    assert made.cycles["divider"] == pytest.approx(3 * 8 + 2 * 16 + 2 * 8)
    assert made.cycles["issue"] == pytest.approx((3 + 2 + 2) / 3)


def test_operations_without_a_ceiling_are_told_and_not_free(limits: ceilings.Ceilings) -> None:
    lanes = {("rsqrt", "single", 256): 80, ("add", "single", 256): 240, ("add", "extended", 80): 80}
    made = roof_shares.mix(lanes, limits)
    assert made.flops == 400 and made.unpriced == pytest.approx(160 / 400)
    assert made.cycles == pytest.approx({"add": 15, "issue": 40 / 3})  # an rsqrt still takes an issue slot
    nothing = roof_shares.mix({("add", "half", 512): 32}, limits)
    assert nothing.unpriced == 1 and nothing.bound is None and math.isnan(nothing.roof)
    empty = roof_shares.mix({}, limits)
    assert math.isnan(empty.roof) and math.isnan(empty.unpriced)


KINDS = st.sampled_from([kind for kind, rate in ROUND_RATES.items() if rate and kind in ceilings.KINDS])
LANES = st.dictionaries(
    st.tuples(KINDS, st.just("double"), st.sampled_from([64, 128, 256])), st.integers(1, 10**9)
)


@given(LANES.filter(bool))
def test_no_mix_is_above_the_fma_roof_nor_any_of_its_operations_alone(lanes: dict) -> None:
    limits = msgspec.convert(round_ceilings(), ceilings.Ceilings)
    made = roof_shares.mix(lanes, limits)
    fma = limits.flops("fma", "double", 256)
    # Three instructions may be issued where two FMAs may: additions beside them have units of their own.
    assert made.roof <= fma * 1.5 * (1 + 1e-12)
    for key, n in lanes.items():
        assert max(roof_shares.mix({key: n}, limits).cycles.values()) <= max(made.cycles.values()) * (
            1 + 1e-12
        )


def test_fmas_alone_have_the_fma_roof(limits: ceilings.Ceilings) -> None:
    for precision, bits in (("double", 64), ("double", 256), ("single", 128)):
        made = roof_shares.mix({("fma", precision, bits): 1000}, limits)
        assert made.roof == pytest.approx(limits.flops("fma", precision, bits))


def test_a_scene_that_was_given_as_a_file_is_read_from_the_run(tmp_path: Path) -> None:
    """Whose kernel is other code than what was counted, but for a fractal."""
    run = Path(shutil.copytree(FIXTURE, tmp_path / "machine" / "run"))
    path = run / "frames.jsonl"
    told = {"scene": "mine", "phase": "opt12_fused", "flags_from": "opt12_fused", "kernel": "generated"}
    frames = [json.loads(line) for line in path.read_text().splitlines()]
    mine = [
        one | told for one in frames if (one["phase"], one["scene"], one["height"]) == ("opt4", "scene0", 180)
    ]
    path.write_text("".join(json.dumps(one) + "\n" for one in mine))
    (run / store.OWN_SCENES).mkdir()
    for name, apart in (("scene0", True), ("mandelbulb", False)):
        own = run / store.OWN_SCENES / "mine.json"
        own.write_bytes(registry.scenes()[name].path.read_bytes())
        cells = analysis.load(run).cells
        assert cells and {roof._apart(cell, run) for cell in cells} == {apart}
