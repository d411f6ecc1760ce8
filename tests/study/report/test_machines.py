"""The ladders among which a reader of the page can choose: whose they are, and what they may state."""

import json

import pytest

from study.core.registry import ROOT
from study.numbers import analysis, ladder
from study.pictures import charts
from study.pictures.charts import Ratio
from study.report import machines

REFERENCE = ROOT / "results" / "reference"


@pytest.mark.slow
def test_published_machines_state_ratios_only_beside_the_papers_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At 1280×720; this run's baseline was timed beside the paper's, which took 1 / 0.8693 times as long."""
    drawn: list[Ratio] = []
    monkeypatch.setattr(charts, "speedups", lambda found: drawn.extend(found) or "chart")
    run = REFERENCE / "zen4-2026-11-29-720p"
    data = analysis.load(run)
    assert machines.chart(data, ladder.rows(data)) == "chart"
    names = list(dict.fromkeys(one.machine for one in drawn))
    assert names[0] == "Zen 4 (this run)" and {"Zen 3", "Zen 5", "Zen 4, AVX2 alone"} <= set(names)
    bases = {name: {one.base for one in drawn if one.machine == name} for name in names}
    assert "baseline" in bases[names[0]] and "the paper's baseline" in bases[names[0]]
    assert all(("baseline" in found) == ("the paper's baseline" in found) for found in bases.values())
    assert all(machines.TIMES in found for found in bases.values())
    rows = json.loads((run / "original.json").read_text())["rows"]
    (beside,) = [row for row in rows if (row["phase"], row["scene"]) == ("baseline", "scene0")]
    wanted = (names[0], "scene0", "the paper's baseline", "baseline")
    (one,) = [r for r in drawn if (r.machine, r.scene, r.base, r.phase) == wanted]
    assert one.value == pytest.approx(1 / beside["ours_over_theirs"]["value"], rel=1e-5)
    assert one.low < one.value < one.high
