"""stepwise rods, stepwise throttle: errors by hand, tables of a made-up result, the throttle's choice."""

from __future__ import annotations

import importlib
import itertools
import json
import math
import os
import sys
import types

import complete
import numpy as np
import pytest
import started
from made_up import rods_result as made_up

from study.core import cli, registry, run, show
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.rods import tables as rods_page
from study.experiments.systems import pictures as systems_pictures
from study.experiments.systems import tables as systems
from study.truth import judging


def planes(**other: list) -> dict[str, np.ndarray]:
    """A picture of four pixels in a row; truth's planes among its own."""
    base = {"id": [0, 0, 1, -1], "Z": [1, 2, 3, np.inf], "status": [2, 2, 2, 2], "status.all": [2, 2, 2, 2]}
    base |= {name: [0.5, 0.5, 0.5, 0.5] for name in "RGB"} | {"N.x": [0] * 4, "N.y": [0] * 4, "N.z": [0] * 4}
    return {name: np.array([row], np.float32) for name, row in (base | {"evals": [1] * 4} | other).items()}


def test_errors_by_hand():
    exact = planes()
    assert rods.errors(exact, exact)["wrong_ppm"] == 0 and rods.errors(exact, exact)["psnr_db"] is None
    made = planes(id=[0, -1, 0, 1], Z=[1.25, np.inf, 3, 9], R=[0.5, 0.5, 0.5, 1.0])
    found = rods.errors(exact, made)
    assert [found[f"{k}_ppm"] for k in ("false_hits", "false_misses", "wrong_shape")] == [250_000] * 3
    assert found["wrong_ppm"] == 750_000 and found["dt_p50"] == found["dt_p100"] == 0.25
    assert found["psnr_db"] == pytest.approx(-10 * math.log10(0.25 / 12))
    unknown = planes(status=[2, 2, 2, 0])
    assert rods.errors(unknown, made)["false_hits_ppm"] == 0 and rods.errors(unknown, made)["known"] == 0.75
    assert rods.errors(unknown, made)["false_misses_ppm"] == pytest.approx(1e6 / 3), "of the proved pixels"
    assert math.isnan(rods.errors(planes(status=[0] * 4), made)["wrong_ppm"]), "of none there is no share"
    beside = rods.errors(planes(status=[1, 1, 1, 2]), made)  # a fractal and the air about it, which is proved
    assert (beside["wrong_ppm"], beside["judged"], beside["known"]) == (1_000_000, 0.25, 1)
    assert rods_page.hits(beside) == "1,000,000 (of 25\u00a0% of the pixels)"
    assert rods_page.hits(rods.errors(exact, made)) == rods_page.hits({"wrong_ppm": 750_000}) == "750,000"
    converged = planes(status=[1, 1, 1, 0])  # a fractal: nothing is proved
    assert rods.errors(converged, made)["false_misses_ppm"] == pytest.approx(1e6 / 3)
    found = rods.errors(exact, planes(Z=[1, 2, np.nan, np.inf]))
    assert found["false_misses_ppm"] == 250_000, "a shape without a depth is no hit"
    for one in (made, planes(Z=[1, np.inf, 3, 4])):
        mine, theirs = rods.errors(unknown, one), judging._hits(unknown, one)
        for kind in ("false_hits", "false_misses", "wrong_shape"):
            assert mine[f"{kind}_ppm"] == theirs[f"{kind}_ppm"], "one name, one thing"
    found = rods.errors(exact, planes(R=[0, 0, 0, np.nan]))
    assert found["non_finite"] == 1 and math.isnan(found["psnr_db"]), "NaN is not identical"


def test_a_picture_with_nan_is_not_identical_to_another(monkeypatch):
    made = {"a": planes(), "b": planes(R=[0.5, 0.5, 0.5, np.nan])}
    monkeypatch.setattr(rods, "picture", lambda phase, words, scene, size: made[words])
    monkeypatch.setattr(rods, "milliseconds", lambda *_: 1.0)
    same, other = (rods.larger(rods.find_scene("trio"), 16, words, "a", 6, 1) for words in "ab")
    assert (same["psnr_db"], same["non_finite"]) == (None, 0)
    assert math.isnan(other["psnr_db"]) and other["non_finite"] == 1
    kept = json.loads(json.dumps(cli.plain(other)))
    assert kept["psnr_db"] is None and rods_page.apart(kept) == "not finite, 0 ppm other hits"
    assert rods_page.apart(same) == "identical, 0 ppm other hits"


