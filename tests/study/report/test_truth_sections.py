"""The chapters that hold a run against truth, from its files alone: figures, edges of functions, fronts."""

from __future__ import annotations

import copy
import json
import re
import shutil
from pathlib import Path
from typing import Any

import complete
import pytest

from study.commands import report
from study.core import registry, run, schema, show
from study.core.registry import ROOT, Spec
from study.experiments.accuracy import chapter as accuracy_chapter
from study.experiments.functions import chapter as functions_chapter
from study.experiments.functions import edge_tables as functions_edges_page
from study.experiments.functions import figures as functions_figures
from study.experiments.functions import tables as functions_page
from study.experiments.pareto import fronts as pareto
from study.experiments.pareto import measure as measuring
from study.experiments.pareto import schema as pareto_schema
from study.experiments.section import Section
from study.numbers import analysis
from study.pictures import ladder as ladder_figures
from study.report import figures

Row = dict[str, Any]
PUBLISHED = max((ROOT / "results" / "reference").glob("*/pareto.json")).parent


def edge(argument: str, value: str, exact: str) -> Row:
    return {"argument": argument, "value": value, "exact": exact, "right": value == exact}


def entry(name: str, isa: str, stream: float, latency: float, ulp: float, at: tuple[str, ...] = ()) -> Row:
    """An entry of 1/√x; `at`: what it gives at 0, −1, ∞ in place of what IEEE 754's rSqrt asks for."""
    about = {"function": "rsqrt", "precision": "float", "family": "libm" if name == "libm" else "instruction"}
    times = {
        key: {"value": value, "low": value, "high": value}
        for key, value in (("stream_ns", stream), ("latency_ns", latency))
    }
    asked = (("0", "∞"), ("−1", "NaN"), ("∞", "0"))
    edges = [edge(a, v, e) for (a, e), v in zip(asked, at or ("∞", "NaN", "0"), strict=True)]
    found = {"name": name, "isa": isa, "max_ulp": ulp, "rms_ulp": ulp / 3, "missing": None, "count": 16}
    return {**about, **found, **times, "front": False, "worst_a": 1.0, "worst_b": 0, "edges": edges}


# libm: alone on the front of latency; fast and near: on that of throughput, whose Newton step loses 0.
LIBM = entry("libm", "scalar", 2.0, 5.0, 0.5)
NEAR = entry("rsqrtps + 1", "AVX2", 1.0, 9.0, 2.5, ("NaN", "NaN", "0"))
NARROW = entry("rsqrtps + 1", "SSE", 1.5, 9.5, 2.5, ("NaN", "NaN", "0"))
TRICK = entry("Lomont + 0", "SSE", 1.2, 6.0, 5e5, ("1.3212e+19", "3.2879e+38", "0"))


def approximated(*entries: Row) -> Row:
    cpu = {"model": "Example CPU", "vendor": "Example Inc", "family": 6, "model_number": 7, "stepping": 2}
    span = {"low": 1.0, "high": 2.0, "both_signs": False}
    floats = [{"first": 1.0, "last": 4.0, "stride": 1}]
    target = {"function": "rsqrt", "arguments": 1, "float_segments": floats, "float_a": span}
    return {
        **{"schema": 1, "quick": True, "rounds": 7, "context": {"cpu": cpu}, "normalise": [], "article": {}},
        "entries": list(entries),
        "targets": [target | {"double_a": span, "timed_a": span}],
        "rsqrt_tables": [{"instruction": "rsqrtss", "sha256": "ab" * 32, "max_relative_error": 3e-4}],
    }


