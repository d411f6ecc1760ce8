"""The ladders among which a reader of the page can choose: whose they are, and what they may state."""

from __future__ import annotations

import json

import pytest

from study.core.registry import ROOT
from study.numbers import analysis, ladder
from study.report import machines

REFERENCE = ROOT / "results" / "reference"


@pytest.mark.slow
def test_published_machines_state_ratios_only_beside_the_papers_program() -> None:
    """At 1280×720; this run's baseline was timed beside the paper's, which took 1 / 0.8693 times as long."""
    run = REFERENCE / "zen4-2026-11-27-720p"
    data = analysis.load(run, strict=False)
    found = machines.ladders(data, ladder.rows(data))
    own, *others = found["machines"]
    names = [one["name"] for one in found["machines"]]
    assert own["name"] == "Zen 4" and {"Zen 3", "Zen 5", "Zen 4, AVX2 alone"} <= set(names)
    assert len(names) == len(set(names))
    for one in others:
        held = (REFERENCE / one["about"].split()[1].rstrip(":") / "original.json").is_file()
        for scene in one["scenes"].values():
            assert scene["size"] == "1280×720" and scene["cells"]["opt4 1"][0][1] > 0
            assert all(bool(ratios[0]) == held for _, ratios, _ in scene["cells"].values())
            assert bool(scene["cells"]["opt4 1"][1][2]) == held
        assert held or machines.UNCHECKED in one["about"]
    rows = json.loads((run / "original.json").read_text())["rows"]
    (beside,) = [row for row in rows if (row["phase"], row["scene"]) == ("baseline", "scene0")]
    over, low, high = own["scenes"]["scene0"]["cells"]["baseline 1"][1][2][1:]
    assert over == pytest.approx(1 / beside["ours_over_theirs"]["value"], rel=1e-5)
    assert low < over < high
    opt4 = own["scenes"]["scene0"]["cells"]["opt4 1"][1]
    assert opt4[2][1] == pytest.approx(opt4[0][1] * over, rel=1e-5)


@pytest.mark.slow
def test_a_machine_without_pictures_of_that_size_shows_its_largest() -> None:
    data = analysis.load(ROOT / "tests" / "fixtures" / "run", strict=False)
    found = machines.ladders(data, ladder.rows(data))
    assert found["scenes"][0]["size"] == "320×180" and len(found["machines"]) > 3
    for one in found["machines"][1:]:
        assert {scene["size"] for scene in one["scenes"].values()} == {"1280×720"}
    assert "<" not in machines.script(data, ladder.rows(data))