@pytest.mark.parametrize(
    ("psnr", "wrong", "non_finite", "fits"),
    [
        (40, 1000, 0, True),
        (None, 0, 0, True),
        (39.9, 1000, 0, False),
        (40, 1001, 0, False),
        (99, 0, 1, False),
        (math.nan, 0, 0, False),
        (50, math.nan, 0, False),
    ],
)
def test_enough(psnr, wrong, non_finite, fits):
    assert rods.enough({"psnr_db": psnr, "wrong_ppm": wrong, "non_finite": non_finite}, 40, 1000) == fits


def test_settings_are_put_back(monkeypatch):
    monkeypatch.setenv(rods.SETTINGS, "down=3")
    with rods.settings("down=5"):
        assert os.environ[rods.SETTINGS] == "down=5"
    assert os.environ[rods.SETTINGS] == "down=3"
    monkeypatch.delenv(rods.SETTINGS)
    with pytest.raises(KeyError), rods.settings("down=5"):
        raise KeyError
    assert rods.SETTINGS not in os.environ


def test_every_launch_comes_once_a_round():
    """Meanwhile this process is not on the measured CPU, and the environment's size varies."""
    seen: list[str] = []
    about = set()

    def once(name: str, pad: int) -> float:
        seen.append(name)
        about.add((pad, run.FASTEST in os.sched_getaffinity(0)))
        return float(len(seen))

    cases = {name: lambda pad, n=name: once(n, pad) for name in "abc"}
    times = rods.interleaved(cases, 4, seed=1)
    assert [sorted(seen[i : i + 3]) for i in range(0, 12, 3)] == [["a", "b", "c"]] * 4
    assert len({tuple(seen[i : i + 3]) for i in range(0, 12, 3)}) > 1, "always the same order"
    assert sorted(itertools.chain(*times.values())) == [float(i) for i in range(1, 13)]
    assert len(about) > 6 and {on for _, on in about} == {len(run.USABLE) == 1}


@pytest.mark.parametrize("threads", [1, 2])
def test_a_timed_launch_is_on_as_many_cpus_as_it_has_threads(threads, monkeypatch):
    """A program that says in its only frame where it may run and how much padding it was given."""
    said = []

    def lines(arguments, cpus, env_bytes, timed=True, more=None):
        said.append((cpus, env_bytes))
        return iter(['{"frames": [{"ns": 2e6, "warmup": false}]}'])

    monkeypatch.setattr(run, "_lines", lines)
    monkeypatch.setattr(run, "build", lambda *_: "render")
    scene = rods.find_scene("trio")
    assert rods.milliseconds("rods", "", scene, (32, 18), 2, 123, threads=threads) == 2
    assert said == [(run.cpu_set(run.FASTEST, threads), 123)]
    assert len(said[0][0]) == min(threads, len(run.USABLE))


def test_under_the_throttles_table_stands_which_launches_its_gains_are_of():
    """Those that chose say too much: older files have no others."""
    chose, anew = {"rows": [{"gain": 1.1}]}, {"rows": [{"gain": 1.1, "finalists": {}}]}
    assert rods_page.throttle_foot(chose).endswith("they are upper bounds.")
    assert rods_page.throttle_foot(anew).endswith("gains are of launches after it was made.")


