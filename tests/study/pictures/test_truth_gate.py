"""No phase behind opt4 may be further from truth than baseline: the inequality, and margins."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.core import registry
from study.core.cli import StudyError
from study.core.registry import Phase
from study.pictures import gate


def values(**changed: float) -> dict:
    """Metrics of some picture, in memory."""
    made = {name: 60.0 if name.endswith("_db") else 5.0 for name in gate.TRUTH_METRICS}
    return {"non_finite": 0, "converged_only": False, "proved_fraction": 1.0, **made, **changed}


def inferior(mine: dict, base: dict, margins: dict, exact: dict | None = None) -> dict:
    others = {} if exact is None else {"the exact estimator": exact}
    return gate.inferior(mine, {"baseline": base, **others}, margins)


@pytest.mark.parametrize("name", gate.TRUTH_METRICS)
def test_worse_than_baseline_on_any_metric_fails(name):
    sign = -1 if name.endswith("_db") else 1
    base = values()
    assert inferior(base, base, {}) == {}
    assert inferior(values(**{name: base[name] - sign}), base, {}) == {}
    assert list(inferior(values(**{name: base[name] + sign * 1e-9}), base, {})) == [name]
    assert list(inferior(values(**{name: math.nan}), base, {})) == [name]
    # A baseline without a right hit is no measure of |Δt|: what it misses is in false_misses_ppm.
    assert list(inferior(base, values(**{name: math.nan}), {})) == [name] * (name != "dt_p99")
    beyond = values(**{name: base[name] + sign * 2})
    assert inferior(beyond, base, {name: 2}) == {}
    assert list(inferior(beyond, base, {name: 1.9})) == [name]


def test_distances_that_no_reference_has_are_judged_by_none_and_one_that_has_them_does():
    none = values(dt_p99=math.nan)
    assert inferior(none, none, {}) == {}
    assert list(inferior(values(dt_p99=5.5), none, {}, values())) == ["dt_p99"]
    assert list(inferior(none, none, {}, values())) == ["dt_p99"]


def test_infinite_is_as_near_as_floats_can_tell():
    far = inferior(values(psnr_db=149.0), values(psnr_db=math.inf), {})
    assert far["psnr_db"].startswith("149, baseline has 150")
    assert inferior(values(psnr_db=151.0), values(psnr_db=math.inf), {}) == {}
    assert inferior(values(psnr_db=149.0), values(psnr_db=math.inf), {"psnr_db": 1}) == {}


def test_what_a_phase_calls_near_enough_is():
    beyond, base = values(psnr_db=81.0), values(psnr_db=95.0)
    assert list(inferior(beyond, base, {})) == ["psnr_db"]
    assert inferior(beyond, base, {"enough_db": 80}) == {}
    assert inferior(values(psnr_db=79.0), base, {"enough_db": 80}).keys() == {"psnr_db"}
    assert inferior(values(psnr_db=59.9), values(), {"enough_db": 80}).keys() == {"psnr_db"}
    assert inferior(values(psnr_db=math.nan), base, {"enough_db": 80}).keys() == {"psnr_db"}


def test_no_margin_lets_a_picture_pass_that_is_not_finite():
    allowed = dict.fromkeys(gate.TRUTH_METRICS, 1e9)
    assert list(inferior(values(non_finite=1), values(), allowed)) == ["non_finite"]


def test_what_is_converged_only_is_gated_averaged_and_by_depth():
    names = {f"psnr{w}{s}_db": 50.0 for w in ("", "_none", "_ideal") for s in ("", "_display")}
    base = values(converged_only=True, proved_fraction=0.0, depth_agree_fraction=0.99, antialiased=names)
    nothing = dict.fromkeys(gate.HITS, math.nan)
    assert inferior({**base, **nothing}, {**base, **nothing}, {}) == {}
    worse = {**base, "psnr_db": 1.0, "depth_agree_fraction": 0.98, "antialiased": {**names, "psnr_db": 49.0}}
    assert set(inferior(worse, base, {})) == {"depth_agree_fraction", "antialiased.psnr_db"}
    proved = {**base, "proved_fraction": 0.5, "false_hits_ppm": 6.0}
    assert set(inferior(proved, base, {})) == {"false_hits_ppm"}


@pytest.mark.parametrize("name", ["psnr_ideal_db", "false_hits_ppm"])
def test_nobody_need_be_nearer_than_the_exact_estimator(name):
    sign = 1 if name.endswith("_db") else -1
    base, exact = values(), values(**{name: values()[name] - sign})
    assert inferior(exact, base, {}, exact) == {}
    worse = values(**{name: exact[name] - sign * 0.5})
    found = inferior(worse, base, {}, exact)
    assert list(found) == [name] and f"{exact[name]:g}: " in found[name]
    better = values(**{name: values()[name] + sign})
    assert inferior(base, base, {}, better) == {}  # baseline is the worse one: the bound
    assert list(inferior(base, base, {}, values(**{name: math.nan}))) == []
    assert list(inferior(values(**{name: math.nan}), base, {}, exact)) == [name]


@given(st.floats(0, 1e6), st.floats(0, 1e6), st.floats(0, 1e3))
def test_non_inferiority_is_the_inequality(mine, base, margin):
    failed = "dt_p99" in inferior(values(dt_p99=mine), values(dt_p99=base), {"dt_p99": margin})
    assert failed == (mine > base + margin)


def later(order: int, family: str = "ladder", **tolerance: object) -> Phase:
    known = registry.find_phase("opt1")
    return msgspec.structs.replace(known, name="opt9", order=order, family=family, tolerance=tolerance)


def test_phases_behind_opt4_are_held_against_truth():
    assert [gate.by_truth(later(order)) for order in (0, 4, 5, 9)] == [False, False, True, True]
    assert not gate.by_truth(later(9, "truth"))
    for name in ("baseline", "opt1", "opt2", "opt3", "opt4"):
        assert not gate.by_truth(registry.find_phase(name))


def test_margins_are_declared_with_a_reason():
    granted = {"dt_p99": 1e-6, "antialiased": {"psnr_db": 1}, "reason": "24 bits"}
    phase = later(5, truth=granted)
    gate.check(phase)
    assert gate.margins(phase) == {"dt_p99": 1e-6, "antialiased.psnr_db": 1}
    assert gate.margins(later(5)) == {}
    for wrong, message in (
        ({"dt_p99": 1}, r"truth: "),
        ({"reason": "so"}, r"truth: "),
        ({"dt_p99": -1, "reason": "so"}, r"truth\.dt_p99: -1"),
        ({"mask_mismatch_ppm": 1, "reason": "so"}, r"truth\.mask_mismatch_ppm: "),
        ({"dt_p99": math.inf, "reason": "so"}, r"truth\.dt_p99: inf"),
        ({"outline_pixels": 1.5, "reason": "so"}, r"truth\.outline_pixels: 1\.5"),
        ({"outline_pixels": 9, "reason": "so"}, r"truth\.outline_pixels: 9"),
    ):
        with pytest.raises(StudyError, match=message):
            gate.check(later(5, truth=wrong))


def test_a_phase_that_draws_the_ideal_is_judged_by_it_and_not_by_the_estimator():
    base, far = values(), values(psnr_db=10.0, psnr_display_db=10.0, psnr_ideal_db=91.0)
    ideal = {"psnr_ideal_db": 90.0, "antialiased.psnr_ideal_db": 40.0}
    assert set(inferior(far, base, {})) == {"psnr_db", "psnr_display_db"}
    assert gate.inferior(far, {"baseline": base}, {}, ideal) == {}
    near = gate.inferior(values(psnr_ideal_db=89.9), {"baseline": base}, {}, ideal)
    assert list(near) == ["psnr_ideal_db"] and near["psnr_ideal_db"].startswith("89.9, ")
    assert list(gate.inferior(values(psnr_ideal_db=math.nan), {"baseline": base}, {}, ideal)) == [
        "psnr_ideal_db"
    ]
    assert list(gate.inferior(values(psnr_ideal_db=91.0, dt_p99=6.0), {"baseline": base}, {}, ideal)) == [
        "dt_p99"
    ]
    mean = {f"psnr{w}{s}_db": 39.0 for w in ("", "_none", "_ideal") for s in ("", "_display")}
    bulb = values(converged_only=True, depth_agree_fraction=1.0, antialiased=mean)
    assert list(gate.inferior(bulb, {"baseline": bulb}, {}, ideal)) == ["antialiased.psnr_ideal_db"]


def test_the_ideal_is_declared_with_a_reason():
    granted = {"reason": "24 bits", "dt_p99": 1e-6}
    phase = later(11, truth=granted, ideal={"psnr_ideal_db": 90, "reason": "float"})
    gate.check(phase)
    assert (
        phase.draws_ideal
        and gate.left_to_truth(phase)
        and gate.margins(phase, gate.IDEAL) == {"psnr_ideal_db": 90}
    )
    assert (
        not later(11, truth=granted).draws_ideal and gate.margins(later(11, truth=granted), gate.IDEAL) == {}
    )
    for wrong, message in (
        ({"psnr_ideal_db": 90}, r"ideal: "),
        ({"psnr_db": 90, "reason": "so"}, r"ideal\.psnr_db: "),
        ({"reason": "so"}, r"ideal: "),
    ):
        with pytest.raises(StudyError, match=message):
            gate.check(later(11, truth=granted, ideal=wrong))