def point(phase: str, pace: float, psnr: float) -> Row:
    interval = {"value": pace, "low": pace * 0.9, "high": pace * 1.1, "launches": 6}
    return {
        **{"scene": "trio", "phase": phase, "n": 90, "hit_distance": 1e-6, "max_steps": 3000},
        **{"own_parameters": True, "converged_only": False, "beaten_by": None, "ns_per_pixel": interval},
        **{"evals_per_ray": 50.0, "ns_per_eval": pace / 50, "psnr_db": psnr, "non_finite": 0, "dt_p99": 1e-5},
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The fixture run with the files of speed against error, accuracy and functions, and no picture."""
    made = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))
    rows = [point("baseline", 1000, 80), point("opt4", 50, 84)]
    speed = {"schema": 1, "n": 90, "launches": 6, "rows": rows, "winners": pareto.winners(rows)}
    complete.write(made / "pareto.json", speed)
    complete.write(made / "functions.json", approximated(LIBM, NEAR, NARROW, TRICK))
    errors = json.loads((PUBLISHED / "accuracy.json").read_text())
    kept = [r for r in errors["rows"] if r["scene"] == "trio" and r["phase"] in ("baseline", "opt4")]
    complete.write(made / "accuracy.json", errors | {"rows": kept})
    return made


def part_of(section: Section, name: str) -> show.Table:
    return next(part.table for part in section.parts if part.name == name)


# --- Figures


@pytest.mark.slow
def test_the_page_has_its_figures_from_the_files_alone(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ladder_figures, "PLOTS", {})
    one = functions_figures.drawings
    few = ("functions-float", "functions-float-latency")
    monkeypatch.setattr(functions_figures, "drawings", lambda r: {n: one(r)[n] for n in few})
    stale = folder / "figures" / "pareto.png"
    stale.parent.mkdir()
    stale.write_bytes(b"of an older file")
    html = report.page(analysis.load(folder, strict=False), tmp_path / "out" / "index.html")
    chapters = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', html, re.DOTALL))
    first, _, more = chapters["pareto"].partition("<details>")
    assert (
        "Speed against error to ground truth; the front is the line" in first and first.count("<figure") == 1
    )
    assert more.count("<figure") == 1 and "Speed against |Δt|" in more
    assert chapters["accuracy"].count("<figure") == 1 and "where they lie" in chapters["accuracy"]
    assert chapters["functions"].count("<figure") == 2 and "ns per call, latency" in chapters["functions"]
    drawn = {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    assert drawn >= {"pareto", "pareto-distance", "accuracy-where", *few}
    assert not drawn & {"pareto-ideal", "pareto-hits"}  # no row has that measure
    assert (tmp_path / "out" / "figures" / "pareto.png").read_bytes() != stale.read_bytes()


def test_what_only_rendering_makes_is_said_in_one_line(folder: Path) -> None:
    section = accuracy_chapter.errors(folder)
    assert figures.absent(section) == [
        "trio by baseline: where it is wrong",
        "trio by opt4: where it is wrong",
    ]
    assert section.script == "scripts/stepwise accuracy --scene trio -n 180"
    for path in section.images:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"picture")
    assert figures.absent(section) == []


def test_both_precisions_and_both_times_have_a_figure() -> None:
    noise = entry("noise", "SSE", 3.0, -0.1, 0.4)  # its latency, within the chain's own noise, is none
    made = functions_figures.drawings(approximated(LIBM, NEAR, noise))
    assert list(made) == [f"functions-{p}{time}" for time in ("", "-latency") for p in ("float", "double")]
    axes = made["functions-float-latency"].make().axes[1]
    assert sorted(tuple(marks.get_offsets()[0]) for marks in axes.collections) == [(0.5, 5.0), (2.5, 9.0)]


# --- Functions


def test_fronts_of_throughput_and_of_latency_are_told_apart() -> None:
    nothing = entry("noise", "SSE", 3.0, -0.1, 0.4)  # nearest; its latency is within the chain's own noise
    fronts = {r["name"]: r["fronts"] for r in functions_page.fronts(approximated(LIBM, NEAR, TRICK, nothing))}
    assert fronts == {
        "libm": ["throughput", "latency"],
        "rsqrtps + 1": ["throughput"],
        "noise": ["throughput"],
    }


def test_edges_show_only_who_differs_and_where(folder: Path) -> None:
    table = part_of(functions_chapter.approximations(folder), "functions-edges")
    assert [column.name for column in table.columns] == [
        "function",
        "implementations",
        "0",
        "−1",
    ]  # ∞: all agree
    assert [[text for text, _ in row[1:]] for row in table.cells] == [
        ["asked for", "∞", "NaN"],
        ["rsqrtps + 1 (AVX2, SSE)", "NaN", "·"],
        ["Lomont + 0 (SSE)", "1.32e+19", "3.29e+38"],
    ]
    marks = [["bad" in mark.split() for _, mark in row[2:]] for row in table.cells]
    assert marks == [[False, False], [True, False], [True, True]]
    made = approximated(LIBM, NEAR, NARROW, TRICK)
    assert "The other 1 of 4 entries agree" in functions_edges_page.caption(made, ["rsqrt", "log"])
    parts = {part.name: part for part in functions_chapter.approximations(folder).parts}
    said = parts["functions-edges"].foot
    assert "1 of 4 entries agree with it at every input tried, every one of libm among them" in said


def test_where_all_agree_there_is_no_table_of_edges() -> None:
    result = approximated(LIBM)
    assert all(functions_edges_page.rows(result, of) == [] for of in functions_edges_page.TABLES.values())
    assert "1 of 1 entries agree" in functions_edges_page.remark(result)
    assert functions_edges_page.remark(approximated(LIBM | {"edges": []})) is None


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("−5.3419e-155", "−5.34e−155"),
        ("0.0049620", "0.00496"),
        *((same, same) for same in ("NaN", "−∞", "−0", "0")),
    ],
)
def test_values_at_edges_have_three_digits(text: str, shown: str) -> None:
    assert functions_edges_page.short(text) == shown


def test_the_tables_of_reciprocal_roots_name_their_cpu(folder: Path) -> None:
    table = part_of(functions_chapter.approximations(folder), "rsqrt")
    assert table.cells[0][1][0] == "Example CPU; Example Inc, family 6, model 7, stepping 2"
    unknown = copy.deepcopy(approximated(LIBM)) | {"context": None}
    assert functions_page.tables(unknown)[0]["cpu"] == "unknown CPU"


# --- Their description


def test_the_keys_of_speed_against_error_are_described(tmp_path: Path) -> None:
    scene = registry.find_scene("two_spheres")
    points = measuring.grid(scene, [Spec.parse("baseline")], [], [])
    rows, _ = measuring.study_scene(scene, points, (8, 8), 1, 1, run.FASTEST, tmp_path)
    assert rows and not schema.unknown(rows, list[pareto_schema.Row])
