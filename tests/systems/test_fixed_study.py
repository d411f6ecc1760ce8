"""stepwise fixed: its whole way at a small size, its tables of a made-up result, which blocks are wrong."""

from __future__ import annotations

import contextlib
import json
import os
import sys

import complete
import emitted
import numpy as np
import pytest
import started
from made_up import fixed_result as made_up

from study.core import registry, run, schema, show
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.fixed import tables as fixed_page
from study.experiments.fixed.schema import Fixed
from study.experiments.moving import schema as moving_schema
from study.experiments.systems import tables as systems

pytestmark = pytest.mark.slow

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
    assert "gain" not in rows["article, 1 lane"] and "gain" in rows["1 lane"], "none is compared with itself"
    assert all("over_float" not in r for r in rows.values() if r["case"] == f"float, {lanes} lanes")
    assert list(rows) == IN_LANES[lanes] and rows["1 lane"].get("over_float") == ratio


def test_floats_are_compared_with_in_as_many_lanes_and_what_is_compared_with_is_the_base(tmp_path):
    """Made up: integers take 10 ms and 6, floats 8 in 8 lanes, 3 in 16; by an older file's launches too."""
    result, took = (
        made_up(),
        {"8 lanes": 10.0, "16 lanes": 6.0, "float, 8 lanes": 8.0, "float, 16 lanes": 3.0},
    )
    for row in result["rows"]:
        row["launches"] = [took.get(row["case"], 20.0)] * 6
    assert "over_like_float" not in result["rows"][2]
    complete.write(tmp_path / fixed.FILE, result)
    (table,) = (p for p in systems.section(tmp_path).parts if p.name == "fixed")
    head, _, *lines = ([c.strip() for c in x.strip("|").split("|")] for x in table.markdown.splitlines())
    assert head[3:6] == [
        "× the article's on one lane [95 %]",
        "× float in the most lanes that ran [95 %]",
        "× float in as many lanes [95 %]",
    ]
    cells = {line[0]: [cell.split()[0] for cell in line[3:6]] for line in lines}
    assert cells == {
        "article, 1 lane": ["base", "0.500×", "–"],
        "1 lane": ["2.00×", "0.500×", "–"],
        "8 lanes": ["2.00×", "0.500×", "0.800×"],
        "16 lanes": ["2.00×", "0.500×", "0.500×"],
        "16 lanes, 28 bits": ["2.00×", "0.500×", "0.150×"],
        "float, 8 lanes": ["2.00×", "0.500×", "base"],
        "float, 16 lanes": ["2.00×", "base", "base"],
    }


def test_the_rows_of_systems_where_8_lanes_are_the_most():
    result = made_up()
    result["rows"] = [row for row in result["rows"] if row["case"] in IN_LANES[8]]
    (integers,) = [r for r in fixed_page.system_rows(result) if "in floats" in r["what"]]
    assert integers["what"].startswith("8 lanes") and "floats 2.0" in integers["ours"]
    assert fixed_page.system_rows(result)[0]["error"].startswith("50.0 dB")
    assert fixed_page.draw(result).axes[1].lines[-2].get_label() == "the same in floats"


