"""Phases a line each: evaluations and lane efficiency from counts, joined with ladder and roof."""

import math
from types import SimpleNamespace

import msgspec
import pandas as pd
import pytest

from study.bounds import work
from study.counting.schema import Declared, Function

SIZE = {"width": 20, "height": 10}


def counts(phase: str, active: dict[str, int], **more: object) -> Declared:
    by = {name: Function(calls=1, lanes=n) for name, n in active.items()}
    about = {"phase": phase, "scene": "scene0", **SIZE, "useful": 60, "executed": 80}
    return Declared(**{**about, **more}, by_function=by)


@pytest.mark.parametrize(
    ("lanes", "expected"),
    [
        # Every shape a function; a plane is none, and a Mandelbulb's is an estimate.
        ({"sdf_plane": 900, "sdf_sphere": 5, "sdf_box": 6, "vec_add": 7000, "sdf": 50}, 11),
        ({"sdf_plane": 900, "sdf_mandelbulb": 40}, 40),
        # Where the bulb has its own functions, those that end are all of them, the function's among them.
        ({"sdf_mandelbulb": 2, "bulb_start": 80, "bulb_estimate": 82, "sdf_sphere": 1}, 83),
        ({"sdf_sphere": 1, "enter": 7, "enter_cone": 3, "bulb_end": 20, "bulb_step": 90}, 28),
        # A phase without costs counts calls that are distances, and estimates: else it is an older version's.
        ({"packet_distance": 30, "group_shape": 50, "march_step": 7, "bulb_estimate": 4}, 84),
        ({"enter": 5, "candidate": 9, "candidate_awake": 3, "widest_step": 2, "bulb_estimate": 0}, 10),
        ({"packet_distance": 30, "march_step": 7}, math.nan),
        ({"draw": 3}, math.nan),
    ],
)
def test_evaluations_are_of_one_solid_and_no_plane(lanes: dict, expected: float) -> None:
    found = work.evaluations(counts("a", lanes).by_function)
    assert found == pytest.approx(expected, nan_ok=True)


def test_counts_are_of_the_whole_picture_and_of_the_nearest_size() -> None:
    some = [counts("a", {"sdf_sphere": 400}), counts("a", {"sdf_sphere": 9}, width=2, height=3)]
    found = work.counted(some, "a", "scene0", 12)
    assert found == work.Work(evals_per_pixel=2.0, lane_efficiency=0.75, counted_at=10)
    assert work.counted(some, "a", "trio", 12) is None


def test_without_declared_flops_lanes_of_calls_are_the_efficiency() -> None:
    one = counts("opt7_tiles", {"march_step": 6, "soft_step": 4}, executed=0, useful=0, lanes=8)
    assert work.efficiency(one) == 10 / 16
    assert math.isnan(work.efficiency(counts("a", {}, executed=0, lanes=8)))


def test_a_row_says_of_which_code_its_counts_are_and_what_is_lacking() -> None:
    about = {"scene": "scene0", **SIZE, "headline": True, "threads": 1, "ms": 2.0, "ns_per_pixel": 14.31}
    ratio = {"speedup": 1728.0, "speedup_low": 1434.0, "speedup_high": 2004.0}
    errors = {"truth_own_db": 96.0, "truth_wrong_ppm": 0.0}
    one = {**about, **ratio, **errors, "phase": "opt10_scene"}
    table = pd.DataFrame(
        [
            one,
            {**one, "phase": "opt9_convex", "truth_own_db": math.nan},
            {**one, "threads": 2},
            {**one, "headline": False},
            {**one, "phase": "opt2@opt3"},
        ]
    )
    names = ["opt9_convex", "opt10_scene"]
    declared = [counts("opt10_scene", {"enter": 424}, kernel="general: a counting build counts")]

    def rows(declared: list[Declared], scaled: int | None = None) -> list[work.Row]:
        near = SimpleNamespace(phase="opt10_scene", scene="scene0", height=10)
        near.share_of_mix_roof, near.scaled_from_n = 0.227, scaled
        return work.rows(table, declared, [near], names)

    kernel, other = rows(declared)
    cells = [column.text(kernel) for column in work.COLUMNS]
    assert cells[:2] == ["scene0, 20×10", "opt10_scene"] and "1,728× [1,434" in cells[2]
    general = f" ({work.GENERAL})"
    assert cells[4:7] == [f"{text}{general}" for text in ("2.12", "75.0 %", "22.7 %")]
    assert cells[7:] == ["96.0", "0"]
    lacking = [column.text(other) for column in work.COLUMNS]
    assert lacking[4:8] == ["–"] * 4 and lacking[1] == "opt9_convex"
    for width, height, text in ((2, 1, "212"), (8, 4, "13.2")):
        smaller = msgspec.structs.replace(declared[0], width=width, height=height)
        cells = [column.text(rows([smaller])[0]) for column in work.COLUMNS]
        assert cells[4].startswith(text) and f"n = {height}" in cells[4]
        assert "n = " not in cells[6]
    assert "n = 90" in work.COLUMNS[6].text(rows(declared, 90)[0])
    assert work.rows(pd.DataFrame(), declared, [], names) == []
    assert math.isnan(work.rows(table, declared, [], names)[0].share_of_mix_roof)
