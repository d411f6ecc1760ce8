"""scripts/stepwise lattice: figures by hand, the table of a made-up result, a small run, bad arguments."""

from __future__ import annotations

import json
import math
import re
import sys

import complete
import numpy as np
import pytest
import started

from study.core import registry
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.lattice import measure as lattice
from study.experiments.lattice import tables as lattice_page
from study.experiments.systems import tables as systems

ERROR = {f"{kind}_ppm": 0.0 for kind in ("false_hits", "false_misses", "wrong_shape", "wrong")}
ERROR |= {"dt_p50": 0.0, "dt_p99": 0.5, "dt_p100": 1.0, "psnr_db": 60.0, "evaluations": 1.0, "known": 1.0}
ERROR |= {"non_finite": 0}
NAMES = ["baseline", "opt4", "opt10_scene"]


def made_up() -> dict:
    """Six launches each: opt10_scene takes 10 ms on one thread and 5 on two; half of it is the light's."""
    size, ms = lattice.PROGRAM["size"], {"baseline": 1000.0, "opt4": 100.0, "opt10_scene": 10.0}
    times = {}
    for point in lattice.points(NAMES, [(1000, 562), size], [1, 2]):
        one = ms[point.phase] / point.threads * (1 if point.lit else 0.5)
        times[point] = [one * 1e6] * 6
    program = {**lattice.PROGRAM, "ms": {str(k): v for k, v in lattice.PROGRAM["ms"].items()}}
    rows = lattice.rows(times, dict.fromkeys(NAMES, ERROR))
    about = {"error_size": [320, 180], "still_lit": 0.01, "known": 1.0}
    return json.loads(json.dumps({"program": program, "paper": 14, "rows": rows, **about}))


def test_points():
    """Threads where a phase has them, the unlit scene at the last size alone."""
    points = lattice.points(NAMES, [(1000, 562), (1280, 720)], [1, 2, 2])
    assert len(points) == len(set(points)) == 2 * (1 + 1 + 2) + 3
    assert {p.phase for p in points if p.threads == 2} == {"opt10_scene"}
    assert all(p.size == (1280, 720) and p.threads == 1 for p in points if not p.lit)


def test_ratios_and_shares_by_hand():
    found = {(r["phase"], r["n"], r["threads"]): r for r in made_up()["rows"]}
    assert len(found) == 8
    one, two = (found["opt10_scene", 720, threads] for threads in (1, 2))
    assert one["program"] == pytest.approx(5.77) and two["program"] == pytest.approx(33.1 / 5)
    assert one["light"] == one["light_low"] == one["light_high"] == 0.5 and two["light"] is None
    assert found["opt10_scene", 562, 1]["program"] is None is found["opt10_scene", 562, 1]["program_ms"]
    assert found["opt4", 720, 1]["program"] == pytest.approx(0.577)


def test_intervals_have_their_ends_the_right_way_round():
    size = lattice.PROGRAM["size"]
    times = {
        lattice.Point("opt4", size, 1): [10e6, 11e6, 12e6, 13e6, 14e6, 15e6],
        lattice.Point("opt4", size, 1, lit=False): [9e6, 9e6, 9e6, 9e6, 9e6, 10e6],
    }
    (row,) = lattice.rows(times, {"opt4": ERROR})
    assert row["ms_low"] < row["ms"] < row["ms_high"]
    assert row["program_low"] < row["program"] < row["program_high"]
    assert row["light"] == pytest.approx(1 - 9 / 12.5)
    assert row["light_low"] < row["light"] < row["light_high"]


def test_the_table_of_systems(tmp_path):
    complete.write(tmp_path / lattice.FILE, made_up())
    one, _, claim = lattice_page.claims(lattice.read(tmp_path / lattice.FILE))
    assert (one.said, one.ours.split()[0], one.ratio) == ("57.7", "10.0", "5.77×")
    assert (claim.said, claim.ratio) == ("14×", "0.473×")  # 6.62 over 14
    section = systems.section(tmp_path)
    assert [part.name for part in section.parts] == ["systems", "lattice"]
    below = section.parts[1].foot
    assert "not measured on this machine" in below and "1\u00a0%" in below
    (tmp_path / lattice.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"lattice\.json: not what scripts/stepwise lattice writes"):
        systems.section(tmp_path)


