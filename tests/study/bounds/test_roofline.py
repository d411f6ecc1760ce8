"""roofline.py and study/bounds/roof.py on tests/fixtures/run, with counts and ceilings of round numbers.

At n = 180 the fixture's opt4 takes 2000 core cycles and 1250 TSC cycles per pixel of scene0, opt3 twice that.
"""

import dataclasses
import functools
import json
import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import complete
import emitted
import matplotlib
import msgspec
import pandas as pd
import pytest
from complete import round_ceilings

from study.bounds import ceilings, roof, roof_shares
from study.bounds.roof import Point
from study.core import store
from study.core.run_schema import Context
from study.counting import costs, flops
from study.counting.counts import Counts
from study.counting.schema import Declared, Executed, Function, Measurement
from study.experiments.roofline import chapter, figures, tables
from study.numbers import analysis
from study.pictures import draw
from study.pictures.draw import RING, STYLE, save

FIXTURE = Path(__file__).parents[2] / "fixtures" / "run"
pytestmark = pytest.mark.usefixtures("few_resamples")
PIXELS = {90: 160 * 90, 180: 320 * 180}


@pytest.fixture
def limits() -> ceilings.Ceilings:
    return msgspec.convert(round_ceilings(), ceilings.Ceilings)


def measured(spec: str, scene: str, n: int, lanes: dict, load: float, store_: float, **more) -> Measurement:
    """Counts per pixel, of a picture n pixels high."""
    phase, _, flags = spec.partition("@")
    total = Counts(calls=1, load=round(load * PIXELS[n]), store=round(store_ * PIXELS[n]))
    total.lanes.update({key: round(value * PIXELS[n]) for key, value in lanes.items()})
    known = {
        "backend": "blocks",
        "variant": "shipped",
        "scene_hash": f"{scene}-hash",
        "calibrated": True,
    }
    about = {"phase": phase, "flags_from": flags or phase, "scene": scene, "width": n * 16 // 9, "height": n}
    return Measurement(
        **{**known, **about, "total": total.executed(), "functions": {}, "outside": None, **more}
    )


# opt4 at n = 180: 4000 flop per pixel in 2000 cycles, 2000 bytes. opt3 is counted at n = 90 only.
OPT4 = measured("opt4", "scene0", 180, {("fma", "single", 256): 2000}, 1500, 500)
OPT3 = measured("opt3", "scene0", 90, {("add", "double", 256): 6000, ("sqrt", "double", 256): 40}, 3000, 1000)
DECLARED = {
    **{"phase": "opt4", "flags_from": "opt4", "scene": "scene0", "scene_hash": "scene0-hash"},
    **{"width": 320, "height": 180, "flops": {"paper": 3000 * PIXELS[180], "machine": 4100 * PIXELS[180]}},
}
BASELINE = {
    **{"phase": "baseline", "flags_from": "baseline", "scene": "scene0", "scene_hash": "scene0-hash"},
    **{"width": 160, "height": 90, "flops": {"paper": 16000 * PIXELS[90], "machine": 12800 * PIXELS[90]}},
}


def write_counts(run: Path, several: list[Measurement], declared: list[dict]) -> None:
    made = [msgspec.to_builtins(one) for one in several]
    complete.write(run / "counts.json", {"schema": 1, "measured": made, "declared": declared})


@pytest.fixture
def run(tmp_path: Path) -> Path:
    run = Path(shutil.copytree(FIXTURE, tmp_path / "machine" / "run"))
    store.write_json(run / "ceilings.json", round_ceilings())
    write_counts(run, [OPT4, OPT3], [DECLARED, BASELINE])
    return run


@functools.cache
def timed() -> analysis.Data:
    """The fixture's frames, which no test here changes: a quarter of a second."""
    return analysis.load(FIXTURE)


def loaded(run: Path) -> analysis.Data:
    return dataclasses.replace(timed(), path=run, context=Context.load(run / "context.json"), kept={})


def points_of(run: Path) -> list[Point]:
    counted, limits, _ = roof.read(run, strict=False)
    return roof.points(loaded(run), counted, limits)


def point(run: Path, phase: str, n: int) -> Point:
    (found,) = (p for p in points_of(run) if (p.scene, p.phase, p.height) == ("scene0", phase, n))
    return found


def change_ceiling(run: Path, name: str, precision: str, bits: int, value: float) -> None:
    data = round_ceilings()
    for one in data["ceilings"]:
        if (one["name"], one.get("precision"), one["bits"]) == (name, precision, bits):
            one["value"] = value
    store.write_json(run / "ceilings.json", data)


def written(run: Path, name: str) -> str:
    return next(part for part in chapter.roofline(loaded(run)).parts if part.name == name).markdown


def test_a_point_is_flops_over_cycles_of_each_clock(run: Path) -> None:
    opt4 = point(run, "opt4", 180)
    assert opt4.flops_per_core_cycle == pytest.approx(2)
    assert opt4.flops_per_tsc_cycle == pytest.approx(3.2)
    # The launches lie within 1 % of the median: their interval, turned round.
    assert 2 / 1.011 < opt4.flops_per_core_cycle_low < 2 < opt4.flops_per_core_cycle_high < 2 / 0.989
    assert opt4.bytes == 2000 * PIXELS[180] and opt4.intensity == pytest.approx(2)
    assert (opt4.backend, opt4.calibrated, opt4.scaled_from_n) == ("blocks", True, None)
    assert opt4.L1_roof == pytest.approx(2 * 128) and opt4.memory_roof == pytest.approx(2 * 4)


def test_operations_that_hardware_tells_no_kind_of_have_no_mix_roof(limits: ceilings.Ceilings) -> None:
    """AMD's events have neither precision nor width, Intel's and SDE's no kind: no roof follows from them."""
    for key in (("any", "any", 0), ("any", "double", 256), ("add", "any", 0)):
        made = roof_shares.mix({key: 4000, ("fma", "double", 256): 10}, limits)
        assert made.unpriced > 0.9 and math.isnan(made.roof), key
    few = roof_shares.mix({("any", "any", 0): 1, ("fma", "double", 256): 4000}, limits)
    assert few.roof == pytest.approx(16, rel=1e-3)


@pytest.mark.parametrize("key", [("any", "any", 0), ("any", "single", 256)])  # AMD's events, Intel's
def test_hardware_counts_have_libm_inside_no_bytes_and_no_roof_of_their_mix(run: Path, key: tuple) -> None:
    pmu = measured("opt4", "scene0", 180, {key: 4000}, 0, 0, backend="pmu", calibrated=None)
    write_counts(run, [pmu, OPT3], [])
    opt4 = point(run, "opt4", 180)
    assert opt4.flops_per_core_cycle == pytest.approx(2) and opt4.libm_counted
    assert all(map(math.isnan, (opt4.load_bytes, opt4.bytes, opt4.intensity, opt4.mix_roof)))
    assert opt4.mix_bound is None and opt4.unpriced_share == 1
    assert "not yet validated" in tables.counted_by(opt4)


def test_shares_are_of_the_roofs_they_name(run: Path) -> None:
    opt4, opt3, baseline = (point(run, *one) for one in (("opt4", 180), ("opt3", 180), ("baseline", 90)))
    assert (opt4.fma_roof, opt4.share_of_fma_roof) == (32, pytest.approx(2 / 32))
    assert (opt4.mix_roof, opt4.share_of_mix_roof) == (pytest.approx(32), pytest.approx(2 / 32))
    # opt3: 1500 adds at 2 a cycle are 750 cycles, 10 square roots 160, 1510 of both at 3 a cycle fewer.
    assert (opt3.fma_roof, opt3.mix_bound) == (16, "add")
    assert opt3.mix_roof == pytest.approx(6040 / 750)
    assert opt3.share_of_mix_roof == pytest.approx(750 / 4000)
    # 12800 flop in 64000 cycles: of the scalar roof, and the paper's way.
    assert baseline.flops_per_core_cycle == pytest.approx(0.2)
    shares = baseline.share_of_fma_roof, baseline.share_of_avx2_roof
    assert shares == pytest.approx((0.2 / 4, 0.2 / 16))


def test_the_peak_is_what_the_ports_allow_and_the_roof_what_was_measured(run: Path) -> None:
    """An i7-7700 (6/158): two FMAs of 8 floats are 32 flop a cycle, whatever its ceilings say."""
    change_ceiling(run, "fma", "single", 256, 20.0)
    context = store.read_json(run / "context.json")
    context["cpu"] |= {"vendor": "GenuineIntel", "family": 6, "model_number": 158, "stepping": 9}
    context["cpu"]["microarchitecture"] = "Kaby Lake"
    store.write_json(run / "context.json", context)
    opt4 = point(run, "opt4", 180)
    assert (opt4.avx2_fma_peak, opt4.avx2_fma_roof) == (32, 20)
    assert opt4.share_of_avx2_peak == pytest.approx(2 / 32)
    assert opt4.share_of_avx2_roof == pytest.approx(2 / 20)
    assert opt4.paper_rule_share_of_avx2_peak == pytest.approx(1.5 / 32)
    assert opt4.paper_rule_share_of_avx2_roof == pytest.approx(1.5 / 20)
    text = written(run, "table6")
    assert "| 6.25\u00a0% | 10\u00a0% |" in text and "| 4.69\u00a0% | 7.5\u00a0% |" in text
    (run / "ceilings.json").unlink()  # the peak is no measurement
    assert point(run, "opt4", 180).share_of_avx2_peak == pytest.approx(2 / 32)


def test_bandwidth_is_by_the_phases_own_width_and_may_set_the_roof(run: Path) -> None:
    """By 64 bits L1 gives 32 bytes a cycle, a quarter of what it does by 256. baseline's 800 additions beside
    32,000 bytes are 400 cycles by the adders and 1000 by L1; by 256 bits it would be 250.
    """
    lanes = {("add", "double", 64): 800}
    write_counts(run, [measured("baseline", "scene0", 90, lanes, 20000, 12000), OPT4], [])
    one = point(run, "baseline", 90)
    assert (one.mix_bound, one.mix_roof) == ("add", pytest.approx(800 / 400))
    assert one.L1_roof == pytest.approx(800 / 1000) and one.L2_roof == pytest.approx(800 / 2000)
    assert (one.least_bound, one.least_roof) == ("L1", pytest.approx(0.8))
    assert one.share_of_least_roof == pytest.approx(800 / 64000 / 0.8)
    opt4 = point(run, "opt4", 180)  # 2000 bytes by 256 bits: 16 cycles, where FMAs take 125
    assert (opt4.least_bound, opt4.least_roof) == ("multiply", pytest.approx(32))
    (row,) = (line.split(" | ") for line in written(run, "roofline").splitlines() if "| baseline |" in line)
    assert {"0.800", "1.56\u00a0%", "L1"} <= set(row)
    shown, limits = roof.headline(points_of(run)), roof.read(run)[1]
    figure = figures.roofline(shown, limits)
    legend = {tuple(re.findall(r"[\d.]+", text.get_text())) for text in figure.legends[0].get_texts()}
    assert {("1", "64", "32.0"), ("1", "256", "128")} <= legend
    dashes = [line for line in figure.axes[0].lines if line.get_marker() == "_"]
    assert any(float(line.get_ydata()[0]) == pytest.approx(0.8) for line in dashes)


def test_where_no_access_of_its_width_was_measured_the_best_of_any_stands(
    limits: ceilings.Ceilings,
) -> None:
    assert limits.bandwidth_by("L1", 64) == 32 and limits.bandwidth_by("L1", 32) == 128


def under_the_points(run: Path) -> str:
    parts = chapter.roofline(loaded(run)).parts
    return next(part for part in parts if part.name == "roofline").foot


def test_shares_by_the_clock_under_vector_load_stand_beside(run: Path) -> None:
    """The fixture's frames: 4 GHz, and 3.5 under load where there are lanes."""
    store.write_json(run / "ceilings.json", round_ceilings() | {"core_hz_load": {"256": 3.2e9, "512": None}})
    opt4, baseline = point(run, "opt4", 180), point(run, "baseline", 90)
    assert (opt4.load_clock, opt4.load_clock_ceilings) == pytest.approx((0.875, 0.8))
    assert opt4.share_of_fma_roof_load == pytest.approx(2 / 0.875 / 32)
    assert opt4.share_of_least_roof_load == pytest.approx(2 / 0.875 / 32)
    assert math.isnan(baseline.load_clock) and math.isnan(baseline.share_of_fma_roof_load)
    (said,) = (line for line in roof_shares.clocks(points_of(run)) if "256 bits" in line)
    assert all(number in said for number in ("0.875", "0.800", "1.250"))
    text = written(run, "roofline")
    assert said in text and "| 6.25\u00a0% | 7.14\u00a0% |" in text and said in under_the_points(run)


def test_disturbed_ceilings_are_told_under_the_tables(run: Path) -> None:
    change_ceiling(run, "fma", "double", 256, 13.5)
    assert "2.37 instead of 2" in under_the_points(run)


def test_counts_of_another_height_are_scaled_and_say_so(run: Path) -> None:
    opt3, own = point(run, "opt3", 180), point(run, "opt3", 90)
    assert opt3.scaled_from_n == 90 and "scaled from n = 90" in tables.counted_by(opt3)
    assert own.scaled_from_n is None and "scaled" not in tables.counted_by(own)
    assert opt3.flops == pytest.approx(6040 * PIXELS[180]) and own.flops == 6040 * PIXELS[90]
    assert opt3.intensity == pytest.approx(6040 / 4000)


def test_without_a_back_end_the_declared_counts_stand_and_have_no_bytes(run: Path) -> None:
    baseline = point(run, "baseline", 90)
    assert (baseline.backend, baseline.flops) == ("declared", 12800 * PIXELS[90])
    assert all(map(math.isnan, (baseline.bytes, baseline.mix_roof, baseline.share_of_mix_roof)))


def test_declared_operations_have_a_roof_of_their_own(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Per pixel 12,000 products in 6,000 cycles, and 800 quotients at 8 each: the divider is busiest."""
    each = costs.Cost("f", "call", "1", {"mul": 12000, "div": 800, "call": 7, "compare": 5})
    monkeypatch.setattr(costs, "of_phase", lambda name: [each])
    function = {"f": {"calls": PIXELS[90], "parts": {"call": PIXELS[90]}}}
    write_counts(run, [], [BASELINE | {"by_function": function}])
    baseline = point(run, "baseline", 90)
    assert baseline.mix_roof == pytest.approx(12800 / 6400) and baseline.mix_bound == "divider"
    assert (baseline.least_bound, baseline.least_roof) == ("divider", baseline.mix_roof)
    assert math.isnan(baseline.L1_roof) and len(roof.remarks([baseline])) == 1


def test_declared_operations_by_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four lanes in the call, one in what is scalar; none where costs.def has a part that was not counted."""
    several = [
        costs.Cost("f", "call", "LANES", {"fma": 2, "call": 1}),
        costs.Cost("f", "facing", "1", {"sqrt": 3}),
    ]
    monkeypatch.setattr(costs, "of_phase", lambda name: several)
    parts = {"call": 10, "facing": 5}
    made = Declared(
        **{"phase": "opt4", "scene": "scene0", "width": 4, "height": 3, "lanes": 4},
        by_function={"f": Function(calls=10, parts=parts)},
    )
    found = flops.stated_operations(made, "single", 128, 32)
    assert found == {("fma", "single", 128): 80, ("sqrt", "single", 32): 15}
    parts["lit"] = parts.pop("facing")  # as published runs have it
    assert flops.stated_operations(made, "single", 128, 32) == found
    del parts["lit"]
    assert flops.stated_operations(made, "single", 128, 32) is None


def test_the_papers_rule_and_its_own_figures_stand_beside(run: Path) -> None:
    opt4, opt3 = point(run, "opt4", 180), point(run, "opt3", 180)
    assert opt4.paper_rule_flops_per_core_cycle == pytest.approx(1.5)
    assert opt4.paper_rule_share_of_avx2_roof == pytest.approx(1.5 / 32)
    assert math.isnan(opt4.paper_rule_share_of_avx2_peak)  # "Example CPU" is in no table
    assert (opt4.paper_flops_per_cycle, opt4.paper_share) == (2.383, pytest.approx(0.0745))
    assert math.isnan(opt3.paper_rule_flops_per_core_cycle)
    assert point(run, "baseline", 90).paper_share == pytest.approx(0.01087)
    stars = [line for line in figures.performance(points_of(run)).axes[0].lines if line.get_marker() == "*"]
    assert {float(line.get_ydata()[0]) for line in stars} == {0.173, 1.332, 2.383}  # Tables 5 and 6


def test_libms_inside_counts_where_it_is_seen(run: Path) -> None:
    inside = Counts(calls=1, load=2000 * PIXELS[180])
    inside.lanes["add", "single", 32] = 2000 * PIXELS[180]
    outside: dict[str, Executed] = {"expf": inside.executed()}
    lanes = {("fma", "single", 256): 2000}
    write_counts(run, [measured("opt4", "scene0", 180, lanes, 1500, 500, outside=outside)], [])
    opt4 = point(run, "opt4", 180)
    assert opt4.flops_per_core_cycle == pytest.approx(3) and opt4.intensity == pytest.approx(1.5)
    assert opt4.libm_counted
    write_counts(run, [OPT4], [])
    assert not point(run, "opt4", 180).libm_counted


def test_only_the_timed_code_and_scene_count(run: Path) -> None:
    one = {("add", "single", 32): 1}
    other = [
        measured("opt4", "scene0", 180, one, 1, 1, variant="calls"),
        measured("opt4", "scene0", 180, one, 1, 1, scene_hash="older"),
        measured("opt4@opt3", "scene0", 180, one, 1, 1),
        measured("opt4", "mandelbulb", 90, one, 1, 1),
    ]
    write_counts(run, other, [])
    assert [(p.scene, p.phase) for p in points_of(run)] == [("mandelbulb", "opt4")]


def test_a_calibrated_back_end_goes_before_another(run: Path) -> None:
    doubtful = measured("opt4", "scene0", 180, {("add", "single", 32): 1}, 1, 1, calibrated=None)
    stepped = measured("opt4", "scene0", 180, {("fma", "single", 256): 1000}, 1, 1, backend="ptrace")
    for several, first in (([doubtful, stepped], "ptrace"), ([stepped, OPT4], "blocks")):
        write_counts(run, several, [])
        assert point(run, "opt4", 180).backend == first


# What is of other code


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ({"compiler": "gcc 12.2.0"}, None),
        ({"compiler": "clang 14"}, "clang 14"),
        ({"flags": "-O1"}, "-O1"),
        ({"cpu": "Other CPU"}, "Other CPU"),
    ],
)
def test_counts_of_other_code_are_marked(run: Path, about: dict, said: str | None) -> None:
    other = msgspec.structs.replace(OPT4, **about)
    write_counts(run, [other], [])
    one = point(run, "opt4", 180)
    assert one.flops == 4000 * PIXELS[180]
    if said is None:
        assert one.foreign_counts is None
        return
    assert said in one.foreign_counts and tables.FOREIGN in tables.counted_by(one)
    assert [said in line and "(opt4)" in line for line in roof.remarks(points_of(run))] == [True]
    write_counts(run, [other, OPT4], [])  # the same picture by the right code: that one
    assert point(run, "opt4", 180).foreign_counts is None
    if "cpu" not in about:
        write_counts(run, [], [DECLARED | about])
        assert said in point(run, "opt4", 180).foreign_counts


