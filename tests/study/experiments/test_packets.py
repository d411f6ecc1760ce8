"""stepwise packets: rays beside Embree by hand, equal error, its tables of a published run, all of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import complete
import msgspec
import numpy as np
import pytest

from conformance.feature_scenes import FLOOR, scene, shape
from study.core import cli, commands, run
from study.core.registry import find_scene
from study.experiments.packets import measure as packets
from study.experiments.packets import scenes, tables
from study.experiments.packets.schema import FILE, Agreement, Limits, Packets
from study.measuring import rays
from study.measuring.rays import Record

DATA = scene([FLOOR, shape("sphere", radius=1, position=[0, 0, 4])], light={"shadows": "hard"})
INF = np.inf


def published(**more: Any) -> Packets:
    return msgspec.convert(complete.published(FILE) | more, Packets)


def test_the_scenes_made_for_it() -> None:
    made, balls = scenes.many(64), scenes.balls()
    assert {s["type"] for s in made["shapes"]} == {"sphere"} and len(made["shapes"]) == 64
    assert len({s["radius"] for s in made["shapes"]}) == 1
    assert {s["type"] for s in balls["shapes"]} == {"sphere", "plane"}
    assert made["light"]["shadows"] == balls["light"]["shadows"] == "hard"


def test_hits_are_compared_ray_by_ray() -> None:
    down = np.array([[0, 0, 0, 0, 0, 1, INF]] * 4, "<f4")
    ours = np.array([[3, 1], [INF, -1], [99.95, 0], [5, 1]])
    theirs = np.array([[3.5, 1], [4, 1], [INF, -1], [5, 0]])
    found = packets.agreement(DATA, "primary", down, np.array([ours, theirs]))
    assert found == Agreement(compared=3, other_shape=2, dt_max=0.5)  # the third is at the bounds
    blocked = np.array([[[-INF, 0], [3, 0]], [[-INF, 0], [-INF, 0]]])
    assert packets.agreement(DATA, "shadow", down[:2], blocked).other_shape == 1


def test_rates_and_ratios_of_rays_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """2,000 rays in 50,000 ns are 40 million a second; Embree's 75,000 ns are 1.5 of it. Launches are on the
    measured CPU."""
    seen = []

    def hits(path, wanted, kind, words, limit, reps, beside, *, cpu, env_bytes):
        seen.append((cpu, env_bytes))
        record = Record(ns=[50e3 if beside else 100e3], lanes=8, settings=words, embree="Embree")
        record.embree1_ns = [75e3] if beside else []
        return record, np.tile(np.float32([2.0, 0.0]), (2, len(wanted), 1))

    monkeypatch.setattr(packets.rays, "hits", hits)
    row = packets.of_rays(find_scene("spheres40"), np.zeros((2000, 7)), "primary", 6, 1, 1)
    assert {cpu for cpu, _ in seen} == {run.FASTEST} and len({size for _, size in seen}) > len(seen) // 2
    mine = {one.name: (one.mrays, one.mrays_low, one.mrays_high) for one in row.variants}
    assert mine["own"] == pytest.approx((40, 40, 40)) and mine["root by Newton"] == pytest.approx((20,) * 3)
    assert row.embree1.mrays == pytest.approx(2000 / 75) and row.embree16 is None
    assert row.embree1_ratio == row.embree1_ratio_low == row.embree1_ratio_high == pytest.approx(1.5)


def limits(db: float | None, non_finite: int = 0) -> Limits:
    return Limits(psnr_db=db, wrong_ppm=0.0, non_finite=non_finite)


def test_equal_error_is_equal_or_says_it_is_not() -> None:
    """The fastest of the limits that reach packets' error; where none does the nearest."""
    assert packets.target_of(limits(None)) == packets.target_of(limits(142.0)) == 80
    assert packets.target_of(limits(61.5)) == 61.5
    took = {28.8: 1.0, 42.7: 2.0, 90.7: 4.0, 110.4: 5.0, None: 9.0, math.nan: 0.1}
    rows = [limits(db) for db in took]

    def best(tried: list[Limits], target: float) -> float | None:
        return packets.chosen(tried, target, lambda row: took[row.psnr_db]).psnr_db

    assert best(rows, 80) == 90.7 and best(rows, 28.9) == 28.8 and best(rows, math.inf) is None
    assert best(rows[:2], 80) == 42.7, "not the fastest: the nearest"
    reached = [packets.reached(limits(db), 80) for db in (math.nan, None, 79.9, 79.8)]
    assert reached == [False, True, True, False]
    assert not packets.reached(limits(None, 1), 80)
    assert best([*rows[:2], limits(None, 1)], 80) == 42.7


def test_a_cap_that_binds_is_taken_away_too() -> None:
    for name, caps in (("trio", {None}), ("two_spheres", {None, packets.UNBOUND_STEPS})):
        tried = packets.limits_of(find_scene(name))
        assert {one["max_steps"] for one in tried} == caps
        assert len(tried) == len(caps) * len(packets.HIT_DISTANCES)


def fastest_way(row: dict[str, Any]) -> tuple[float, float]:
    """Ours over the fastest of Embree's three ways, and ours in million rays a second, of a file's row."""
    ways = [key for key in ("embree16", "embree1", "embree_stream") if row[key]]
    way = max(ways, key=lambda key: row[key]["mrays"])
    return row[f"{way}_ratio"], next(one["mrays"] for one in row["variants"] if one["name"] == "own")


