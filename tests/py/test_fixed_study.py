"""scripts/fixed.py: its whole way at a small size, its tables of a made-up result, which blocks are wrong."""

from __future__ import annotations

import contextlib
import json
import os
import sys

import numpy as np
import pytest
import started
from documented import keys

from study import fixed, fixed_page, fixed_pictures, registry, run, show, systems
from study.cli import StudyError
from study.registry import ROOT


def made_up() -> dict:
    one = {"ms": 4.0, "ms_low": 3.0, "ms_high": 5.0, "psnr_db": 50.0, "wrong_ppm": 400.0, "dt_p50": 1e-4}
    one |= {"dt_p99": 0.002, "cleared": 0.25, "wrongly_cleared_ppm": 100.0, "non_finite": 0}
    about = {"width": 320, "n": 180, "settings": "bits=20"}
    ratio = {"gain": 2.0, "gain_low": 1.0, "gain_high": 3.0}
    ratio |= {"over_float": 0.5, "over_float_low": 0.4, "over_float_high": 0.6}
    rows = [one | about | ratio | {"case": case, "phase": fixed.CASES[case][0]} for case in fixed.CASES]
    for row in rows:
        if row["phase"] == "fixed_float":
            row |= {"ms": 2.0, "ms_low": 1.9, "ms_high": 2.1, "psnr_db": None, "wrong_ppm": 0.0}
    sweep = [one | {"bits": b, "roots": r, "settings": ""} for b in fixed.BITS for r in ("article", "2", "3")]
    sweep.append({"bits": 28, "roots": "article", "settings": "", "refused": "a radius of 5: does not fit"})
    frames = {"p5": 10.0, "p50": 14.29 * 35, "p95": 600.0, "most": 700.0}  # as the article's on one core
    moving = {"phase": "fixed_simd", "threads": 1, "frames": 30, "width": 1920, "n": 1080, "ms": frames}
    moving |= {"update_ms": 0.01, "core_ns_per_pixel": 14.29e6 * 35 / (1920 * 1080)}
    twice = moving | {"threads": 2, "ms": frames | {"p50": 100.0}, "core_ns_per_pixel": 200e6 / (1920 * 1080)}
    clearing = [one | about | {"clear": clear} for clear in fixed.CLEARS]
    return {"article": fixed.ARTICLE, "rows": rows, "sweep": sweep, "clearing": clearing,
            "animation": [moving, twice]}  # fmt: skip


IN_LANES = {  # what may be timed on a CPU of so many
    1: ["article, 1 lane", "1 lane"],
    8: ["article, 1 lane", "1 lane", "8 lanes", "float, 8 lanes"],
    16: ["article, 1 lane", "1 lane", "8 lanes", "16 lanes", "16 lanes, 28 bits", "float, 8 lanes",
         "float, 16 lanes"],
}  # fmt: skip


@pytest.mark.parametrize(
    ("isa", "lanes"), [({"avx512f", "avx512dq"}, 16), (set(), 8), (None, 1)], ids=["16", "8", "1"]
)
def test_no_case_is_timed_in_lanes_that_the_cpu_lacks(monkeypatch, isa, lanes):
    """16 lanes on a CPU of 8 would be 8 by another name; what all are compared with is the widest float."""
    has = {"sse2"} | ({"avx2", "fma"} | isa if isa is not None else set())
    monkeypatch.setattr(registry, "cpu_flags", lambda: has)
    assert list(fixed.able()) == IN_LANES[lanes]
    monkeypatch.setattr(fixed, "milliseconds", lambda *a: 5.0 if a[0] == "fixed_float" else 10.0)
    monkeypatch.setattr(fixed, "errors", lambda *a: {})
    rows = {row["case"]: row for row in fixed.beside(16, 3, 1)}
    ratio = 0.5 if lanes > 1 else None
    assert list(rows) == IN_LANES[lanes] and rows["1 lane"].get("over_float") == ratio


def test_the_rows_of_systems_where_8_lanes_are_the_most():
    result = made_up()
    result["rows"] = [row for row in result["rows"] if row["case"] in IN_LANES[8]]
    (integers,) = [r for r in fixed_page.system_rows(result) if "in floats" in r["what"]]
    assert integers["what"].startswith("8 lanes") and "floats 2.0" in integers["ours"]
    assert fixed_page.system_rows(result)[0]["error"].startswith("50.0 dB")
    assert fixed_page.draw(result).axes[1].lines[-2].get_label() == "the same in floats"


def test_the_rows_of_systems_by_hand(tmp_path):
    (tmp_path / fixed.FILE).write_text(json.dumps(made_up()))
    rows = fixed_page.system_rows(made_up())
    by_what = {row["what"]: row for row in rows}
    one = by_what["fixed_simd, spheres40_animated 1920×1080, ms a frame, 1 thread"]
    assert one["ratio"] == "1.00× its pixels per core and second"
    assert one["error"] == "50.0 dB, 400 ppm wrong hits (the still at 320×180)"
    assert one["ours"] == "500 (95 % of frames under 600 ms)"
    two = by_what["fixed_simd, spheres40_animated 1920×1080, ms a frame, 2 threads"]
    assert two["ratio"] == "2.50× its pixels per core and second"  # 500.15 core·ms over 200
    integers = by_what["16 lanes against the same in floats, ms"]
    assert integers["ratio"].split() == ["0.500×", "[0.400,", "0.600]", "the", "floats'", "speed"]
    assert integers["error"] == "50.0 dB, 400 ppm wrong hits; floats none, 0 ppm wrong hits"
    section = systems.section(tmp_path)
    assert {part.name for part in section.parts} >= {"systems", "fixed", "fixed-bits", "fixed-clearing"}
    assert fixed_pictures.PICTURES in str(list(section.images)) and fixed_page.FIGURE in section.drawn
    text = show.markdown(show.table(made_up()["sweep"], fixed_page.SWEEP))
    assert "a radius of 5: does not fit" in text and "three" not in text and "3 Newton steps" in text


