"""What stepwise packets measures with and says: its rays by hand, its comparison with Embree, its page."""

from __future__ import annotations

import math
import os

import complete
import numpy as np
import pytest
from made_up import packets_result as made_up

from conformance import geometry
from conformance.feature_scenes import FLOOR, scene, shape
from study.core import run, show
from study.core.cli import StudyError
from study.core.registry import Scene, find_scene
from study.experiments.moving import measure as moving
from study.experiments.packets import figures as packets_figures
from study.experiments.packets import measure as packets
from study.experiments.packets import moving_tables as packets_moving
from study.experiments.packets import pictures as packets_pictures
from study.experiments.packets import systems as packets_systems
from study.experiments.packets import tables as packets_page
from study.experiments.systems import tables as systems
from study.measuring import rays as packets_rays

DATA = scene([FLOOR, shape("sphere", radius=1, position=[0, 0, 4])], light={"shadows": "hard"})
INF = np.inf


def test_camera_rays_are_the_camera_s_in_blocks():
    """Each of geometry's, once; 16 in a row are 4×4 neighbours."""
    rays = packets_rays.camera(DATA, 40, 24)
    eye, expected = geometry.rays(DATA, 40, 24)
    assert rays.shape == (960, 7) and np.allclose(rays[:, :3], eye) and np.isinf(rays[:, 6]).all()
    flat = expected.reshape(-1, 3)
    nearest = (rays[:, 3:6].astype(float) @ flat.T).argmax(1)
    assert sorted(nearest) == list(range(960)) and np.allclose(rays[:, 3:6], flat[nearest], atol=1e-6)
    block = nearest[:16]
    assert set(block) == {40 * y + x for y in range(4) for x in range(4)}


def test_secondary_rays_by_hand():
    """A ray straight down onto the floor goes straight up; one that misses makes none."""
    rays = np.array([[0, 1, 0, 0, -1, 0, INF], [0, 1, 0, 0, 1, 0, INF]], "<f4")
    found = packets_rays.secondary(DATA, rays, np.array([2.5, INF]), np.array([0.0, -1.0]), 1)
    offset = DATA["march"]["surface_offset"]
    assert np.allclose(found["mirror"], [[0, -1.5 + offset, 0, 0, 1, 0, INF]])
    light = np.array(DATA["light"]["position"], float)
    to = np.array([0, -1.5, 0]) - light
    shadow = found["shadow"][0]
    assert np.allclose(shadow[:3], light) and np.allclose(shadow[3:6], to / np.linalg.norm(to), atol=1e-6)
    assert np.isclose(shadow[6], np.linalg.norm(to) - 10 * offset)
    assert found["scattered"][0, 4] > 0


def test_the_scenes_made_for_it():
    made = packets_rays.many(64)
    assert {s["type"] for s in made["shapes"]} == {"sphere"} and len(made["shapes"]) == 64
    assert len({s["radius"] for s in made["shapes"]}) == 1 and made["light"]["shadows"] == "hard"
    assert {s["type"] for s in packets_rays.balls()["shapes"]} == {"sphere", "plane"}
    assert {s["type"] for s in packets.solids()["shapes"]} == {"sphere", "plane", "box", "cone"}


def test_hits_are_compared_ray_by_ray():
    rays = np.array([[0, 0, 0, 0, 0, 1, INF]] * 4, "<f4")
    ours = np.array([[3, 1], [INF, -1], [99.95, 0], [5, 1]])
    theirs = np.array([[3.5, 1], [4, 1], [INF, -1], [5, 0]])
    found = packets.agreement(DATA, "primary", rays, np.array([ours, theirs]))
    assert found == {"compared": 3, "other_shape": 2, "dt_max": 0.5}  # the third is at the bounds
    blocked = np.array([[[-INF, 0], [3, 0]], [[-INF, 0], [-INF, 0]]])
    assert packets.agreement(DATA, "shadow", rays[:2], blocked)["other_shape"] == 1


def rays_of(section):
    return next(part for part in section.parts if part.name == "packets")