def test_the_rows_of_systems_by_hand(tmp_path):
    complete.write(tmp_path / fixed.FILE, made_up())
    rows = fixed_page.system_rows(made_up())
    by_what = {row["what"]: row for row in rows}
    lanes = "integers in lanes (fixed_simd), spheres40_animated 1920×1080,"
    one = by_what[f"{lanes} one process of 2 frames, ms a frame, 1 thread"]
    # resumed at 1
    two_threads = by_what[f"{lanes} 2 processes of 2 frames together, ms a frame, 2 threads"]
    assert one["ratio"] == two_threads["ratio"] == "–", "of 2 frames, the article's of 900"
    assert one["error"] == "50.0 dB, 400 ppm wrong hits (the still at 320×180)"
    common = "; of the first 2 frames, which all its rows have: 500"
    assert one["ours"] == f"mean 500 (95 % of frames under 600 ms){common}"
    assert one["article"].startswith("14.29 (mean of 900 frames, no shadows;")
    assert rows[0]["what"].startswith("the article's roots and corners, one lane (fixed)"), "the headline"
    assert rows[3]["what"].endswith("2 threads, no shadows")
    assert rows[3]["error"] == "–", "truth was not asked for this picture"
    integers = by_what["16 lanes against the same in floats, ms"]
    assert integers["ratio"].split() == ["0.500×", "[0.400,", "0.600]", "the", "floats'", "speed"]
    assert integers["error"] == "50.0 dB, 400 ppm wrong hits; floats none, 0 ppm wrong hits"
    section = systems.section(tmp_path)
    assert {part.name for part in section.parts} >= {"systems", "fixed", "fixed-bits", "fixed-clearing"}
    assert fixed_pictures.PICTURES in str(list(section.images)) and fixed_page.FIGURE in section.drawn
    text = show.markdown(show.table(made_up()["sweep"], fixed_page.SWEEP))
    assert "a radius of 5: does not fit" in text and "three" not in text and "3 Newton steps" in text


def test_rows_of_fewer_frames_have_no_ratio_to_the_article_and_the_mean_that_all_have():
    """Made up: 900 frames that get slower, 50 ms, then from the 226th on 110; 225 of 50: the programs are as
    fast, though the means are 95 and 50 ms. The article: 14.29 ms on 35 cores, 500.15 core·ms a frame."""
    result = made_up()
    slower = [50.0] * 225 + [110.0] * 675
    rows = [row | {"resumed_at": [], "threads": 2} for row in result["animation"][1:3]]
    for row, ms in zip(rows, (slower, slower[:225]), strict=True):
        mean = sum(ms) / len(ms)
        row |= {"all_ms": ms, "frames": len(ms), "ms": row["ms"] | {"mean": mean}}
        row["core_ns_per_pixel"] = mean * 2e6 / (1920 * 1080)
        for key in ("common_ms", "common_frames"):
            row.pop(key, None)
    whole, part = fixed_page.system_rows(result | {"animation": rows})[:2]
    for row, mean in ((whole, "95.0"), (part, "50.0")):
        assert row["ours"].startswith(f"mean {mean} ")
        assert row["ours"].endswith("; of the first 225 frames, which all its rows have: 50.0")
    assert whole["ratio"] == "2.63× its pixels per core and second"  # 500.15 over 190
    assert part["ratio"] == "–"
    bare = [row | {"shadows": False, "error": {"psnr_db": 50.0, "wrong_ppm": 7.0, "width": 9, "n": 5}}
            for row in rows]  # fmt: skip
    said = fixed_page.system_rows(result | {"animation": bare})[0]
    assert (
        said["error"] == "50.0 dB, 7 ppm wrong hits (its beginning at 9×5)"
        and said["ratio"] == whole["ratio"]
    )
    smaller = [row | {"width": 960, "n": 540} for row in rows]
    assert fixed_page.system_rows(result | {"animation": smaller})[0]["ratio"] == "–", "another size"


def test_an_older_file_s_frames_have_their_mean(tmp_path):
    """It had the median, and core·ns a pixel of that: 500.15 ms are the mean of 400 and 600.3, not 450."""
    result = made_up()
    for row in result["animation"]:
        row["ms"] = {key: value for key, value in row["ms"].items() if key != "mean"}
        row["core_ns_per_pixel"] = 450e6 * row["threads"] / (1920 * 1080)
    (tmp_path / fixed.FILE).write_text(json.dumps(result))
    rows = fixed.read(tmp_path / fixed.FILE)["animation"]
    assert [row["ms"]["mean"] for row in rows] == [500.15] * 4
    assert [row["core_ns_per_pixel"] for row in rows] == pytest.approx(
        [500.15e6 * row["threads"] / (1920 * 1080) for row in rows]
    )
    whole = [row | {"frames": 900} for row in rows]
    assert fixed_page.system_rows(result | {"animation": whole})[1]["ratio"].startswith("1.00×")
    assert moving_schema.with_mean(made_up()["animation"][2])["ms"]["mean"] == 100.0, "a file's own stays"