def test_a_broken_file_is_named(tmp_path):
    (tmp_path / fixed.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"fixed\.json: not what scripts/fixed\.py writes"):
        systems.section(tmp_path)


def test_settings_are_of_the_driver_alone(monkeypatch):
    monkeypatch.setenv(fixed.SETTINGS, "bits=9")
    with fixed.settings("bits=10", 8):
        assert os.environ[fixed.SETTINGS] == "bits=10" and os.environ["STEPWISE_ISA_LIMIT"] == "avx2"
    assert os.environ[fixed.SETTINGS] == "bits=9" and "STEPWISE_ISA_LIMIT" not in os.environ


def test_what_does_not_fit_is_a_row_and_another_error_is_one(monkeypatch):
    def errors(phase, words, scene, size):
        if "roots=article" in words:
            raise run.DriverError(status, "render: /any/scene.json: too large")
        return {"psnr_db": 1.0}

    monkeypatch.setattr(fixed, "errors", errors)
    monkeypatch.setattr(fixed, "milliseconds", lambda *a: 1.0)
    status = run.UNSUPPORTED
    rows = fixed.sweep(16, 2, 1, "fixed")
    assert [r.get("refused") for r in rows if r["roots"] == "article"] == ["too large"] * len(fixed.BITS)
    assert all("ms" in r for r in rows if r["roots"] != "article")
    status = run.NO_MEMORY
    with pytest.raises(run.DriverError):
        fixed.sweep(16, 2, 1, "fixed")


def test_wrong_blocks_by_hand():
    made = {"cleared": np.zeros((40, 40), np.float32)}
    made["cleared"][16:32, :16] = made["cleared"][32:, 32:] = 1
    whole = {"id": np.full((40, 40), -1, np.float32)}
    whole["id"][20, 3:5] = whole["id"][0, 39] = 7  # in a cleared block twice, and in one that is not
    assert fixed_pictures.wrong_blocks(made, whole) == [(0, 16)]
    assert fixed_pictures.lost_in(made, whole) == "1 blocks wrongly cleared, 2 pixels lost"


def test_each_panel_has_its_own_pictures_losses(monkeypatch, tmp_path):
    """Safe blocks that lose a pixel: their panel says so, and draws it."""
    words, panels = [], []
    seen = {"corners": 3, "safe": 1, "never": 0}  # cleared pixels of a row of spheres

    @contextlib.contextmanager
    def settings(said):
        words.append(said.rpartition("=")[2])
        yield

    def picture(*_):
        planes = {c: np.zeros((16, 16), np.float32) for c in ("id", "cleared", "R", "G", "B")}
        planes["cleared"][0, : seen[words[-1]]] = 1
        return planes

    monkeypatch.setattr(fixed, "settings", settings)
    monkeypatch.setattr(fixed_pictures.rods, "picture", picture)
    monkeypatch.setattr(fixed_pictures, "save", lambda figure, *_: panels.extend(figure.axes))
    fixed_pictures.write_pictures(tmp_path)
    assert [p.get_title() for p in panels] == [
        "four corners: 1 blocks wrongly cleared, 3 pixels lost",
        "planes against spheres: 1 blocks wrongly cleared, 1 pixels lost",
    ]
    assert [len(p.patches) for p in panels] == [1, 1]


def test_all_of_it_small(tmp_path):
    words = ["-n", "16", "--sizes", "16", "--frames", "2", "--frame-n", "16", "--launches", "2", "--json"]
    done = started.run([sys.executable, str(ROOT / "scripts" / "fixed.py"), *words, "--run", str(tmp_path)])
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / fixed.FILE).read_text())
    assert result == json.loads(done.stdout)
    simd = registry.find_phase("fixed_simd")
    most = 1 if registry.missing_isa(simd) else registry.variant_here(simd)["lanes"]
    assert [row["case"] for row in result["rows"]] == IN_LANES[most]
    assert len(result["sweep"]) == 3 * len(fixed.BITS) and any("refused" in row for row in result["sweep"])
    assert result["clearing"][0]["wrongly_cleared_ppm"] == 0 < result["clearing"][1]["wrongly_cleared_ppm"]
    assert all(len(row["all_ms"]) == 2 for row in result["animation"])
    named = {key for row in (result["rows"][0], result["sweep"][-1], result["animation"][0]) for key in row}
    common = {"width", "scene", "ms_low", "ms_high"} | keys("rods.json") | keys("frames.json")
    assert (
        not named
        - keys("fixed.json")
        - common
        - {"gain_low", "gain_high", "over_float_low", "over_float_high"}
    )
    assert (tmp_path / "images" / "fixed-blocks.png").exists() and (
        tmp_path / "figures" / "fixed-bits.png"
    ).exists()