def test_the_page_by_hand(tmp_path):
    complete.write(tmp_path / packets.FILE, made_up())
    section = systems.section(tmp_path)
    assert [p.name for p in section.parts][:1] == ["systems"] and packets_figures.FIGURE in section.drawn
    text = show.markdown(show.table(made_up()["rays"], packets_page.RAYS))
    primary, shadow, mirror, scattered = text.splitlines()[-4:]
    assert all("0 of 1,000 others" in line for line in (primary, shadow, mirror, scattered))
    assert "met" not in text.replace("method", "")
    drawn = show.markdown(show.table(packets_page.drawn_rows(made_up()), packets_page.DRAWN))
    assert drawn.count("base") == 1 and drawn.count("4.00× [3.00") == 2
    assert "Embree's time" in rays_of(section).foot
    said = {row["what"]: row for row in packets_systems.system_rows(made_up())}
    camera = said["spheres40, rays camera, million a second"]
    assert camera["error"].startswith("against Embree: 0 of 1,000 others")
    said_of_it = "over Embree by single rays (Embree 3.13.5)"
    assert camera["ratio"].replace("\u00a0", " ") == f"0.600× [0.550, 0.650] {said_of_it}"
    whole = said["spheres40 160×90, ms a frame, one thread"]
    assert whole["ratio"].startswith("4.00×") and whole["ratio"].endswith("over opt8_streams, at equal error")
    assert whole["ours"].startswith("2.00") and whole["error"] == "90.0 dB, 0 ppm wrong hits"
    assert packets_page.faults(made_up()) == []
    for name in packets_figures.drawings(made_up()).values():
        assert name.make() is not None


def test_a_file_of_before_there_were_streams_is_still_read(tmp_path):
    result = made_up()
    result["rays"] = [
        {k: v for k, v in r.items() if not k.startswith("embree_stream")} for r in result["rays"]
    ]
    complete.write(tmp_path / packets.FILE, result)
    tables = {part.name: show.markdown(part.table) for part in systems.section(tmp_path).parts}
    assert "256" not in tables["packets"] and "0.600×" in tables["packets"]
    assert packets_page.fastest(result["rays"][0]) == "embree1" and packets_figures.draw_rays(result)
    assert "256 rays a call –" in packets_page.sentences(result)[0]


def test_one_thread_s_rays_are_pinned_and_their_environment_varies(monkeypatch):
    """The parent is elsewhere meanwhile; of the program, by what it says of itself."""
    seen = []

    def hits(path, rays, kind, words, limit, reps, beside, *, cpu, env_bytes):
        seen.append((cpu, env_bytes, os.sched_getaffinity(0)))
        none = {f"{way}_ns": [] for way in packets.EMBREE}
        return {"ns": [5.0], **none, "embree": "not asked for", "lanes": 8}, np.zeros((1, len(rays), 2))

    monkeypatch.setattr(packets.packets_rays, "hits", hits)
    rays = packets_rays.camera(DATA, 8, 4)
    packets.of_rays(Scene("balls", None, DATA, False), rays, "primary", 3, 1, 1)
    last = run.FASTEST
    assert {cpu for cpu, *_ in seen} == {last} and len({size for _, size, _ in seen}) > len(seen) // 2
    if len(run.USABLE) > 1:
        assert all(last not in here for *_, here in seen)
    assert os.sched_getaffinity(0) == set(run.USABLE)


def test_rates_and_ratios_of_rays_by_hand(monkeypatch):
    """2,000 rays in 50,000 ns are 40 million a second; Embree's 75,000 ns are 1.5 of it."""

    def launch(scene, rays, kind, name, reps, env_bytes=0):
        took = {"ns": 50e3 if name == "own" else 100e3, "embree": "Embree", "lanes": 8}
        hits = np.tile(np.float32([2.0, 0.0]), (2, len(rays), 1))
        return took | {f"{way}_ns": 75e3 if way == "embree1" else None for way in packets.EMBREE}, hits

    def in_turn(names, launches, seed, cpu, once, about):
        for name in list(names) * launches:
            once(name, 0)

    monkeypatch.setattr(packets, "one_launch", launch)
    monkeypatch.setattr(packets.run, "interleaved", in_turn)
    row = packets.of_rays(find_scene("spheres40"), np.zeros((2000, 7)), "primary", 6, 1, 1)
    mine = {one["name"]: [one["mrays"], one["mrays_low"], one["mrays_high"]] for one in row["variants"]}
    assert mine["own"] == pytest.approx([40] * 3)
    assert mine["root by Newton"] == pytest.approx([20] * 3)
    assert row["embree1"]["mrays"] == pytest.approx(2000 / 75)
    ratio = [row[f"embree1_ratio{end}"] for end in ("", "_low", "_high")]
    assert ratio == pytest.approx([1.5] * 3)


