"""Files of a run that are cut off, empty or of another script: one line says so, status 2."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import started

from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.ablations import negative
from study.experiments.accuracy import chapter as accuracy_chapter
from study.experiments.frames import chapter as frames_chapter
from study.experiments.functions import chapter as functions_chapter
from study.experiments.pareto import chapter as pareto_chapter
from study.experiments.scaling import chapter as scaling_chapter
from study.experiments.section import Section
from study.experiments.stability import chapter as stability_chapter
from study.experiments.toolchains import chapter as toolchains_chapter
from study.experiments.views import chapter as views_chapter

PUBLISHED = max(ROOT.glob("results/reference/*/stability.json")).parent
INTERVAL = {"value": 1.0, "low": 0.9, "high": 1.1, "launches": 6, "sufficient": True}
TOOLCHAINS = {
    "schema": 1,
    "n": 16,
    "launches": 6,
    "native": {"gcc": "-march=emeraldrapids"},
    "rows": [
        {
            **{
                "compiler": "gcc",
                "flags": "as shipped",
                "more": "",
                "phase": "opt1",
                "scene": "trio",
                "n": 16,
            },
            **{"ms": INTERVAL, "speedup": INTERVAL, "changed_fraction": 0.0, "non_finite": 0},
            **{"psnr_to_shipped_db": None, "rmse_to_shipped": 0.0, "truth_psnr_db": 54.5},
        }
    ],
    "skipped": [],
    "failures": [],
}
ERRORS = {"psnr_db": 50.0, "rmse": 0.003, "wrong_ppm": 3.0, "depth_agree_fraction": 1.0, "non_finite": 0}
OWN = {**ERRORS, "averaged": False, "fraction_over_1_255": 0.01}
MEASURED = {
    "toolchains": TOOLCHAINS,
    "frames": {
        **{"schema": 1, "launches": 6, "threads": 2, "left_out": []},
        "rows": [
            {
                **{"phase": "opt4", "scene": "scene0", "width": 1920, "n": 1080, "hit": "the scene's own"},
                **{"hit_distance": 1e-6, "threads": 2, "goal": 60.0, "verdict": "missed", "present_ms": 1.0},
                **{"ms": [[20.0, 21.0]], "frames_per_s": INTERVAL, "frames": 2, "median_ms": 20.5},
                **{"worst_ms": 21.0, "p99_ms": None, "reference": "truth", **OWN, "to_own": None},
            }
        ],
    },
    "views": {
        **{"schema": 1, "n": 90, "error_n": 45, "launches": 6, "left_out": [], "failures": []},
        "rungs": [],
        "thumbnails": [],
        "rows": [
            {
                **{"phase": "opt1", "parent": "baseline", "scene": "trio", "view": "own", "change": ""},
                **{"tuned": False, "width": 160, "n": 90, "ns": [1e6], "ms": INTERVAL, "ratio": INTERVAL},
                **{"reference": "truth", **ERRORS},
            }
        ],
    },
}
SECTIONS: dict[str, Callable[[Path], Section]] = {
    "ablations": lambda path: negative.section(path),
    "accuracy": accuracy_chapter.errors,
    "frames": frames_chapter.rates,
    "functions": functions_chapter.approximations,
    "pareto": pareto_chapter.headline,
    "scaling": scaling_chapter.growth,
    "stability": stability_chapter.hard,
    "toolchains": toolchains_chapter.compilers,
    "views": views_chapter.elsewhere,
}


def whole(name: str) -> str:
    """A sound file: made here, or the published run's; of the hard cases the first."""
    if name in MEASURED:
        return json.dumps(MEASURED[name])
    text = (PUBLISHED / f"{name}.json").read_text()
    if name == "stability":
        data = json.loads(text)
        first, number = data["cases"][:1], data["cases"][0]["number"]
        rows = [row for row in data["results"] if row["number"] == number]
        text = json.dumps(data | {"cases": first, "results": rows})
    return json.dumps(json.loads(text))  # one line, however the published file is laid out


def changed(name: str, where: tuple, value: Any) -> str:
    """The sound file with something else at `where`; `del`: without it."""
    made = target = json.loads(whole(name))
    for key in where[:-1]:
        target = target[key]
    if value == "del":
        del target[where[-1]]
    else:
        target[where[-1]] = value
    return json.dumps(made)