def test_the_animations_table_by_hand():
    """The article's own row first: 14.29 ms × 35 cores over 1,920 × 1,080 pixels are 241 ns."""
    table = show.markdown(show.table(fixed_page.animation_rows(made_up()), fixed_page.ANIMATION))
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    article, ours, _, two, bare = lines
    assert article[0].startswith("the article, Mellanox") and article[1:4] == [
        "none",
        "35",
        "900 at 1920×1080",
    ]
    assert article[4] == "14.29" and article[5:11] == ["–"] * 6 and article[11:] == ["241", "1.00×"]
    assert ours[0] == "the article's roots and corners, one lane (fixed)" and ours[1] == "hard"
    assert two[3] == "2 at 1920×1080, resumed at 1" and two[2] == "2" and two[12] == "–"
    assert bare[1] == "none" and bare[11:] == ["241", "–"], "two frames are no 900: no ratio"


def test_rows_of_more_frames_have_the_mean_of_those_that_all_have():
    """Later frames are slower: over all of them 3 is no mean of the same thing as 1.5."""
    rows = [{"all_ms": [1.0, 2.0], "frames": 2}, {"all_ms": [3.0, 4.0, 50.0], "frames": 3}]
    found = fixed.with_common(rows)
    assert [(row["common_frames"], row["common_ms"]) for row in found] == [(2, 1.5), (2, 3.5)]
    assert fixed.with_common([{"all_ms": []}, rows[1]]) == [{"all_ms": []}, rows[1] | {
        "common_frames": 3, "common_ms": 19.0}]  # fmt: skip
    assert fixed.with_common([]) == []
    result = made_up()  # written before there were such keys
    result["animation"][1] |= {"all_ms": [400.0, 600.3, 9000.0], "frames": 3}
    (column,) = [c for c in fixed_page.ANIMATION if c.name == "mean of the frames that all rows have"]
    cells = [column.text(row) for row in fixed_page.animation_rows(result)]
    assert cells == ["–", *["500.1 (first 2)"] * 4]
    assert "not interleaved" in fixed_page.NOTE and "no interval" in fixed_page.NOTE


def test_the_frames_figure_has_every_program_on_every_core():
    along, share = fixed_page.draw_frames(made_up()).axes
    names = [line.get_label() for line in along.lines]
    assert names == [
        "the article's roots and corners, one lane: mean 500",
        "integers in lanes: mean 500",
        "the article's roots and corners, one lane, no shadows: mean 500",
        "the article's mean, 35 cores, no shadows: 14.29",
    ]
    assert list(share.lines[0].get_xdata()) == [400.0, 600.3]
    assert list(share.lines[0].get_ydata()) == [50.0, 100.0]
    small = made_up()
    small["animation"] = [row | {"n": 90} for row in small["animation"]]
    assert len(fixed_page.draw_frames(small).axes[0].lines) == 3, "14.29 ms are not of another size"
    none = made_up()
    none["animation"] = [row | {"all_ms": []} for row in none["animation"]]
    assert list(fixed_page.drawings(none)) == [fixed_page.FIGURE]


def test_how_many_frames_each_program_has(monkeypatch):
    monkeypatch.setattr(fixed.moving, "thread_counts", lambda: [1, 2])
    assert fixed.share(900, False, 2, True) == 900, "the headline"
    assert fixed.share(900, False, 1, True) == fixed.share(900, True, 2, True) == 225
    assert fixed.share(900, False, 2, False) == 900 and fixed.share(900, True, 2, False) == 60
    assert fixed.share(900, True, 1, True) == 60 and fixed.share(2, True, 1, True) == 2
    monkeypatch.setattr(fixed.moving, "thread_counts", lambda: [1])
    assert fixed.share(900, False, 1, True) == 900