def test_the_program_of_rays_runs_where_it_is_put(monkeypatch, tmp_path):
    """A program that writes its own affinity and environment in the place of hits."""
    program = tmp_path / "hits"
    program.write_text(
        "#!/usr/bin/env python3\nimport json, os, sys\n"
        "open(sys.argv[-1], 'wb').write(bytes(8))\n"
        "pad = len(os.environ.get('STEPWISE_PADDING', ''))\n"
        "print(json.dumps({'cpus': sorted(os.sched_getaffinity(0)), 'padding': pad}))\n"
    )
    program.chmod(0o755)
    monkeypatch.setattr(packets_rays, "build", lambda *_: program)
    rays = np.zeros((1, 7), "<f4")
    for cpu in run.USABLE:
        record, _ = packets_rays.hits(tmp_path, rays, "primary", cpu=cpu, env_bytes=77)
        assert record == {"cpus": [cpu], "padding": 77}
    assert packets_rays.hits(tmp_path, rays, "primary")[0] == {"cpus": run.USABLE, "padding": 0}


def test_equal_error_is_equal_or_says_it_is_not():
    """Of knobs that reach packets' error the fastest; where none does the nearest."""
    assert packets.target_of({"psnr_db": None}) == packets.target_of({"psnr_db": 142.0}) == 80
    assert packets.target_of({"psnr_db": 61.5}) == 61.5
    took = {28.8: 1.0, 42.7: 2.0, 90.7: 4.0, 110.4: 5.0, None: 9.0, math.nan: 0.1}
    rows = [{"psnr_db": db, "non_finite": 0} for db in took]

    def best(tried: list[dict], target: float) -> float | None:
        return packets.chosen(tried, target, lambda row: took[row["psnr_db"]])["psnr_db"]

    assert best(rows, 80) == 90.7 and best(rows, 28.9) == 28.8 and best(rows, math.inf) is None
    assert best(rows[:2], 80) == 42.7, "not the fastest: the nearest"
    reached = [packets.reached({"psnr_db": db, "non_finite": 0}, 80) for db in (math.nan, None, 79.9, 79.8)]
    assert reached == [False, True, True, False]
    for count in (1, math.nan, None):  # a file's null may be of NaN
        assert not packets.reached({"psnr_db": None, "non_finite": count}, 80)
    assert best([*rows[:2], {"psnr_db": None, "non_finite": 1}], 80) == 42.7


def test_a_cap_that_binds_is_taken_away_too():
    caps = {
        name: {k["max_steps"] for k in packets.knobs_of(find_scene(name))} for name in ("trio", "two_spheres")
    }
    assert caps == {"trio": {None}, "two_spheres": {None, packets.UNBOUND_STEPS}}
    for cap in (None, packets.UNBOUND_STEPS):
        hits = [
            k["hit_distance"] for k in packets.knobs_of(find_scene("two_spheres")) if k["max_steps"] == cap
        ]
        assert tuple(hits) == packets.HIT_DISTANCES


def test_a_row_that_is_not_equal_says_so(tmp_path):
    """In its own table and in that of all systems, with its decibels."""
    result = made_up()
    result["drawn"][0]["rows"][2] |= {"psnr_db": 55.3, "reached": False, "max_steps": 3000}
    complete.write(tmp_path / packets.FILE, result)
    tables = {part.name: part.markdown for part in systems.section(tmp_path).parts}
    for name, words in (("systems", "opt8_streams, equal error not reached: 55.3 dB"),
                        ("packets-equal-error", "not reached: 55.3 dB")):  # fmt: skip
        assert tables[name].count(words) == 1 and tables[name].count("not reached") == 1
    assert (
        "at equal error" not in tables["systems"]
        and "| the scene's | 3000 |" in tables["packets-equal-error"]
    )
    assert "| reached |" in tables["packets-equal-error"]