def test_under_the_table_stands_what_shading_takes(tmp_path):
    """By FLOPs alone where no interval of a time is clear of 0."""
    made = made_up()

    def lit(low: float | None, high: float | None) -> dict:
        rows = [row for row in made["rows"] if row["light"] is not None]
        assert [row["phase"] for row in rows] == list(NAMES)
        for row, share in zip(rows, (0.07, None, 0.187), strict=True):
            row |= {"light": 0.02, "light_low": low, "light_high": high, "shading": share}
        return rows[0]

    lit(-0.2, 0.2)
    text = lattice_page.foot(made["rows"])
    assert "cannot be told from times here" in text and text.endswith(
        "at least 7\u00a0% to 18.7\u00a0%, by phase."
    )
    complete.write(tmp_path / lattice.FILE, made)
    assert systems.section(tmp_path).parts[1].foot.startswith(text)
    lit(None, None)
    assert lattice_page.foot(made["rows"]) == text
    lit(-0.2, -0.1)
    below = lattice_page.foot(made["rows"])
    assert "cannot be told from times here" in below, "less time than nothing is no share of it"
    assert f"Of {', '.join(NAMES)} the frame without its light was the slower one" in below
    assert "slower" not in text
    lit(-0.2, 0.2).update(light_low=0.01)
    assert "can be told from times of baseline alone: the other" in lattice_page.foot(made["rows"])
    for row in made["rows"]:
        row["light"] = None
    assert lattice_page.foot(made["rows"]) == ""


def test_shading_s_share_is_of_its_functions_alone(monkeypatch):
    scene, asked = registry.find_scene(lattice.SCENE), []
    parts = {"light_at": 10, "normal_at": 15, "sdf": 75}

    def render(name, path, height, width, **how):
        asked.append((name, height, width, how["target"]))
        found = {function: {"machine": flops} for function, flops in parts.items()}
        return {"flops": {"machine": 100}, "by_function": found}

    monkeypatch.setattr(lattice.run, "render", render)
    assert lattice.shading("opt4", scene, (160, 90)) == 0.25
    assert asked == [("opt4", 90, 160, "render-count")]
    parts["vec_dot"] = 0
    assert lattice.shading("baseline", scene, (160, 90)) is None
    assert lattice_page.counted({"shading": 0.25}) == "≥ 25\u00a0%"
    assert lattice_page.counted({}) == lattice_page.counted({"shading": None}) == "–"


def test_every_rung_has_functions_of_shading():
    """And no name of SHADING is of no function."""
    there = set()
    for name in registry.ladder():
        text = registry.find_phase(name).file("costs.def").read_text()
        mine = set(re.findall(r"^\w+\((\w+)", text, re.M)) & lattice.SHADING
        assert {"light_at", "light_surfaces"} & mine and {"normal_at", "normal_on"} & mine, name
        if name in ("opt9_convex", "opt10_scene"):  # what is seen without a mirror or a shadow
            assert {"add_phong", "primary_light", "shade_primary_hit"} <= mine, name
        there |= mine
    assert there == lattice.SHADING


def test_few_launches_are_said_to_be(tmp_path):
    times = {lattice.Point("opt4", lattice.PROGRAM["size"], 1): [10e6]}
    (row,) = lattice.rows(times, {"opt4": ERROR})
    assert math.isnan(row["ms_low"]) and "insufficient" in lattice_page.sentence(row)


def test_the_unlit_scene_is_the_scene_but_for_its_light(tmp_path):
    scene = registry.find_scene(lattice.SCENE)
    made = json.loads(lattice.unlit(scene, tmp_path).read_text())
    light = made.pop("light")
    whole = json.loads(json.dumps(scene.data))
    own = whole.pop("light")
    assert made == whole and light | {"position": 0} == own | {"position": 0}
    away = np.array(light["position"]) - whole["camera"]["position"]
    to = -np.array(whole["camera"]["position"])
    assert np.allclose(away / 1e4, to / np.linalg.norm(to))
    planes = {"id": np.array([[0, 0, 1, -1]]), "N.x": np.zeros((1, 4))}
    planes |= {"N.y": np.array([[1, -1, 1, -1]]), "N.z": np.zeros((1, 4))}  # the camera looks down
    assert lattice.still_lit(scene, planes) == pytest.approx(1 / 3)


@pytest.mark.slow
def test_a_small_run(tmp_path):
    words = [
        "--phase",
        "opt9_convex",
        "opt4",
        "-n",
        "18",
        "--error-n",
        "18",
        "--launches",
        "1",
        "--threads",
        "1",
    ]
    for name in ("opt9_convex", "opt4"):  # they may take longer than what is asked here
        build(name, "render")
        build(name, "render-count")
    command = [sys.executable, str(ROOT / "scripts" / "stepwise"), "lattice", *words, "--run", str(tmp_path)]
    done = started.run(command, timeout=120)
    assert done.returncode == 0, done.stderr
    result = lattice.read(tmp_path / lattice.FILE)
    assert [r["phase"] for r in result["rows"]] == ["opt9_convex", "opt4"] and result["known"] == 1
    exact, march = result["rows"]
    assert exact["wrong_ppm"] == 0 < march["wrong_ppm"] and exact["program"] is None
    assert 0.01 < march["shading"] < exact["shading"] < 0.5
    assert 0 < result["still_lit"] < 0.2 and "opt9_convex 32×18" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--phase", "opt99"], "no phase 'opt99'"),
        (["-n", "3"], "must be a whole number of at least 9"),
        (["--threads", "999"], "--threads 999: there are"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    done = started.run([sys.executable, str(ROOT / "scripts" / "stepwise"), "lattice", *arguments])
    assert done.returncode == 2 and message in done.stderr.strip().splitlines()[-1]