def test_the_throttle_takes_the_fastest_within_the_error(monkeypatch):
    """Made-up pictures and times: the fastest is outside, a first look lies about the next two, and the
    choice's luck among the finalists is not its gain."""
    quick = ["march=pixels", "a", "b", "c", "d"]
    psnr = {"march=pixels": 60, "a": 30, "b": 45, "c": 41, "d": 50}
    first = {"march=pixels": 10.0, "a": 1.0, "b": 3.0, "c": 2.9, "d": 8.0}
    final = first | {"b": 2.0, "c": 4.0}
    anew = {"march=pixels": 12.0, "b": 6.0}
    looks: dict[str, int] = dict.fromkeys(quick, 0)
    sizes = set()

    def milliseconds(phase, words, scene, size, reps, pad=0, **more):
        sizes.add(size[1])
        looks[words] += 1
        if size[1] == 360:
            return {"march=pixels": 100.0, "b": 125.0}[words]
        if words == "march=pixels":
            return anew[words] if looks[words] > 1 else first[words]
        return first[words] if looks[words] == 1 else final[words] if looks[words] <= 6 else anew[words]

    monkeypatch.setattr(rods, "choices", lambda: quick)
    monkeypatch.setattr(rods.truth, "picture", lambda scene, size: None)
    made = planes()
    monkeypatch.setattr(rods, "picture", lambda phase, words, scene, size: words if size[1] == 90 else made)
    error = lambda exact, made: {"psnr_db": psnr[made], "wrong_ppm": 0, "non_finite": 0}  # noqa: E731
    monkeypatch.setattr(rods, "errors", error)
    monkeypatch.setattr(rods, "milliseconds", milliseconds)
    scene = rods.find_scene("trio")
    found = rods.throttle(scene, 90, 40, 1000, launches=5, seed=1)
    assert found["chosen"]["settings"] == "b" and found["within"] == 3 and found["large"] is None
    assert found["finalists"]["b"]["ms"] == 2 and found["chosen"]["ms"] == 6 and found["plain"]["ms"] == 12
    assert found["gain"] == 2, "of the launches behind the choice"
    assert looks["a"] == 0, "what is outside the error is not timed"
    looks.update(dict.fromkeys(quick, 0))
    more = rods.throttle(scene, 90, 40, 1000, launches=5, seed=1, large=360)["large"]
    assert more["gain"] == 0.8 and (more["psnr_db"], more["other_ppm"]) == (None, 0) and sizes == {90, 360}
    none = rods.throttle(rods.find_scene("trio"), 90, 70, 1000, launches=5, seed=1, large=360)
    assert none["chosen"] is None and none["large"] is None and "none of 4" in rods_page.choice(none)


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (1.01, 1.2, "gain"),
        (0.98, 1.3, "cannot be told"),
        (0.7, 0.99, "loss"),
        (1.0, 1.2, "cannot be told"),
        (None, None, "cannot be told"),
        (math.nan, math.nan, "cannot be told"),
    ],
)
def test_a_gain_is_one_where_its_interval_says_so(low, high, said):
    row = {"gain": 1.05, "gain_low": low, "gain_high": high}
    assert rods_page.verdict(row) == said
    assert rods_page.verdict({"gain": None}) == rods_page.verdict(None) == show.NOTHING


def test_the_hybrid_s_rows_have_their_verdicts():
    one = {"ms": 8.0, "ms_low": 7.0, "ms_high": 9.0, "psnr_db": 41.0, "wrong_ppm": 250.0}
    gain = {"gain": 1.25, "gain_low": 1.1, "gain_high": 1.4}
    row = {"scene": "trio", "width": 160, "n": 90, "chosen": one, "plain": one, **gain}
    large = {"width": 640, "n": 360, "chosen": one, "plain": one, "psnr_db": 50.0, "other_ppm": 12.0}
    large |= {"gain": 1.0, "gain_low": 0.9, "gain_high": 1.1}
    small, other = rods_page.hybrid_rows(row | {"large": large})
    assert small["ratio"].startswith("1.25×") and small["ratio"].endswith("over packets alone: gain")
    assert other["what"] == "trio 640×360, that choice, ms a frame" and other["ratio"].endswith(
        "cannot be told"
    )
    assert other["error"] == "against packets alone: 50.0 dB, 12 ppm other hits"
    assert len(rods_page.hybrid_rows(row)) == 1  # an older file