def animated() -> dict:
    """Made up, and of one row: 20 ms a frame at 1000×500, so 40 ns a pixel and core, on two 80."""
    ms = {"p5": 18.0, "p50": 20.0, "p95": 25.0, "most": 40.0, "mean": 20.0}
    row = {"tree": "BVH", "phase": "packets", "settings": "tree=bvh", "frames": 9, "width": 1000, "n": 500}
    row |= {"ms": ms, "update_ms": 0.25, "all_ms": [20.0] * 9}
    return made_up() | {
        "animation": [
            row | {"threads": 1, "core_ns_per_pixel": 40.0},
            row | {"threads": 2, "core_ns_per_pixel": 80.0},
            row | {"tree": "kd-tree", "threads": 1, "core_ns_per_pixel": 40.0},
        ]
    }


def test_the_animation_on_the_page_by_hand(tmp_path):
    """The article's 14.29 ms on 35 cores at 1920×1080: 241.198 ns a pixel and core."""
    complete.write(tmp_path / packets.FILE, animated())
    section = systems.section(tmp_path)
    (table,) = (p for p in section.parts if p.name == "packets-animation")
    first = next(line for line in table.markdown.splitlines() if line.startswith("| BVH"))
    assert "| 9 at 1000×500 | 20.00 | 20.00 (first 9) | 20.0 | 18.0 | 25.0 | 40.0 | 0.25 | 40.0 |" in first
    one, two = packets_moving.system_rows(animated())  # of its own tree alone
    assert (
        one["what"]
        == "spheres40_animated 1000×500, one process of 9 frames, ms a frame, the BVH rebuilt, 1 thread"
    )
    assert one["ratio"] == two["ratio"] == "–", "of 9 frames, the article's of 900 and another size"
    said = "mean 20.0 (95 % of frames under 25.0 ms); of the first 9 frames, which all its rows have: 20.0"
    assert one["ours"] == f"{said}; the tree 0.25" and one["error"] == "–", "an older file has none"
    held = animated()
    held["animation"][0]["error"] = {"psnr_db": 61.24, "wrong_ppm": 1234.4, "width": 640, "n": 360}
    one = packets_moving.system_rows(held)[0]
    assert one["error"] == "61.2 dB, 1,234 ppm wrong hits (its beginning at 640×360)"
    whole = animated()
    size = {"frames": 900, "width": 1920, "n": 1080, "all_ms": [20.0] * 900}
    whole["animation"] = [row | size for row in whole["animation"]]
    one, two = packets_moving.system_rows(whole)
    assert one["ratio"] == "6.03× its pixels per core and second" and two["ratio"].startswith("3.01×")
    assert packets_moving.sentences(animated())[2].endswith("building the kd-tree 0.25 ms of it")
    assert "no interval" in table.foot and "one process" in table.foot and "by the others" not in table.foot
    fewer = animated()
    fewer["animation"][2] |= {"frames": 4, "all_ms": [30.0] * 4}
    fewer["animation"][0]["all_ms"] = [10.0] * 4 + [28.0] * 5
    (table,) = packets_moving.parts(fewer)
    rows = [line for line in table.markdown.splitlines() if line.startswith(("| BVH", "| kd"))]
    assert [row.split(" | ")[5] for row in rows] == [f"{ms} (first 4)" for ms in ("10.00", "20.00", "30.00")]
    assert table.foot.startswith("9 frames by the phase's own tree on every core, 4 by the others")
    assert not packets_moving.parts(made_up()) + packets_moving.system_rows(made_up())  # an older file