@pytest.mark.parametrize("name", SECTIONS)
def test_sound(tmp_path: Path, name: str) -> None:
    (tmp_path / f"{name}.json").write_text(whole(name))
    section = SECTIONS[name](tmp_path)
    assert section.parts or section.html


def refused(folder: Path, name: str, text: str) -> None:
    file = folder / f"{name}.json"
    file.write_text(text)
    with pytest.raises(StudyError) as caught:
        SECTIONS[name](folder)
    said = str(caught.value)
    assert said.startswith(str(file)) and f"scripts/stepwise {name}" in said and "again" in said
    assert len(said.splitlines()) == 1 and caught.value.exit_status == 2


@pytest.mark.parametrize("name", SECTIONS)
def test_cut_off(tmp_path: Path, name: str) -> None:
    text = whole(name).rstrip()
    for end in (0, 1, len(text) // 2, len(text) - 1):
        refused(tmp_path, name, text[:end])


@pytest.mark.parametrize("name", SECTIONS)
def test_of_another(tmp_path: Path, name: str) -> None:
    other = {"toolchains": "stability"}.get(name, "toolchains")
    texts = ["{}", "[]", "[1]", "null", "5", '{"schema": 1}', '{"schema": 1, "rows": 3}']
    for text in [*texts, *[whole(other)] * (name not in ("pareto", "accuracy", "ablations"))]:
        refused(tmp_path, name, text)


LOST = [  # part of what was measured is gone, or is no measurement
    ("stability", ("cases",), []),
    ("stability", ("cases", 0), "del"),
    ("stability", ("results",), []),
    ("stability", ("results", 3), "del"),
    ("stability", ("results", 0, "number"), 99),
    ("stability", ("results", 0, "phase"), "opt11"),
    ("stability", ("results", 0, "errors", 0), "del"),
    ("stability", ("results", 0, "strengths", 0), "x"),
    ("stability", ("results", 0, "notes"), "del"),
    ("pareto", ("rows",), []),
    ("pareto", ("rows", 0, "ns_per_pixel"), "del"),
    ("toolchains", ("schema",), 2),
    ("toolchains", ("rows",), []),
    ("toolchains", ("rows", 0, "non_finite"), None),
    ("toolchains", ("rows", 0, "truth_psnr_db"), "x"),
    ("toolchains", ("rows", 0, "ms"), "del"),
    ("functions", ("entries",), []),
    ("functions", ("entries", 0, "function"), "del"),
    ("accuracy", ("rows", 0, "false_hits_ppm"), "del"),
    ("ablations", ("rows", 0, "gain"), "del"),
    ("ablations", ("rows", 0, "gain", "low"), "x"),
    ("ablations", ("skipped",), 5),
    ("frames", ("rows",), []),
    ("frames", ("rows", 0, "frames_per_s", "value"), "del"),
    ("frames", ("rows", 0, "p99_ms"), "del"),
    ("frames", ("rows", 0, "hit_distance"), "del"),
    ("scaling", ("rows",), []),
    ("scaling", ("rows", 0, "ns"), "del"),
    ("scaling", ("fits", 0, "time"), "del"),
    ("scaling", ("goals",), "del"),
    ("views", ("rows",), []),
    ("views", ("rows", 0, "ratio", "high"), "del"),
    ("views", ("rows", 0, "ms"), 5),
    ("views", ("rungs",), "del"),
]


@pytest.mark.parametrize("name, where, value", LOST)
def test_incomplete(tmp_path: Path, name: str, where: tuple, value: Any) -> None:
    refused(tmp_path, name, changed(name, where, value))


@pytest.mark.parametrize("name", ["pareto", "stability"])
@pytest.mark.parametrize("script", ["tables", "report"])
def test_the_scripts_end_in_status_2(tmp_path: Path, script: str, name: str) -> None:
    run = shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run")
    (run / f"{name}.json").write_text(whole(name)[:3000])
    command = [sys.executable, ROOT / "scripts" / "stepwise", script, run, "-o", tmp_path / "out" / "made"]
    done = started.run(command)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert f"{name}.json:1:" in done.stderr and f"scripts/stepwise {name}" in done.stderr
    assert not (tmp_path / "out").exists()
