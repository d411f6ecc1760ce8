"""The chapter of other systems, made of what each experiment's object has in a run; its sheet."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import complete
import numpy as np
import pytest

from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments import experiment
from study.experiments.section import Claim
from study.experiments.systems import experiment as systems
from study.experiments.systems import pictures
from study.pictures.images import Picture
from study.report import lessons


def test_a_run_without_systems_says_what_makes_them(tmp_path: Path) -> None:
    section = systems.section(SimpleNamespace(path=tmp_path))
    assert section.parts == [] and section.images == {} and section.lacking == "make systems"


def test_every_system_has_its_claims_and_tables() -> None:
    section = systems.section(SimpleNamespace(path=complete.RUN))
    claims, *others = section.parts
    ours = [one.system(complete.RUN) for one in experiment.find_all().values() if one.system]
    assert claims.name == "systems" and len(claims.rows) == sum(len(one.claims) for one in ours if one)
    assert {"rods", "throttle", "lattice", "fixed", "packets"} <= {part.name for part in others}
    assert {row.article for row in claims.rows} == {
        *("rod marching (P4)", "integer rays (P3)", "packet rays (P2)", "CPU-RTRM")
    }
    for _, (claim, _), *numbers in claims.table.cells:
        assert len(claim.split()) <= 12 and max(len(text.split()) for text, _ in numbers) <= 4, "a sentence"


def test_the_answer_is_the_span_of_the_ratios() -> None:
    claim = Claim("an article", "a claim", "1", "2", "2×", "–")
    ratios = [{"beside": 2.5}, {"beside": 0.5}, {"beside": 1.0}, {"speed": 3.0}, {"speed": 40.0}, {}]
    answer = systems._answer([dataclasses.replace(claim, **one) for one in ratios])
    assert re.findall(r"[\d.]+×", answer) == ["0.500×", "2.50×", "3.00×", "40.0×"]


def test_the_published_page_has_the_table_of_its_run() -> None:
    page = ROOT / "results" / "reference" / "systems.md"
    text = page.read_text(encoding="utf-8")
    (name,) = re.findall(r"run `([\w-]+)`", text)
    run = SimpleNamespace(path=page.with_name(name))
    assert systems.section(run).parts[0].markdown in text and run.path == lessons.systems()


def test_the_sheet_is_on_the_page_once_it_is_there(tmp_path: Path) -> None:
    shutil.copy(complete.RUN / "rods.json", tmp_path)
    path = tmp_path / "images" / f"{pictures.PICTURES}.png"
    assert path not in systems.section(SimpleNamespace(path=tmp_path)).images
    path.parent.mkdir()
    path.touch()
    assert next(iter(systems.section(SimpleNamespace(path=tmp_path)).images)) == path


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "rods.json").write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"rods\.json"):
        systems.section(SimpleNamespace(path=tmp_path))


def test_a_sheet_shows_the_difference_to_truth_or_where_rays_begin(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A picture that is off by 1/10 in one pixel, and one of a phase with rods."""
    names = ("R", "G", "B", "Z", "evals", "id")
    planes = Picture({name: np.zeros((8, 16), np.float32) for name in names})
    exact = planes | dict.fromkeys(("status", "status.all"), np.full((8, 16), 2, np.float32))
    off = planes | {"R": np.where(np.arange(128).reshape(8, 16) == 5, np.float32(0.1), np.float32(0))}
    starts = np.where(np.arange(128).reshape(8, 16) < 7, np.float32(-1), np.float32(3))
    drawn = {"fixed": off, "rods_simd": planes | {"start": starts}}
    figures = []
    monkeypatch.setattr(pictures.hits, "picture", lambda phase, *_: drawn[phase])
    monkeypatch.setattr(pictures.truth, "picture", lambda *_: exact)
    monkeypatch.setattr(pictures.panels, "save", lambda figure, path: figures.append(figure) or path)
    monkeypatch.setattr(pictures.registry, "cpu_supports", lambda phase: phase.name in drawn)
    assert pictures.write_pictures(tmp_path, 16) == [tmp_path / "images" / "systems-pictures.png"]
    _, _, rods, _, fixed = figures[0].axes[:5]  # its colour bar is the first
    shown = fixed.images[0].get_array()
    assert np.isclose(shown.max(), 0.1) and np.sum(shown > 1e-6) == 1
    assert rods.images[-1].get_array().mask.sum() == 7
    assert "0 ppm" in fixed.get_title(loc="left") and "identical" in rods.get_title(loc="left")