def test_the_sheet_shows_the_difference_to_truth(monkeypatch, tmp_path):
    """Of a picture that is off by 1/10 in one pixel and one that is as truth has it."""
    planes = dict.fromkeys(("R", "G", "B", "Z", "evals"), np.zeros((8, 16), np.float32))
    planes |= {"id": np.zeros((8, 16), np.float32)}
    exact = planes | dict.fromkeys(("status", "status.all"), np.full((8, 16), 2, np.float32))
    off = planes | {"R": np.where(np.arange(128).reshape(8, 16) == 5, np.float32(0.1), np.float32(0))}
    drawn = {"off": off, "same": planes}
    figures = []
    monkeypatch.setattr(packets_pictures.rods, "picture", lambda _, __, one, size: drawn[one.name])
    monkeypatch.setattr(packets_pictures.truth, "picture", lambda one, size: exact)
    monkeypatch.setattr(packets_pictures.panels, "save", lambda figure, path: figures.append(figure) or path)
    scenes = [Scene(name, tmp_path, DATA, False) for name in drawn]
    (path,) = packets_pictures.write_pictures(tmp_path, scenes, 16)
    assert path == tmp_path / "images" / "packets-pictures.png"
    _, *panels = figures[0].axes  # its colour bar is the first
    titles = [p.get_title(loc="left") for p in panels]
    psnr = 10 * math.log10(3 * 128 / 0.1**2)
    assert titles[1] == f"to ground truth, 16×8: {psnr:.1f} dB, 0 ppm wrong hits" and "identical" in titles[3]
    said = [text.get_text() for p in panels for text in p.texts]
    assert said[0] == "1 of 128 pixels differ by over 10⁻⁶\nlargest difference: 0.1"
    assert said[1] == "no pixel differs by over 10⁻⁶\nlargest difference: 0"
    shown = [p.images[0].get_array() for p in panels]
    assert np.isclose(shown[1].max(), 0.1) and np.sum(shown[1] > 1e-6) == 1 and shown[3].max() < 1e-6


def test_the_article_s_own_figures_by_hand(monkeypatch):
    """20 million vectors in 100 ns each are 2,000 ms, by SSE in 10 ns 200 ms."""
    size, ends = 20_000_000, ("value", "low", "high")
    kernels = [("scalar", "AoS", "1/sqrt", 100.0), ("SSE", "SoA", "rsqrtps + 1", 10.0)]

    def normalise(vectors, rounds, seed, cpu):
        base = {"max_ulp": 3.0, "rms_ulp": 1.0}
        return [
            base | {"vectors": many, "isa": isa, "layout": layout, "name": name}
            | {"ns": dict.fromkeys(ends, ns), "speedup": dict.fromkeys(ends, 100 / ns)}
            for many in (1024, vectors)
            for isa, layout, name, ns in kernels
        ]  # fmt: skip

    monkeypatch.setattr(packets.functions, "normalise", normalise)
    found = packets.normalised(size, 1)
    assert len(found) == 2 and found[1]["ms"] == found[1]["ms_high"] == pytest.approx(200)
    scalar, sse, over = packets_systems.system_rows(made_up() | {"normalise": found})[:3]
    assert scalar["what"] == "normalising 20,000,000 vectors, scalar, ms" and scalar["error"] == "≤ 3.0 ulp"
    assert scalar["article"] == "3156 (Core 2 Duo, 1.6 GHz)" and scalar["ratio"] == "1.58× its speed"
    assert sse["ours"].split()[0] == "200" and sse["ratio"] == "0.860× its speed"
    assert (
        over["ours"].startswith("10.0×") and over["ratio"] == "0.545× of it" and over["article"] == "18.35×"
    )
    less = packets_systems.normalise_rows(made_up() | {"normalise": packets.normalised(4096, 1)})
    assert less[0]["article"] == less[0]["ratio"] == show.NOTHING, "another size than the article's"