def test_the_trade_has_the_march_per_pixel_in_its_own_run(monkeypatch):
    """Made up: 30 ms per pixel, rods that end at 4×4 pixels 2, all others 10; launches interleaved."""
    asked = []

    def milliseconds(phase, words, scene, size, reps, pad=0, **more):
        asked.append((words, more))
        return 30.0 if "march=pixels" in words else 2.0 if "least=4" in words else 10.0

    monkeypatch.setattr(rods, "milliseconds", milliseconds)
    monkeypatch.setattr(rods, "picture", lambda *_, **__: planes())
    monkeypatch.setattr(rods.truth, "picture", lambda scene, size: planes())
    rows, pixels = rods.trade(16, 6, 1)
    assert (pixels["ms"], pixels["ms_low"], pixels["launches"]) == (30.0, 30.0, [30.0] * 6)
    assert {row["gain"] for row in rows if row["least"] != 4} == {3.0}
    (coarse,) = (row for row in rows if row["least"] == 4)
    assert (coarse["gain"], coarse["gain_low"], coarse["gain_high"]) == (15.0, 15.0, 15.0)
    plain = [i for i, (words, _) in enumerate(asked) if words == "march=pixels picture=map"]
    assert len(plain) == 6 and len(asked) == 6 * (len(rows) + 1) and not any(asked[i][1] for i in plain)
    assert [i // (len(rows) + 1) for i in plain] == list(range(6)), "once a round"


def test_the_table_of_systems_by_hand(tmp_path):
    complete.write(tmp_path / rods.FILE, made_up())
    section = systems.section(tmp_path)
    said = rods_page.system_rows(made_up(), {"rows": []})
    by_what = {row["what"]: row for row in said}
    assert by_what["two_spheres 800×800, per pixel, ms"]["ratio"] == "1.50× its speed"  # 150 over 100
    assert by_what["two_spheres 800×800, rods, ms"]["ratio"] == "0.500× its speed"  # 10 over 20
    assert by_what["rods over per pixel, time"]["ratio"] == "0.333× of it"  # 5 over 15
    assert by_what["evaluations, per pixel over rods"]["ratio"] == "0.120× of it"  # 12 over 100
    coarse = by_what["rods that end at 4×4 pixels: ms; evaluations, per pixel over rods"]
    assert coarse["ours"].split() == ["25.0", "[24.0,", "26.0];", "120×"]
    assert coarse["ratio"] == "4.00× over per pixel (of another run: no interval)", "an older file"
    newer = made_up()
    newer["trade"][-1] |= {"gain": 3.5, "gain_low": 3.0, "gain_high": 4.5}
    (coarse,) = (r for r in rods_page.system_rows(newer, {"rows": []}) if "4×4" in r["what"])
    assert coarse["ratio"].split()[:3] == ["3.50×", "[3.00,", "4.50]"]
    assert coarse["ratio"].endswith("over per pixel (87.5 ms, above)"), "3.5 times 25, and not own's 100"
    base = "two_spheres 800×800, per pixel, timed anew between the rows below, ms"
    assert base not in by_what, "an older file timed none"
    (above,) = (r for r in rods_page.system_rows(newer, {"rows": []}) if r["what"] == base)
    assert above["ours"] == "87.5 (no interval)" and above["ratio"] == "1.71× its speed"  # 150 over 87.5
    newest = newer | {"trade_pixels": {"ms": 90.0, "ms_low": 80.0, "ms_high": 99.0}}
    said_now = {r["what"]: r for r in rods_page.system_rows(newest, {"rows": []})}
    assert said_now[base]["ours"].split() == ["90.0", "[80.0,", "99.0]"]
    assert said_now[coarse["what"]]["ratio"].endswith("over per pixel (90.0 ms, above)")
    assert section.title == "Other systems" and rods_pictures.PICTURES in str(list(section.images))
    assert show.NOTHING not in {row["error"] for row in said}


def test_the_readme_s_table_of_systems(monkeypatch, tmp_path):
    """Rows beside which an article has a figure, between the marks; what is around them stays."""
    complete.write(tmp_path / rods.FILE, made_up())
    made = rods_page.system_rows(made_up(), {"rows": []})
    assert systems.rows_of(tmp_path) == made == systems.few(made)
    other = [{"article": text} for text in ("proposed, not measured", show.NOTHING, "no such comparison")]
    said = "“millions of rays per second, per core”"
    ratios = ("17.2× [14, 20] over E", "4.55× [3, 5] over E", "0.787× [0.7, 0.9] over E", "1,020× [9, 10]")
    rays = [{"article": said, "what": n, "ratio": ratio} for n, ratio in enumerate(ratios)]
    assert systems.few([*other, *rays]) == rays[2:], "the one below 1 among them"
    alone = [row | {"ratio": "– over none"} for row in rays]
    assert systems.few([*other, *alone]) == alone, "without Embree none is the best"
    tables = vars(importlib.import_module("study.commands.tables"))
    begin, end = tables["SYSTEMS_BEGIN"], tables["SYSTEMS_END"]
    data = types.SimpleNamespace(path=tmp_path, context={})
    monkeypatch.setitem(tables["systems_page"].__globals__, "machine_line", lambda _: "a CPU")
    text = tables["systems_page"](f"before\n{begin}\nold\n{end}\nbehind\n", data)
    assert text.startswith(f"before\n{begin}\n| system |") and text.endswith(f"{end}\nbehind\n")
    assert "old" not in text and text.count("rod marching (P4)") == len(made) and "a CPU" in text
    assert tables["systems_page"](text, data) == text
    with pytest.raises(StudyError, match="lacks the lines"):
        tables["systems_page"]("no marks", data)
    with pytest.raises(StudyError, match="has no systems"):
        tables["systems_page"](text, types.SimpleNamespace(path=tmp_path / "none"))


def test_the_sheet_of_all_systems(monkeypatch, tmp_path):
    """A column each, and one less where the CPU lacks what a phase needs; on the page once it is there."""
    drawn, figures = [], []
    made = planes() | {"G": np.array([[0.5, 0.5, 0.5, 0.6]], np.float32)}

    def picture(phase, words, scene, size):
        drawn.append((phase, scene.name, size[1]))
        start = {"start": np.array([[1, 2, -1, -1]], np.float32)}
        return made | (start if phase == "rods_simd" else {})

    monkeypatch.setattr(systems_pictures.rods, "picture", picture)
    monkeypatch.setattr(systems_pictures.truth, "picture", lambda scene, size: planes())
    monkeypatch.setattr(systems_pictures.panels, "save", lambda figure, path: figures.append(figure) or path)
    monkeypatch.setattr(systems_pictures.registry, "cpu_supports", lambda phase: phase.name != "fixed")
    (path,) = systems_pictures.write_pictures(tmp_path, 16)
    assert drawn == [
        ("opt9_convex", "lattice", 16),
        ("rods_simd", "trio", 16),
        ("fixed_float", "spheres40", 16),
    ]
    titles = [axes.get_title(loc="left") for axes in figures[0].axes]
    psnr = 10 * math.log10(12 / 0.1**2)
    assert (
        f"to ground truth, 4×1: {psnr:.1f} dB, 0 ppm wrong hits" in titles
        and "fixed_float: spheres40" in titles
    )
    assert f"rods_simd: trio, {psnr:.1f} dB to ground truth" in titles and len(figures[0].axes) == 7
    assert systems_pictures.start_map(np.array([-1.0, 3.0])).mask.tolist() == [True, False]
    complete.write(tmp_path / rods.FILE, made_up())
    assert path not in systems.section(tmp_path).images
    path.touch()
    assert next(iter(systems.section(tmp_path).images)) == path


def test_a_run_without_systems_says_what_makes_them(tmp_path):
    section = systems.section(tmp_path)
    assert section.parts == [] and section.lacking == "make systems"


def test_a_broken_file_is_named(tmp_path):
    (tmp_path / rods.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"rods\.json: not what scripts/stepwise rods writes"):
        systems.section(tmp_path)


def test_the_bars_have_the_greys_of_the_pictures():
    """Steps 1 to 20, distances 2 to 4, errors of 1e-4 to 0.1: their ends and middles, by the colour bars."""
    steps, depth, error = rods_pictures.scales(20, 2.0, 4.0)
    for bar, values, greys in (
        (steps, [1, 10.5, 20], rods_pictures.grey_steps(np.array([1, 10.5, 20]), 20)),
        (depth, [2, 3, 4], rods_pictures.grey_depth(np.array([2.0, 3, 4]), 2, 4)),
        (error, [1e-4, 10**-2.5, 0.1], [1, 0.5, 0]),
    ):
        assert bar.map(bar.norm(values))[:, 0] == pytest.approx(greys, abs=0.005)
    assert "scene units" in depth.label and "steps" in steps.label and "scene units" in error.label


def test_greys_by_hand():
    assert rods_pictures.grey_steps(np.array([1, 20, 10.5]), 20).tolist() == [1.0, 0.0, 0.5]
    grey = rods_pictures.grey_depth(np.array([2.0, 4.0, np.inf]), 2, 4)
    assert grey == pytest.approx([1.0, 0.15, 0.0])
    exact = planes()
    shown = rods_pictures.error_colours(exact, planes(id=[0, 0, 0, -1], Z=[1 + 1e-6, 2.1, 3, np.inf]))
    assert shown[0, 0].tolist() == [1, 1, 1] and shown[0, 1] == pytest.approx([0, 0, 0], abs=0.01)
    assert shown[0, 2].tolist() == [0.84, 0.15, 0.15] and shown[0, 3].tolist() == [1, 1, 1]


def main_of(monkeypatch, script: str, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", [f"{script}.py", *words])
    return importlib.import_module(f"study.experiments.{script}.command").main()


@pytest.mark.slow
def test_rods_from_pictures_to_its_file(monkeypatch, tmp_path, capsys):
    """Small, and with a corner of the trade-off: the rest is the script's own."""
    monkeypatch.setattr(rods, "DOWN", (8, 16))
    monkeypatch.setattr(rods, "CAPS", (20,))
    words = ["--scene", "trio", "-n", "18", "--article-n", "32", "--launches", "2", "--seed", "1"]
    assert main_of(monkeypatch, "rods", *words, "--run", str(tmp_path)) == 0
    result = rods.read(tmp_path / rods.FILE)
    assert (result["own"]["scene"], result["own"]["n"], result["own"]["width"]) == ("two_spheres", 32, 32)
    assert [(row["scene"], row["n"]) for row in result["rows"]] == [("trio", 18)]
    for row in (result["own"], *result["rows"]):
        assert row["rods"]["evaluations"] < row["pixels"]["evaluations"] and row["fewer"] > 1
        assert row["rods"]["ms"] > 0 and len(row["rods"]["launches"]) == 2
    kinds = [(row["down"], row["least"], row["step"]) for row in result["trade"]]
    assert kinds == [
        (8, 1, "whole"),
        (16, 1, "whole"),
        *((16, k, "whole") for k in (2, 4, 8)),
        (16, 1, "safe"),
    ]
    said = capsys.readouterr().out
    assert "two_spheres, 32×32: per pixel" in said and "trio, 32×18" in said
    assert (tmp_path / "images" / f"{rods_pictures.PICTURES}.png").exists()
    assert (tmp_path / "figures" / f"{rods_page.TRADE}.svg").exists()
    section = systems.section(tmp_path)
    assert [p.name for p in section.parts] == ["systems", "rods", "rods-trade"]


@pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()["rods_simd"])), reason="the CPU lacks what rods_simd needs"
)
def test_throttle_from_pictures_to_its_file(monkeypatch, tmp_path, capsys):
    """Two settings: one that is the scene's own picture, one whose five steps leave holes."""
    own, short = "march=rods size=16 least=4 steps=0 finish=0", "march=rods size=16 least=4 steps=1 finish=5"
    monkeypatch.setattr(rods, "choices", lambda: ["march=pixels", short, own])
    words = ["--scene", "trio", "-n", "18", "--large", "36", "--launches", "2", "--seed", "1"]
    assert main_of(monkeypatch, "throttle", *words, "--run", str(tmp_path)) == 0
    (row,) = systems.throttled_in(tmp_path)["rows"]
    assert (row["tried"], row["within"], row["chosen"]["settings"]) == (3, 1, own)
    assert list(row["finalists"]) == [own] and row["chosen"]["launches"] != row["finalists"][own]["launches"]
    assert row["large"]["n"] == 36 and row["large"]["other_ppm"] == 0 and row["large"]["gain"] > 0
    assert row["chosen"]["wrong_ppm"] == 0 and row["chosen"]["evaluations"] < row["plain"]["evaluations"]
    said = capsys.readouterr().out
    assert "trio, 32×18: rods of 16 to 4 pixels" in said and "cannot be told" in said, "of two launches"
    monkeypatch.setattr(rods, "choices", lambda: ["march=pixels", short])
    assert main_of(monkeypatch, "throttle", *words, "--run", str(tmp_path)) == 1
    assert "FAIL trio: no setting is within" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "arguments", "message"),
    [
        ("rods", ["--scene", "scene1"], "no scene 'scene1'; did you mean scene0"),
        ("rods", ["-n", "3"], "must be a whole number of at least 16"),
        ("throttle", ["--psnr", "nan"], "must be a number of at least 0"),
        ("throttle", ["--launches", "1"], "must be a whole number of at least 2"),
        ("throttle", ["--scene", "spheres"], "no scene 'spheres'"),
    ],
)
def test_bad_arguments_are_named(script, arguments, message):
    done = started.run([sys.executable, str(ROOT / "scripts" / "stepwise"), script, *arguments])
    assert done.returncode == 2 and message in done.stderr.strip().splitlines()[-1]