def test_what_is_above_its_roof_is_marked(run: Path) -> None:
    """opt4 does 2 flop per cycle: under a roof of 2.4, above one of 1.9."""
    for value, above in ((2.4, False), (1.9, True)):
        change_ceiling(run, "fma", "single", 256, value)
        _, limits, _ = roof.read(run)
        points = points_of(run)
        assert any("opt4 on scene0" in line for line in roof.remarks(points)) == above
        assert ("above its roof" in written(run, "roofline")) == above
        figure = figures.roofline(roof.headline(p for p in points if p.intensity > 0), limits)
        rings = [line for line in figure.axes[0].lines if line.get_markersize() == RING["markersize"]]
        assert len(rings) == above


def test_few_launches_have_no_interval(run: Path) -> None:
    path = run / "frames.jsonl"
    frames = [json.loads(line) for line in path.read_text().splitlines()]
    path.write_text("".join(json.dumps(frame) + "\n" for frame in frames if frame["launch"] < 2))
    write_counts(run, [measured("opt1", "mandelbulb", 90, {("add", "double", 64): 100}, 1, 1)], [])
    counted, limits, _ = roof.read(run, strict=False)
    (opt1,) = roof.points(analysis.load(run), counted, limits)
    assert opt1.flops_per_core_cycle > 0 and math.isnan(opt1.flops_per_core_cycle_low)


