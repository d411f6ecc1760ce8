"""Frame rates: sizes, rates, budgets and verdicts known by arithmetic; errors, the chapter, bad input."""

from __future__ import annotations

import functools
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import emitted
import matplotlib
import msgspec
import numpy as np
import pytest

from study.core import cli, registry, store
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.frames import experiment
from study.experiments.frames import measure as frames
from study.experiments.frames.measure import Case, Settings
from study.experiments.frames.schema import FILE, Frames
from study.numbers import stats
from study.numbers.schema import PictureErrors
from study.pictures import images
from study.pictures.draw import STYLE

OPT4, OPT5 = Spec("opt4", "opt4"), Spec("opt5_threads", "opt5_threads")
CASE = Case("scene0", 1080, frames.OWN, 1e-6, Path("scene0.json"))


ERRORS = {
    "reference": "opt3",
    "psnr_db": 50.0,
    "rmse": 0.003,
    "averaged": True,
    "non_finite": 0,
    "to_own": None,
}


def test_half_a_pixel_is_half_of_what_a_pixel_covers(tmp_path: Path) -> None:
    bulb = registry.find_scene("mandelbulb")  # six away, 25 degrees over the height
    edge = 6 * math.tan(math.radians(12.5))
    assert frames.half_pixel(bulb, 720) == pytest.approx(2 * edge / 720 / 2)
    own, half = frames.cases(["mandelbulb"], tmp_path)
    assert (own.height, own.hit_distance, own.path) == (720, 1e-6, bulb.path)
    made = json.loads(half.path.read_text())
    assert made["march"]["hit_distance"] == half.hit_distance == frames.half_pixel(bulb, 720)
    assert made["march"]["surface_offset"] == pytest.approx(10 * half.hit_distance)
    made["march"] = bulb.data["march"]
    assert made == bulb.data
    wide = frames.coarser(bulb.data, 1e-5)["march"]
    assert wide["surface_offset"] == bulb.data["march"]["surface_offset"]  # ten of them are less


def test_a_rate_is_one_over_the_median_time() -> None:
    launches = [[20e6, 10e6, 10e6], [40e6, 20e6, 20e6], *[[20e6, 20e6, 20e6]] * 4]
    found = frames.rate(launches)
    assert found.value == pytest.approx(50) and found.low == pytest.approx(50) and found.high <= 100
    assert not frames.rate(launches[:2]).sufficient


def test_a_frame_is_rendering_and_presenting(tmp_path: Path) -> None:
    settings = Settings(6, 2, 1, 60, tmp_path)
    launches = [([10e6 + i * 1e6] * 20, [2e6] * 20) for i in range(6)]
    made = frames.row(OPT5, CASE, launches, ERRORS, settings)
    assert (made.frames, made.width, made.n, made.threads) == (120, 1920, 1080, 2)
    assert made.median_ms == pytest.approx(14.5) and made.present_ms == pytest.approx(2)
    assert made.frames_per_s.value == pytest.approx(1000 / 14.5)
    assert made.p99_ms == made.worst_ms == pytest.approx(17)
    few = frames.row(OPT4, CASE, [([1e6], [1e6])] * 6, ERRORS, settings)
    assert few.p99_ms is None and few.threads == 1


def chosen(tmp_path: Path, seconds: float, first) -> tuple[dict, list]:
    return frames.choose([OPT4, OPT5], [CASE], Settings(6, 2, 1, seconds, tmp_path), first, clock=lambda: 0.0)