def test_frames_by_root_by_hand(monkeypatch, tmp_path):
    """Made-up: 4 ms with the exact root, 2 with the approximate, which is told by its setting alone."""
    told = lambda: os.environ[packets_rays.SETTINGS].removeprefix("root=")  # noqa: E731
    monkeypatch.setattr(packets.truth, "picture", lambda scene, size: None)
    monkeypatch.setattr(packets.rods, "picture", lambda phase, words, scene, size: told())
    took, pads = {"exact": 4.0, "newton": 2.0}, set()
    monkeypatch.setattr(packets.rods, "milliseconds", lambda *a: pads.add(a[-1]) or took[told()])
    error = {"exact": 131.0, "newton": 120.0}
    made = lambda exact, made: {"psnr_db": error[made], "wrong_ppm": 0.0, "non_finite": 0}  # noqa: E731
    monkeypatch.setattr(packets.rods, "errors", made)
    rows = packets.by_root(find_scene("spheres40"), 90, 6, 1)
    assert len(pads) > 6, "the environment's size varies"
    assert [(r["root"], r["ms"], r["gain"], r["psnr_db"]) for r in rows] == [
        ("exact", 4.0, None, 131.0),
        ("newton", 2.0, 2.0, 120.0),
    ]
    complete.write(tmp_path / packets.FILE, made_up() | {"roots": rows})
    (table,) = (p for p in systems.section(tmp_path).parts if p.name == "packets-roots")
    lines = table.markdown.splitlines()
    assert "| exact | 4.00" in lines[2] and "| base | 131 |" in lines[2] and "2.00× [2.00" in lines[3]
    rows[1]["non_finite"] = math.nan
    assert packets_page.faults(made_up() | {"roots": rows}) == [
        "spheres40, root=newton: nan samples are not finite"
    ]


def test_without_embree_the_page_says_so(tmp_path):
    complete.write(tmp_path / packets.FILE, made_up(embree=False))
    section = systems.section(tmp_path)
    assert rays_of(section).foot == "Embree: not compared: built without Embree."
    assert "– over not compared: built without Embree" in section.parts[0].markdown
    assert packets_page.faults(made_up(embree=False)) == []


def test_what_must_not_be_is_a_fault():
    result = made_up()
    result["rays"][0]["agreement"]["other_shape"] = 5
    result["drawn"][0]["rows"][1]["non_finite"] = float("nan")
    first, second = packets_page.faults(result)
    assert "5 hits are others than Embree's" in first and "opt4" in second


def test_a_broken_file_is_named(tmp_path):
    (tmp_path / packets.FILE).write_text('{"rays": [1], "drawn": []}')
    with pytest.raises(StudyError, match=r"packets\.json: not what scripts/stepwise packets writes"):
        systems.section(tmp_path)


@pytest.mark.parametrize("lanes, beside", [(8, False), (16, True)])
def test_the_bars_are_of_the_lanes_that_ran(lanes: int, beside: bool) -> None:
    ran = {"own": lanes, "kd-tree": lanes, "4 lanes": 4} | ({"8 lanes": 8} if beside else {})
    row = {"scene": "balls", "kind": "primary", "embree16": None, "embree1": {"mrays": 3.0}}
    row["variants"] = [{"name": name, "lanes": n, "mrays": 2.0} for name, n in ran.items()]
    figure = packets_figures.draw_rays({"rays": [row]})
    named = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert ("here, 8 lanes (AVX2)" in named) == beside and f"here, BVH, {lanes} lanes" in named
    assert len(named) == len(figure.axes[0].patches) == len(ran) + 1


def test_frames_of_its_animation_outlive_an_interruption(tmp_path, monkeypatch) -> None:
    """Of the first tree on one thread all frames are there, of the next two: then 20 are asked for."""
    monkeypatch.setattr(moving, "thread_counts", lambda: [1])
    first = packets_moving.study(2, 16, tmp_path)
    kept = sorted((tmp_path / moving.FOLDER).glob("packets-*.jsonl"))
    assert len(kept) == 2  # a file for each tree
    again = packets_moving.study(20, 16, tmp_path)
    for row, before, count in zip(again, first, (20, 5), strict=True):  # of the other tree a quarter
        assert row["resumed_at"] == [2] and row["all_ms"][:2] == before["all_ms"]
        assert len(row["all_ms"]) == row["frames"] == count and row["common_frames"] == 5
    assert sorted((tmp_path / moving.FOLDER).glob("packets-*.jsonl")) == kept