# The command, its files and its figures


def test_what_is_missing_or_broken_is_status_2(run: Path, stepwise: Callable) -> None:
    for name, command in (("counts.json", "stepwise flops"), ("ceilings.json", "stepwise ceilings")):
        text = (run / name).read_text()
        (run / name).unlink()
        done = stepwise("roofline", run)
        assert done.returncode == 2 and name in done.stderr and command in done.stderr
        assert not (run / "figures").exists()
        (run / name).write_text(text)
    (run / "ceilings.json").write_text('{"schema": 1, "ceil')
    assert stepwise("roofline", run).returncode == 2
    store.write_json(run / "ceilings.json", round_ceilings())
    write_counts(run, [], [])
    assert stepwise("roofline", run).returncode == 2


def test_the_report_goes_on_without_ceilings(run: Path) -> None:
    (run / "ceilings.json").unlink()
    data = loaded(run)
    counted, limits, notes = roof.read(run, strict=False)
    points = roof.points(data, counted, limits)
    assert limits is None and len(notes) == 1
    assert figures.drawings(data, points, limits).keys() == {"performance"}
    assert [part.name for part in chapter.roofline(data).parts] == ["table5", "table6"]
    assert all(math.isnan(p.share_of_fma_roof) and math.isnan(p.mix_roof) for p in points)
    (run / "counts.json").unlink()
    counted, limits, notes = roof.read(run, strict=False)
    assert roof.points(data, counted, limits) == [] and len(notes) == 2
    assert figures.drawings(data, [], limits) == {} and chapter.roofline(data).parts == []