def test_large_pictures_are_held_against_themselves_without_clearing(monkeypatch):
    """Three pixels of a sphere in a cleared block of 40 × 25 pixels are 3,000 ppm."""
    said = []

    @contextlib.contextmanager
    def settings(words, lanes=None):
        said.append(words)
        yield

    def picture(*_):
        planes = {c: np.zeros((25, 40), np.float32) for c in ("cleared", "R", "G", "B", "Z")}
        planes["id"] = np.full((25, 40), -1, np.float32)
        if said[-1].endswith("never"):
            planes["id"][3, 4:9] = 2
        else:
            planes["cleared"][:16, :7] = 1
        return planes

    monkeypatch.setattr(fixed, "settings", settings)
    monkeypatch.setattr(fixed.rods, "picture", picture)
    monkeypatch.setattr(fixed, "milliseconds", lambda *_: 1.0)
    monkeypatch.setattr(fixed.images, "non_finite", lambda _: 0)
    monkeypatch.setattr(fixed.truth, "picture", lambda *_: pytest.fail("truth is asked"))
    rows = {row["clear"]: row for row in fixed.clearing([fixed.TRUTH_HEIGHT + 1], 2, 1, "fixed")}
    assert rows["corners"]["lost_pixels"] == 3 and rows["corners"]["wrongly_cleared_ppm"] == 3000
    assert rows["corners"]["cleared"] == pytest.approx(112 / 1000) and rows["never"]["lost_pixels"] == 0
    assert fixed_page.CLEARING[5].text(rows["corners"]) == "itself without clearing"


def test_a_broken_file_is_named(tmp_path):
    (tmp_path / fixed.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"fixed\.json: not what scripts/stepwise fixed writes"):
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
        "rays at its four corners: 1 blocks wrongly cleared, 3 pixels lost",
        "planes at its edges against spheres: 1 blocks wrongly cleared, 1 pixels lost",
    ]
    assert [len(p.patches) for p in panels] == [1, 1]


def test_all_of_it_small(tmp_path):
    words = [
        "-n",
        "16",
        "--sizes",
        "16",
        "410",
        "--frames",
        "2",
        "--frame-n",
        "16",
        "--launches",
        "2",
        "--json",
    ]
    done = started.run(
        [sys.executable, str(ROOT / "scripts" / "stepwise"), "fixed", *words, "--run", str(tmp_path)]
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / fixed.FILE).read_text())
    assert result == emitted.result(done.stdout)
    simd = registry.find_phase("fixed_simd")
    most = 1 if registry.missing_isa(simd) else registry.variant_here(simd).lanes
    assert [row["case"] for row in result["rows"]] == IN_LANES[most]
    assert len(result["sweep"]) == 3 * len(fixed.BITS) and any("refused" in row for row in result["sweep"])
    assert result["clearing"][0]["wrongly_cleared_ppm"] == 0 < result["clearing"][1]["wrongly_cleared_ppm"]
    assert all(len(row["all_ms"]) == row["common_frames"] == 2 for row in result["animation"])
    cores = len({1, len(run.USABLE)})
    programs = ["article"] * cores + (["lanes"] * cores + ["floats"] * cores if most > 1 else [])
    programs += ["article", "lanes"] if most > 1 else ["article"]
    assert [row["program"] for row in result["animation"]] == programs
    errors = [row["error"] for row in result["animation"]]
    assert all((e["width"], e["n"]) == (28, 16) and 20 < e["psnr_db"] < 150 for e in errors), errors
    assert errors[0]["psnr_db"] != errors[-1 if most == 1 else -2]["psnr_db"], (
        "without shadows, to that truth"
    )
    words = result["animation"][0]["settings"]
    assert "roots=article clear=corners" in words and "bits=20" in words, "the article's program first"
    bare = [not row["shadows"] for row in result["animation"]]
    assert bare == [False] * (len(bare) - sum(bare)) + [True] * (2 if most > 1 else 1)
    assert not (tmp_path / "animation").exists(), "kept frames are forgotten when the file is written"
    assert not schema.unknown(result, Fixed)
    assert (tmp_path / "images" / "fixed-blocks.png").exists() and (
        tmp_path / "figures" / "fixed-frames.png"
    ).exists()
