"""Sections of a run's page: which pictures and back ends they speak of, and one line for a broken file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import complete
import pytest

from study.core.registry import ROOT
from study.experiments import experiment, section
from study.numbers import analysis

PICTURE = {"phase": "baseline", "flags_from": "baseline", "scene": "scene0", "width": 16, "height": 9}


def declared(phase: str = "baseline", height: int = 9, scene: str = "scene0") -> dict[str, Any]:
    function = {"calls": 2, "lanes": 2, "paper": 60, "machine": 50, "useful": 50, "parts": {"call": 2}}
    return {
        **PICTURE,
        **{"phase": phase, "flags_from": phase, "scene": scene, "height": height},
        "scene_hash": "0123456789abcdef",
        "threads": 1,
        "flops": {"paper": 60 * height, "machine": 50 * height},
        "by_function": {"sdf": function},
        "by_class": {"add": 50, "compare": 5, "call": 10},
        "executed": 50,
        "useful": 40,
        "useful_paper": 48,
    }


def checked(scope: str = "total", backend: str = "blocks", within: bool = True) -> dict[str, Any]:
    return {
        **PICTURE,
        **{"scope": scope, "variant": "calls", "backend": backend, "calibrated": True},
        **{"counted": 50, "measured": 50, "relative_difference": 0.0, "unexplained": 0.0},
        **{"residue_low": 0, "residue_high": 0, "explained_to": 0.0, "judged": True, "within": within},
    }


def sampled(per_cycle: float = 2.5) -> dict[str, Any]:
    profile = {
        **PICTURE,
        **{"variant": "calls", "event": "cpu-clock", "frames": 2, "frame_ns": 2e6, "cpu_ns": 2e6},
        **{"core_cycles": 6e6, "samples": 100, "weight": 1000, "covered": 1.0, "left_out": {}},
        "functions": [{"function": "sdf", "samples": 100, "weight": 1000}],
    }
    mca = {"throughput": 3.0, "latency": 9.0, "block_throughput": 3.0, "uops": 10.0, "width": 6}
    mca |= {"resources": 0.1, "registers": 0.1, "memory": 0.0}
    split = {"retiring": 0.6, "memory": 0.0, "core": 0.4, "ports": 0.1, "dependencies": 0.3}
    region = {"region": "sdf", "function": "sdf", "loop": False, "share": 0.9, "instructions": 8, "calls": 0}
    region |= {"mca": mca | {"split": split}, "measured": 4.0}
    bound = {
        **PICTURE,
        **{"by": "model", "processor": "x", "model": "llvm-mca 14", "remark": None, "covered": 0.9},
        **{"split": split, "cpu_ns": 2e6, "samples": 100, "compared": None, "regions": [region]},
    }
    beside = {"scene0|baseline|16|9": {"per_cycle": {"sdf": per_cycle}, "lanes_active": {}}}
    return {"schema": 1, "profiles": [profile], "beside": beside, "bounds": [bound]}


def stepped() -> dict[str, Any]:
    interval = {"value": 2.0, "low": 1.9, "high": 2.1, "launches": 6, "sufficient": True}
    row = {
        **{"ablation": "opt1+x", "against": "opt1", "scene": "scene0", "width": 16, "height": 9},
        **{"step": "added", "what": "a step", "paper": "2× (section 3)", "paper_value": 2.0},
        **{"gain": interval, "claim": "holds", "psnr_db": None, "fraction_over_1_255": 0.0},
        **{"against_psnr_db": None, "verdict": "identical"},
    }
    return {"schema": 1, "n": 9, "launches": 6, "rows": [row], "skipped": [], "failures": []}


def taken_out() -> dict[str, Any]:
    told = {"reference": "opt1", "idea": "an idea", "lines": 7, "change_psnr_db": 99.0, "change_max_abs": 0.5}
    return {**stepped(), "rows": [stepped()["rows"][0] | told | {"step": "removed"}]}


CONTENTS: dict[str, Callable[[], Any]] = {
    "counts.json": lambda: {"schema": 1, "declared": [declared(), declared("opt1")], "measured": []},
    "validation.json": lambda: {"schema": 1, "rows": [checked(), checked("sdf"), checked("calls of sdf")]},
    "hotspots.json": sampled,
    "ablations.json": stepped,
    "ideas.json": taken_out,
}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run with one small row of everything that the sections show."""
    folder = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))
    for name, made in CONTENTS.items():
        complete.write(folder / name, made())
    return folder


@pytest.fixture(scope="module")
def loaded() -> analysis.Data:
    """The frames of any such run, which no test here changes."""
    return analysis.load(ROOT / "tests" / "fixtures" / "run")


def parts_of(section: section.Section) -> dict[str, section.Part]:
    return {part.name: part for part in section.parts}


def put(run: Path, name: str, content: Any) -> None:
    complete.write(run / name, content)


def test_a_sound_run_has_every_part(run: Path) -> None:
    names = {name for section in experiment.sections(analysis.load(run)) for name in parts_of(section)}
    expected = {"table1", "table1-terms", "validation", "validation-functions", "ablations", "ideas"}
    assert names >= expected | {"hotspots-baseline", "table3", "table3-regions"}


# What is shown