@pytest.mark.slow
def test_the_command_writes_tables_and_figures(run: Path, tmp_path: Path, stepwise: Callable) -> None:
    done = stepwise("roofline", run, "--json", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    made = emitted.result(done.stdout)
    assert made["ceilings"] == round_ceilings()["ceilings"]
    points = {(p["phase"], p["height"]): p for p in made["points"]}
    assert points["baseline", 90]["bytes"] is None and points["opt3", 180]["scaled_from_n"] == 90
    assert all(Path(path).is_file() for path in made["files"]) and not (run / "figures").exists()
    folder = tmp_path / "out" / "tables"
    names = {"table5", "table6", "roofline", "ceilings", "bandwidth"}
    assert {path.stem for path in folder.iterdir()} == names
    for path in folder.glob("*.md"):
        assert "nan" not in path.read_text().lower() and "None" not in path.read_text()
    assert "1.087" in (folder / "table5.md").read_text() and "opt4" not in (folder / "table5.md").read_text()
    assert "| 2.383 | 7.45\u00a0% |" in (folder / "table6.md").read_text()
    assert pd.read_csv(folder / "table6.csv").flops_per_core_cycle.max() == pytest.approx(2)


def test_roofs_that_a_phase_uses_are_labelled(run: Path) -> None:
    _, limits, _ = roof.read(run)
    shown = roof.headline(p for p in points_of(run) if p.intensity > 0)
    assert [(p.phase, p.height) for p in shown] == [("opt3", 180), ("opt4", 180)]
    found = figures.arithmetic_roofs(limits, shown)
    assert {roof: re.findall("FMA|double|single", text) for roof, text in found} == {
        8: ["double"],
        16: ["FMA", "double", "single"],
        32: ["FMA", "single"],
    }


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("lost", ["precision", "level", "both"])
def test_a_machine_without_ceilings_is_drawn_without_warning(run: Path, lost: str) -> None:
    data = round_ceilings()
    for one in data["ceilings"]:
        if lost == "both" or lost in one:
            one |= {"value": None, "reason": "did not repeat itself"}
    store.write_json(run / "ceilings.json", data)
    _, limits, _ = roof.read(run)
    axes = figures.roofline(roof.headline(p for p in points_of(run) if p.intensity > 0), limits).axes[0]
    assert all(0 < low < high < math.inf for low, high in (axes.get_xlim(), axes.get_ylim()))


def test_no_name_lies_on_another(run: Path, tmp_path: Path) -> None:
    """Six phases within a few per cent of each other: every mark is named, no box is on another or a mark."""
    _, limits, _ = roof.read(run)
    opt3, opt4 = roof.headline(p for p in points_of(run) if p.intensity > 0)
    speeds = [f"flops_per_core_cycle{end}" for end in ("", "_low", "_high")]
    crowd = [
        dataclasses.replace(
            opt4, phase=f"opt{4 + i}", **{name: getattr(opt4, name) * (1 + 0.01 * i) for name in speeds}
        )
        for i in range(6)
    ]
    with matplotlib.rc_context(STYLE):
        figure = figures.roofline([opt3, *crowd], limits)
        save(figure, tmp_path / "roofline", "a note\nof two lines")
    axes = figure.axes[0]
    names = [text for text in axes.texts if isinstance(text, draw.Name)]
    assert {text.get_text().split(" ")[0] for text in names} > {"opt3", *(f"opt{4 + i}" for i in range(6))}
    figure.draw_without_rendering()
    frame = axes.get_window_extent()
    boxes = [text.get_window_extent() for text in names]
    marks = axes.transData.transform([(p.intensity, p.flops_per_core_cycle) for p in (opt3, *crowd)])
    for i, box in enumerate(boxes):
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
        assert not any(box.overlaps(other) for other in boxes[:i]), names[i].get_text()
        assert not any(box.contains(*mark) for mark in marks), names[i].get_text()


def test_a_kernel_that_is_other_code_than_what_was_counted_has_no_point() -> None:
    """opt12_fused draws solids by spans, which its general code does not; a Mandelbulb by the same code."""
    data = analysis.load(FIXTURE.parents[2] / "results" / "reference" / "zen4-2026-11-29")
    counted, limits, _ = roof.read(data.path, strict=False)
    scenes: dict[str, set[str]] = {}
    for one in roof.points(data, counted, limits):
        scenes.setdefault(one.phase, set()).add(one.scene)
    assert scenes["opt12_fused"] == {"mandelbulb"} and len(scenes["opt11_ideal"]) == 2