def test_the_newest_phases_are_taken_while_the_time_lasts(tmp_path: Path) -> None:
    one = frames.cost(0.1, 6)
    assert one == pytest.approx(6 * (11 * (0.1 + frames.A_FRAME) + frames.OVERHEAD))  # ten frames in a second
    assert [frames.reps_of(s) for s in (0.001, 0.1, 9)] == [20, 10, 3]
    both, none = chosen(tmp_path, 2.01 * one, lambda spec, case: 0.1)
    assert list(both) == [(OPT5, CASE), (OPT4, CASE)] and none == []
    taken, left_out = chosen(tmp_path, 1.9 * one, lambda spec, case: 0.1)
    assert list(taken) == [(OPT5, CASE)] and [one.phase for one in left_out] == ["opt4"]
    taken, left_out = chosen(tmp_path, 0, lambda spec, case: 0.1)
    assert list(taken) == [(OPT5, CASE)]  # the newest, whatever it takes

    def refuses(spec: Spec, case: Case) -> float:
        if spec == OPT5:
            raise DriverError(4, "no such shape")
        return 0.1

    taken, left_out = chosen(tmp_path, 99, refuses)
    assert list(taken) == [(OPT4, CASE)] and left_out[0].reason == "no such shape"


def test_chapter_and_figure_are_made_from_the_file_alone(tmp_path: Path) -> None:
    launches = [([15e6 + i * 1e5] * 20, [1e6] * 20) for i in range(6)]
    row = frames.row(OPT5, CASE, launches, ERRORS, Settings(6, 2, 1, 60, tmp_path))
    own = PictureErrors(psnr_db=17.0, rmse=0.1, averaged=True)
    half = msgspec.structs.replace(row, hit=frames.HALF, to_own=own, p99_ms=None)
    assert experiment.section(SimpleNamespace(path=tmp_path)).parts == []
    store.write_json(tmp_path / FILE, Frames(schema=1, launches=6, threads=2, rows=[row, half]))
    chapter = experiment.section(SimpleNamespace(path=tmp_path))
    text = chapter.parts[0].markdown
    assert "61.5 [60" in text and "50.0 (4×4 means)" in text and "17.0 (4×4 means)" in text
    assert "61.5 [60" in chapter.answer and "50.0 dB" in chapter.answer
    assert "16.5 (largest of 120)" in text
    with matplotlib.rc_context(STYLE):
        assert chapter.drawn["frames"].make().axes


@pytest.mark.slow
def test_from_end_to_end(tmp_path: Path, monkeypatch, capsys) -> None:
    words = ["--phase", "opt4", "--scene", "scene0", "-n", "16", "--launches", "1", "--budget", "3600"]
    assert emitted.told("frames", *words, "--run", tmp_path, "--json") == cli.OK
    made = emitted.result(capsys.readouterr().out)
    assert made == json.loads((tmp_path / FILE).read_text())
    own, half = made["rows"]
    assert (own["hit"], half["hit"]) == (frames.OWN, frames.HALF) and own["to_own"] is None
    assert own["frames"] == len(own["ms"][0]) == 20 and own["psnr_db"] > 40 > half["to_own"]["psnr_db"]
    assert own["frames_per_s"]["value"] == pytest.approx(1000 / stats.median_interval(own["ms"][0]).value)
    assert (tmp_path / "figures" / "frames.png").stat().st_size > 1000
    assert (own["presented_by"], own["displayed_otherwise"]) == ("driver", 0)


@pytest.mark.slow
def test_what_is_displayed_otherwise_fails(tmp_path: Path, monkeypatch, capsys) -> None:
    def another(path: Path) -> np.ndarray:
        found = images.read_ppm.__wrapped__(path).copy()
        found[3, 4, 1] ^= 1
        return found

    monkeypatch.setattr(images, "read_ppm", functools.wraps(images.read_ppm)(another))
    words = ["--phase", "opt10_scene", "--scene", "scene0", "-n", "16", "--launches", "1", "--budget", "3600"]
    assert emitted.told("frames", *words, "--run", tmp_path, "--json") == cli.FAILED
    said = capsys.readouterr()
    assert re.search(r"^FAIL opt10_scene .*\b0 .*\b1 bytes", said.err, re.MULTILINE)
    row = emitted.result(said.out)["rows"][0]
    assert (row["presented_by"], row["displayed_otherwise"], row["present_ms"]) == ("phase", 1, 0)