def test_the_articles_figures_beside_ours() -> None:
    """3,156 ms, 172 ms and 18.35× are the article's; ours are of the run's file."""
    found, data = tables.system(complete.RUN), complete.published(FILE)
    ways = {"scalar": ("AoS", "1/sqrt"), "SSE": ("SoA", "rsqrtps + 1")}
    rows = {
        row["isa"]: row for row in data["normalise"] if ways.get(row["isa"]) == (row["layout"], row["name"])
    }
    scalar, sse = rows["scalar"]["ms"], rows["SSE"]["ms"]
    wanted = [("3156", scalar, 3156 / scalar), ("172", sse, 172 / sse)]
    wanted += [("18.35×", scalar / sse, scalar / sse / 18.35)]
    ratios = sorted(map(fastest_way, data["rays"]))
    wanted += [("“millions”", ours, ratio) for ratio, ours in (ratios[0], ratios[-1])]
    assert found and [one.said for one in found.claims] == [said for said, _, _ in wanted]
    for one, (_, ours, ratio) in zip(found.claims, wanted, strict=True):
        assert complete.figure(one.ours) == pytest.approx(ours, rel=0.02)
        assert complete.figure(one.ratio) == pytest.approx(ratio, rel=0.02)
    assert [one.beside for one in found.claims[:3]] == [None] * 3
    assert tables.normalise_claims(published(normalise=[])) == []
    names = ["packets", "packets-equal-error", "packets-variants"]
    assert [part.name for part in found.parts] == names
    assert all(drawing.make().axes for drawing in found.drawn.values())


def test_its_lesson_is_beside_embrees_fastest_way() -> None:
    data = complete.published(FILE)
    known = {f"{row['scene']}, {row['kind']}": row for row in data["rays"]}
    data["rays"][0]["agreement"]["other_shape"] = 3
    (lesson,) = tables.lessons(published(rays=data["rays"]))
    assert lesson.name == "packets" and len(lesson.table.cells) == 5
    for (name, _), (ours, _), _, _, (ratio, _) in lesson.table.cells:
        wanted_ratio, wanted = fastest_way(known[name])
        assert complete.figure(ratio) == pytest.approx(wanted_ratio, rel=0.01)
        assert complete.figure(ours) == pytest.approx(wanted, rel=0.01)
    others = sum(row["agreement"]["other_shape"] for row in data["rays"])
    compared = sum(row["agreement"]["compared"] for row in data["rays"])
    assert f"{others} of {compared:,} " in lesson.foot
    assert "opt8_streams" in lesson.foot and "opt4" not in lesson.foot


def test_a_row_that_is_not_equal_says_so() -> None:
    drawn = complete.published(FILE)["drawn"][:1]
    drawn[0]["rows"][2] |= {"psnr_db": 55.3, "reached": False, "max_steps": 3000}
    said = [row["equal"] for row in tables.drawn_rows(published(drawn=drawn)) if row["max_steps"] == 3000]
    assert said and all("55.3" in text for text in said)
    drawn[0]["rows"][2] |= {"psnr_db": None, "non_finite": 7}
    assert len(tables.faults(published(drawn=drawn))) == 1


def without_embree(row: dict[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in row.items() if not key.startswith("embree")}
    return kept | {"agreement": None, "embree": "not compared"}


def test_without_embree_there_is_no_ratio() -> None:
    bare = published(rays=[without_embree(row) for row in complete.published(FILE)["rays"]])
    assert tables.rays_claims(bare) == [] and tables.faults(bare) == []
    assert "Embree" not in [column.name for column in tables.parts(bare)[0].table.columns]


def test_hits_that_embree_does_not_have_are_a_fault() -> None:
    found = complete.published(FILE)["rays"][:1]
    found[0]["agreement"]["other_shape"] = 2 + int(packets.MOST_OTHERS * found[0]["rays"]) + 1
    assert len(tables.faults(published(rays=found, drawn=[]))) == 1


@pytest.mark.slow
def test_from_rays_to_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One scene, one marching phase."""
    balls = scenes.kept(tmp_path, "balls", scenes.balls())
    monkeypatch.setattr(scenes, "traced", lambda _: [balls])
    monkeypatch.setattr(scenes, "drawn", lambda _: [find_scene("spheres40")])
    monkeypatch.setattr(packets, "MARCHED", ("opt8_streams",))
    words = ["--ray-n", "32", "-n", "16", "--launches", "2", "--reps", "1", "--seed", "1"]
    words += ["--vectors", "4096", "--run", str(tmp_path)]
    outcome, _ = commands.called("packets", words)
    result = Packets.load(tmp_path / FILE)
    assert outcome.ended == 0 and cli.plain(outcome.result) == cli.plain(result)
    assert [row.kind for row in result.rays] == list(rays.KINDS)
    for row in result.rays:
        assert row.rays > 100 and (row.agreement is None) == (row.embree16 is None)
        assert {v.name for v in row.variants} >= {"own", "kd-tree", "each alone", "root by Newton"}
    (drawn,) = result.drawn
    assert [row.phase for row in drawn.rows] == ["packets", "opt8_streams"]
    assert all(row.threads[0].threads == 1 for row in drawn.rows)
    assert {row.isa for row in result.normalise} >= {"scalar", "SSE"}
    assert {row.vectors for row in result.normalise} == {4096}
    assert (tmp_path / "figures" / "packets-equal-error.svg").exists()
