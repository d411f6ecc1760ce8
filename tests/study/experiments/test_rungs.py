"""The rungs a line each: evaluations and lane efficiency from counts, joined with ladder and roof."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from study.bounds import work

SIZE = {"width": 20, "height": 10}


def counts(phase: str, lanes: dict[str, float], kernel: str | None = None, **more: object) -> dict:
    by = {name: {"lanes": n} for name, n in lanes.items()}
    about = {"phase": phase, "scene": "scene0", **SIZE, "kernel": kernel, "useful": 60, "executed": 80}
    return {**about, "by_function": by, **more}


@pytest.mark.parametrize(
    ("lanes", "expected"),
    [
        # Every shape a function; a plane is none, and a Mandelbulb's is an estimate.
        ({"sdf_plane": 900, "sdf_sphere": 5, "sdf_box": 6, "vec_add": 7000, "sdf": 50}, 11),
        ({"sdf_plane": 900, "sdf_mandelbulb": 40}, 40),
        # Where the bulb has its own functions, those that end are all of them, the function's among them.
        ({"sdf_mandelbulb": 2, "bulb_start": 80, "bulb_estimate": 82, "sdf_sphere": 1}, 83),
        ({"sdf_sphere": 1, "enter": 7, "enter_cone": 3, "bulb_end": 20, "bulb_step": 90}, 28),
        ({"draw": 3}, math.nan),
    ],
)
def test_evaluations_are_of_one_solid_and_no_plane(lanes: dict, expected: float) -> None:
    found = work.evaluations({name: {"lanes": n} for name, n in lanes.items()})
    assert found == pytest.approx(expected, nan_ok=True)


def test_counts_are_of_the_whole_picture_and_of_the_nearest_size() -> None:
    some = [counts("a", {"sdf_sphere": 400}), counts("a", {"sdf_sphere": 9}, width=2, height=3)]
    found = work.counted(some, "a", "scene0", 12)
    assert (found["evals_per_pixel"], found["lane_efficiency"]) == (2.0, 0.75)
    assert (found["counted_at"], found["counts_of"]) == (10, "")
    assert work.counted(some, "a", "trio", 12) == {}
    assert math.isnan(work.counted([counts("a", {}, executed=0)], "a", "scene0", 9)["lane_efficiency"])


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
    roofs = pd.DataFrame([{"phase": "opt10_scene", "scene": "scene0", "height": 10, "threads": 1}])
    roofs["share_of_mix_roof"] = 0.227
    names = ["opt9_convex", "opt10_scene"]
    declared = [counts("opt10_scene", {"enter": 424}, kernel="general: a counting build counts")]
    kernel, other = work.rows(table, declared, roofs, names)
    cells = [column.text(kernel) for column in work.COLUMNS]
    assert cells[:2] == ["scene0, 20×10", "opt10_scene"] and "1,728× [1,434" in cells[2]
    assert cells[4:7] == [f"{text} (of its general code)" for text in ("2.12", "75.0 %", "22.7 %")]
    assert cells[7:] == ["96.0", "0"]
    smaller = [
        {**declared[0], "width": 2, "height": 1},
        {**declared[0], "width": 8, "height": 4, "kernel": None},
    ]
    for height, text in ((1, "212 (of its general code; counted at n = 1)"), (4, "13.2 (counted at n = 4)")):
        (row, _) = work.rows(table, [one for one in smaller if one["height"] == height], roofs, names)
        assert work.COLUMNS[4].text(row) == text and text[text.index("(") :] in work.COLUMNS[5].text(row)
        assert "counted at" not in work.COLUMNS[6].text(row), "the roofline says of which height its are"
    (row, _) = work.rows(table, declared, roofs.assign(scaled_from_n=90.0), names)
    assert work.COLUMNS[6].text(row) == "22.7 % (of its general code; counted at n = 90)"
    (row, _) = work.rows(table, declared, roofs.assign(scaled_from_n=math.nan), names)
    assert work.COLUMNS[6].text(row) == "22.7 % (of its general code)"
    lacking = [column.text(other) for column in work.COLUMNS]
    assert lacking[4:8] == ["–"] * 4 and lacking[1] == "opt9_convex"
    assert work.rows(pd.DataFrame(), declared, roofs, names) == []
    assert math.isnan(work.rows(table, declared, pd.DataFrame(), names)[0]["share_of_mix_roof"])
