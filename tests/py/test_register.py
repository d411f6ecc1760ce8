"""The claims register: each check on small files whose answer is known by hand."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import pytest

from study import analysis, claims, paper, register
from study.analysis import Data


@pytest.fixture
def data(tmp_path: Path) -> Data:
    """A run of nothing but the files that a test puts there."""
    (tmp_path / "frames.jsonl").write_text("")
    return dataclasses.replace(
        analysis.Data(tmp_path, {}, {}, None, [], [], []),  # type: ignore[arg-type]
    )


def put(data: Data, name: str, content: object) -> None:
    (data.path / name).write_text(json.dumps(content))


def counted(data: Data, **giga: float) -> None:
    """counts.json with that many GFLOP by the paper's convention for scene__phase."""
    one = []
    for key, value in giga.items():
        scene, _, phase = key.partition("__")
        about = {"scene": scene, "phase": phase, "flags_from": phase, "height": 720, "width": 1280}
        flops = {"paper": value * 1e9, "machine": value * 1e9}
        one.append(
            {**about, "scene_hash": "", "threads": 1, "flops": flops, "by_function": {}, "by_class": {}}
        )
    put(data, "counts.json", {"schema": 1, "declared": one, "measured": []})


def test_every_claim_has_a_check_a_source_and_a_command_or_a_reason() -> None:
    for claim in paper.read("claims").to_dict("records"):
        assert claim["quantity"] in claims.CHECKS or claim["quantity"] in register.CHECKS
        assert isinstance(claim["source"], str) and isinstance(claim["quote"], str)
        assert isinstance(claim["command"], str) or isinstance(claim["note"], str)
    assert {claim["text"] for claim in paper.read("claims").to_dict("records")} == {"P1", "P2", "P3", "P4"}


def test_a_run_without_files_measures_nothing(data: Data) -> None:
    for name, check in register.CHECKS.items():
        if name == "later":
            continue
        claim = {"scene": "scene0", "phase": "opt1", "base": "baseline", "value": 2.0}
        assert check(data, claim) == ("", register.OPEN), name


@pytest.mark.parametrize(
    ("here", "verdict"),
    [(20.68, register.HOLDS), (21.7, register.HOLDS), (23, register.FAILS), (18, register.FAILS)],
)
def test_flops_hold_within_ten_percent_either_way(data: Data, here: float, verdict: str) -> None:
    counted(data, scene0__baseline=here)
    claim = {"scene": "scene0", "phase": "baseline", "value": 20.68}
    assert register.CHECKS["flops"](data, claim)[1] == verdict


def test_no_number_never_holds() -> None:
    assert register.near(math.nan, 1.0) == register.FAILS
    assert register.judged(math.nan, 2.0) == register.FAILS


@pytest.mark.parametrize(
    ("opt1", "verdict"), [(49, register.HOLDS), (60, register.PART), (101, register.FAILS)]
)
def test_a_cut_holds_in_part_when_it_is_another(data: Data, opt1: float, verdict: str) -> None:
    counted(data, scene0__baseline=100, scene0__opt1=opt1)
    claim = {"scene": "scene0", "phase": "opt1", "base": "baseline", "value": 51}
    assert register.CHECKS["flop_cut"](data, claim)[1] == verdict


@pytest.mark.parametrize(
    ("bulb", "verdict"), [(21, register.HOLDS), (16, register.PART), (9, register.FAILS)]
)
def test_more_than_twice_means_more_than_twice(data: Data, bulb: float, verdict: str) -> None:
    counted(data, scene0__baseline=10, mandelbulb__baseline=bulb)
    claim = {"scene": "mandelbulb", "phase": "baseline", "base": "scene0", "value": 2}
    assert register.CHECKS["flop_ratio"](data, claim)[1] == verdict


def test_a_single_miss_refutes_never(data: Data) -> None:
    claim = {"scene": "scene0", "phase": "baseline", "value": 0}
    for ppm, verdict in ((0.0, register.HOLDS), (0.5, register.FAILS)):
        row = {"scene": "scene0", "phase": "baseline", "height": 720, "false_misses_ppm": ppm}
        put(data, "accuracy.json", {"rows": [row]})
        assert register.CHECKS["never_misses"](data, claim)[1] == verdict


def test_the_hottest_are_taken_together(data: Data) -> None:
    claim = {"scene": "scene0", "base": "sincos|rotate_point"}
    for rest, verdict in ((0.29, register.HOLDS), (0.31, register.FAILS)):
        shares = {"sincos (libm)": 0.2, "vec_norm": rest, "rotate_point": 0.1}
        functions = [{"function": name, "share": share} for name, share in shares.items()]
        one = {"scene": "scene0", "phase": "baseline", "variant": "calls", "functions": functions}
        put(data, "hotspots.json", {"profiles": [one]})
        assert register.CHECKS["hottest"](data, claim)[1] == verdict
