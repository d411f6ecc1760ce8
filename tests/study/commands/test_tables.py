"""tables.py and what it stands on, on tests/fixtures/run: its medians and ratios are known by arithmetic."""

import json
import math
import shutil
import tomllib
from pathlib import Path

import complete
import emitted
import pandas as pd
import pytest

from study.commands import tables
from study.core import registry, show, store, table_files
from study.core.cli import StudyError
from study.experiments import experiment
from study.experiments.sweep import chapter
from study.numbers import analysis, ladder, paper, stats, summary
from study.numbers import columns as ladder_columns
from study.pictures import ladder as figures
from study.report import published_tables

ROOT = Path(__file__).parents[3]
pytestmark = pytest.mark.usefixtures("few_resamples")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))


def made_of(run: Path, rows: pd.DataFrame) -> table_files.Made:
    return tables.make(rows, experiment.sections(analysis.load(run)))


def rows_of(run: Path) -> pd.DataFrame:
    return ladder.rows(analysis.load(run))


def row(run: Path, scene: str, phase: str, height: int) -> pd.Series:
    rows = rows_of(run)
    found = rows[(rows["scene"] == scene) & (rows["phase"] == phase) & (rows["height"] == height)]
    assert len(found) == 1
    return found.iloc[0]


def edit(run: Path, change) -> None:
    """Rewrites frames.jsonl with every frame changed in place, or left out where `change` returns False."""
    path = run / "frames.jsonl"
    frames = [json.loads(line) for line in path.read_text().splitlines()]
    kept = [frame for frame in frames if change(frame) is not False]
    path.write_text("".join(json.dumps(frame) + "\n" for frame in kept))


def third(frame) -> bool:
    """False of the third of opt1's launches on the Mandelbulb: two have no interval."""
    return (frame["phase"], frame["scene"], frame["launch"]) != ("opt1", "mandelbulb", 2)


# The ladder's figures


def test_times_are_medians_over_launches_in_the_unit_of_their_name(run: Path) -> None:
    opt4 = row(run, "scene0", "opt4", 180)
    pixels = 320 * 180
    assert opt4["ns_per_pixel"] == pytest.approx(500)  # the warm-up's: 1000
    assert opt4["ms"] == pytest.approx(500 * pixels / 1e6)
    assert opt4["tsc_cycles"] == pytest.approx(500 * pixels * 2.5)  # 2.5 GHz
    assert opt4["core_cycles_per_pixel"] == pytest.approx(2000)  # 4 GHz
    assert (opt4["tsc_hz"], opt4["core_hz"], opt4["core_hz_load"]) == (2.5e9, 4e9, 3.5e9)
    assert opt4["setup_ms"] == pytest.approx(0.02)
    assert opt4["setup_first_ms"] == pytest.approx(0.02 + 2 * 28.8)  # the warm-up frame is the first one
    assert opt4["present_ms"] == 1
    assert opt4["frames_per_s"] == pytest.approx(1000 / (28.8 + 1))
    shown = show.table([opt4], ladder_columns.WHOLE)
    texts = {column.name: text for column, (text, _) in zip(shown.columns, shown.cells[0], strict=True)}
    clocks = [texts[name] for name in ("timer", "core", "core under its vector load")]
    assert (texts["10⁶ timer cycles"], clocks) == ("72.00", ["2.500", "4.000", "3.500"])
    others = [texts[name] for name in ("set-up", "present", "frames/s with present")]
    assert others == ["0.0200", "1.00", "33.6"]


def test_speedups_are_ratios_of_medians_over_both_bases(run: Path) -> None:
    opt4, opt1 = row(run, "scene0", "opt4", 180), row(run, "scene0", "opt1", 180)
    assert (opt4["speedup_base"], opt4["speedup"]) == ("baseline", pytest.approx(32))
    assert opt4["speedup_low"] < 32 < opt4["speedup_high"]
    assert (opt4["same_flags_base"], opt4["speedup_same_flags"]) == ("opt2@opt3", pytest.approx(6.4))
    assert (opt1["same_flags_base"], opt1["speedup_same_flags"]) == ("opt2", pytest.approx(0.8))


def test_the_second_base_has_the_flags_that_all_of_a_phases_variants_share(run: Path) -> None:
    """-pthread changes no arithmetic, and what one variant adds is not what all have; another -m flag is."""
    avx2, wide = "-O3 -mavx2 -mfma -ffp-contract=off", "-mavx512f -mprefer-vector-width=512"
    edit(run, lambda f: f.update(flags=f"{avx2} -pthread {wide}") if f["phase"] == "opt4" else None)
    assert pd.isna(row(run, "scene0", "opt4", 180)["speedup_same_flags"])
    plan = json.loads((run / "plan.json").read_text())
    plan["phases"] = {"opt4": {"name": "opt4", "variants": [{"flags": wide}, {"flags": ""}]}}
    (run / "plan.json").write_text(json.dumps(plan))
    opt4 = row(run, "scene0", "opt4", 180)
    assert (opt4["same_flags_base"], opt4["speedup_same_flags"]) == ("opt2@opt3", pytest.approx(6.4))


def test_two_threads_are_beside_one_of_the_same_phase(run: Path) -> None:
    file = run / "frames.jsonl"
    frames = [json.loads(line) for line in file.read_text().splitlines()]
    both = [f | {"threads": 2, "ns": round(f["ns"] / 1.6)} for f in frames if f["phase"] == "opt4"]
    file.write_text("".join(json.dumps(f) + "\n" for f in frames + both))
    rows = rows_of(run)
    opt4 = rows[(rows["phase"] == "opt4") & (rows["height"] == 180)].set_index("threads")
    assert opt4.loc[2, "speedup"] == pytest.approx(32 * 1.6)  # over baseline's one thread
    assert math.isnan(opt4.loc[2, "implied"])  # the paper's value is of one thread
    assert opt4.loc[2, "over_one_thread"] == pytest.approx(1.6) and math.isnan(opt4.loc[1, "over_one_thread"])
    text = made_of(run, rows)["runtime"][1]
    assert text.count("| 1.60×") == len(opt4.loc[[2]]) * text.count("| opt4 | 2 |") > 0


def test_without_a_base_the_speedup_is_not_measured(run: Path) -> None:
    edit(run, lambda f: f["phase"] != "baseline" and f["flags_from"] != "opt3")
    opt3 = row(run, "scene0", "opt4", 180)
    assert opt3["speedup_base"] is None or pd.isna(opt3["speedup_base"])
    text = made_of(run, rows_of(run))["ladder"][1]
    assert "not measured" in text


def test_two_launches_are_insufficient_and_three_are_not(run: Path) -> None:
    assert row(run, "mandelbulb", "opt1", 90)["interval"] == "95 %"
    edit(run, third)
    opt1 = row(run, "mandelbulb", "opt1", 90)
    assert (opt1["launches"], opt1["interval"]) == (2, "insufficient")
    assert opt1["ms"] == pytest.approx(143.28)  # the mean of the first two
    assert math.isnan(opt1["ms_low"]) and math.isnan(opt1["speedup_low"])
    assert show.interval(opt1, "ms") == "143.3 insufficient"
    assert row(run, "mandelbulb", "opt2", 90)["interval"] == "95 %"


def test_the_headline_is_the_largest_size_with_the_most_phases(run: Path) -> None:
    assert ladder.headline_size(analysis.load(run), "scene0") == (320, 180)
    edit(run, lambda f: not (f["height"] == 180 and f["phase"] == "opt3"))
    data = analysis.load(run)
    assert ladder.headline_size(data, "scene0") == (160, 90)
    assert ladder.headline_size(data, "scene0", 180) == (320, 180)


def test_phases_and_scenes_stand_in_the_order_of_the_plan(run: Path) -> None:
    edit(run, lambda f: f.update(ns=f["ns"] * 1000) if f["phase"] == "opt4" else None)  # slow, and still last
    group = ladder.ladders(rows_of(run))
    assert list(group) == ["scene0", "mandelbulb"]
    assert list(group["scene0"]["phase"]) == ["baseline", "opt1", "opt2", "opt2@opt3", "opt3", "opt4"]
    (run / "plan.json").unlink()
    assert next(iter(ladder.ladders(rows_of(run)).values()))["phase"].iloc[0] == "opt4"  # now by pace


# Errors beside the speeds


def test_every_speed_has_its_error(run: Path) -> None:
    opt4, opt1 = row(run, "scene0", "opt4", 180), row(run, "scene0", "opt1", 180)
    assert (opt4["psnr_db"], opt4["psnr_display_db"], opt4["within_tolerance"]) == (56.9, 51.2, True)
    assert opt4["fraction_over_1_255"] == 0.0014
    assert show.gate(opt4) == "✓ within"
    assert math.isinf(opt1["psnr_db"]) and show.psnr(opt1, "psnr_db") == "identical"
    assert show.gate(row(run, "scene0", "baseline", 180)) == "reference"
    assert show.gate(row(run, "scene0", "opt2@opt3", 180)) == "not verified"


def test_a_phase_that_draws_the_ideal_shadow_is_held_against_the_ideal_picture(run, monkeypatch) -> None:
    """In the chapter's sentence, the figure, the front page; another phase against the paper's shadow."""
    rest = dict.fromkeys(("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm", "dt_p99"), 0.0)
    truth = {"scene": "scene0", "phase": "opt4", "height": 64, "converged_only": False, **rest}
    truth |= {"psnr_db": 45.3, "psnr_ideal_db": 129.0, "psnr_none_db": 140.0}
    complete.write(run / "accuracy.json", {"rows": [truth]})
    for ideal, sentence, short in (
        (False, "45.3 dB to ground truth", "45.3 dB"),
        (True, "129 dB to the ideal picture", "129 dB (ideal)"),
    ):
        monkeypatch.setattr(registry.Phase, "draws_ideal", property(lambda phase, ideal=ideal: ideal))
        opt4 = row(run, "scene0", "opt4", 180)
        assert chapter.to_truth(opt4) == sentence
        assert figures.truth_text(opt4) == short
        assert published_tables._cells({"scene0": opt4}, False)[1] == short.replace(" dB", "")


def test_a_mandelbulb_is_held_against_its_exact_surface_where_the_run_has_it(run: Path) -> None:
    march = {"scene": "mandelbulb", "phase": "opt4", "width": 80, "height": 45, "converged_only": True}
    march |= {"antialiased": {"psnr_db": 51.4, "psnr_ideal_db": 29.5}}
    proved = march | {"surface": {"psnr_db": 38.5, "antialiased": {"psnr_db": 42.8, "psnr_ideal_db": 29.4}}}
    for made, own, remark in ((march, 51.4, True), (proved, 42.8, False)):
        complete.write(run / "accuracy.json", {"rows": [made]})
        (one,) = ladder.truth_errors(analysis.load(run)).to_dict("records")
        assert (one["truth_own_db"], one["truth_psnr_db"]) == (own, 51.4)
        assert show.gone(one["truth_surface_db"]) is remark
        assert ("march" in figures.truth_text(one)) is remark
        assert ("march" in published_tables._cells({"mandelbulb": one | {"ms": 1.0}}, False)[-1]) is remark
    bare = ladder.rows(analysis.load(run)).drop(columns=[name for name in one if name.startswith("truth_")])
    block = published_tables.ladder_block(analysis.load(run), bare, pd.DataFrame([{**one, "run": "another"}]))
    assert "42.8" in next(line for line in block.splitlines() if "`opt4`" in line)
    assert "another" in block


BROKEN = {"psnr_db": None, "rmse": None, "fraction_over_1_255": None, "non_finite": 3}
BROKEN |= {"within_tolerance": False, "failed": ["non_finite", "psnr_db"]}
LEFT = {"within_tolerance": None, "left_to": "scripts/stepwise accuracy", "failed": [], "tolerance": {}}


@pytest.mark.parametrize(
    ("phase", "change", "failed", "mark"),
    [
        ("opt4", {}, "psnr_db", "bad"),
        ("opt2", BROKEN, "non_finite psnr_db", "bad"),
        ("opt2", {"failed": ["render"], "within_tolerance": False}, "render", "bad"),
        ("opt4", LEFT, "", ""),
    ],
)
def test_a_pair_that_fails_is_shown_failing_in_every_table(
    run: Path, phase: str, change: dict, failed: str, mark: str
) -> None:
    verify = store.read_json(run / "verify.json")
    for pair in verify["pairs"]:
        pair |= change if (pair["phase"], pair["scene"]) == (phase, "mandelbulb") else {}
    store.write_json(run / "verify.json", verify)
    found = row(run, "mandelbulb", phase, 90)
    assert show.gate_mark(found) == mark and show.gate(found).partition(": ")[2] == failed
    assert math.isnan(found["psnr_db"]) == (change == BROKEN)  # and not infinite
    made = made_of(run, rows_of(run))
    for name in ("verification", "ladder"):
        assert (f"✗ OUTSIDE: {failed} |" in made[name][1]) == (mark == "bad")


# Broken and missing input


@pytest.mark.parametrize("text", [None, ""])
def test_no_timed_frame_is_an_error_only_where_a_table_is_wanted(run: Path, text: str | None) -> None:
    edit(run, lambda frame: frame["warmup"])
    if text is None:
        (run / "frames.jsonl").unlink()
    with pytest.raises(StudyError):
        analysis.load(run, timed=True)
    data = analysis.load(run)
    assert ladder.rows(data).empty and len(data.notes) == 1


def test_errors_measured_without_a_sweep_are_exported(tmp_path: Path) -> None:
    """As `accuracy` and `verify` leave them in build/: a file, and no frames. An empty folder has nothing."""
    for name, table in (("accuracy.json", "accuracy"), ("verify.json", "verification")):
        folder = tmp_path / table
        folder.mkdir()
        store.write_json(folder / name, complete.published(name))
        done = emitted.ran("tables", folder)
        assert done.returncode == 0, done.stderr
        (known,) = (line for line in emitted.ran("tables", folder, "--json").stdout.splitlines())
        rows = json.loads(known)["result"][table]
        assert rows and len(rows) == len(pd.read_csv(folder / "tables" / f"{table}.csv"))
    done = emitted.ran("tables", tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and not (tmp_path / "tables").exists()
    assert emitted.ran("tables", tmp_path / "accuracy", "--readme").returncode == 2


def test_launches_stand_side_by_side_by_the_round_that_they_were_of(run: Path) -> None:
    """opt4 lost its third round: its third launch was made up for in the fourth, and so on."""

    def change(frame: dict) -> None:
        frame["round"] = frame["launch"] + (frame["phase"] == "opt4" and frame["launch"] >= 2)

    edit(run, change)
    data = analysis.load(run)
    base, made = (data.cell("scene0", spec, 180, 320) for spec in ("baseline", "opt4"))
    assert list(made.values.index) == [0, 1, 3, 4, 5, 6] and list(base.values.index) == [0, 1, 2, 3, 4, 5]
    times = [cell.values["ns"].to_numpy() for cell in (base, made)]
    by_round, by_order = made.over(base), stats.ratio_interval(*times)
    assert by_round.value == by_order.value and by_round.low != by_order.low
    said = {(r.spec, r.scene, r.height): r for r in summary.rows(data.frames)}
    assert said["opt4", "scene0", 180].speedup == by_round


def test_overridden_frames_and_old_scenes_are_left_out(run: Path) -> None:
    def change(frame: dict) -> None:
        if frame["launch"] == 0:
            frame.update(overridden=True, ns=1)
        elif frame["launch"] == 1 and frame["scene"] == "scene0":
            frame.update(scene_hash="older", ns=1)

    edit(run, change)
    data = analysis.load(run)
    assert sum("left out" in note for note in data.notes) == 2
    assert row(run, "scene0", "opt4", 180)["launches"] == 4


# Files and command line


@pytest.mark.slow
def test_files_are_complete_and_hold_the_same_rows(run: Path, stepwise) -> None:
    edit(run, third)
    done = stepwise("tables", run)
    assert done.returncode == 0, done.stderr
    folder = run / "tables"
    names = ("claims", "ladder", "paper", "runtime", "verification")
    files = {f"{name}.{ending}" for name in names for ending in ("csv", "json", "md")}
    assert {path.name for path in folder.iterdir()} == files
    from_csv = pd.read_csv(folder / "ladder.csv").set_index(["scene", "phase"])
    from_json = {(r["scene"], r["phase"]): r for r in json.loads((folder / "ladder.json").read_text())}
    assert len(from_csv) == len(from_json) == 12
    assert from_csv.loc[("scene0", "opt4"), "speedup"] == pytest.approx(32)
    assert from_json["scene0", "opt4"]["speedup"] == pytest.approx(32)
    assert from_json["mandelbulb", "opt1"]["ms_low"] is None
    text = (folder / "ladder.md").read_text()
    assert "32.0× [" in text and "| nan" not in text


def test_json_is_one_object_and_remarks_go_to_stderr(run: Path, tmp_path: Path, stepwise) -> None:
    (run / "verify.json").unlink()
    done = stepwise("tables", run, "-o", tmp_path / "out", "--json")
    assert set(emitted.result(done.stdout)) == {"claims", "ladder", "paper", "runtime", "files"}
    assert "verify.json is missing" in done.stderr
    assert not (run / "tables").exists()


@pytest.mark.slow
def test_bad_input_is_status_2_in_one_line(run: Path, tmp_path: Path, stepwise) -> None:
    for arguments in ((tmp_path / "nothing",), (run, "-n", 77)):
        done = stepwise("tables", *arguments)
        assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    (run / "frames.jsonl").write_text("")
    (run / "verify.json").unlink()
    assert stepwise("tables", run).returncode == 2


def test_readme_block_is_replaced_and_the_rest_kept(run: Path, tmp_path: Path, monkeypatch) -> None:
    data, page = analysis.load(run), tmp_path / "README.md"
    monkeypatch.setitem(tables.PAGES, "readme", (page, "ladder"))
    page.write_text("# Title\n<!-- ladder:begin -->\nlast week's\n<!-- ladder:end -->\nafter\n")
    made = tables.rewritten("readme", data, ladder.rows(data))
    before, _, rest = made.partition("<!-- ladder:begin -->\n")
    block, _, after = rest.partition("<!-- ladder:end -->\n")
    assert (before, after) == ("# Title\n", "after\n")
    assert "last week" not in block and "| [`opt4`](phases/opt4/NOTES.md) |" in block
    page.write_text(made)
    assert tables.rewritten("readme", data, ladder.rows(data)) == made
    page.write_text("# no marks\n")
    with pytest.raises(StudyError):
        tables.rewritten("readme", data, ladder.rows(data))


# The paper


def test_the_papers_tables_imply_28_and_not_32() -> None:
    theirs = paper.ladder().set_index(["scene", "phase"])
    assert theirs["implied"]["scene0", "opt4"] == pytest.approx(2.383 / 0.173 / (1 - 0.51))
    assert round(theirs["implied"]["scene0", "opt4"], 1) == 28.1
    assert theirs["stated"]["scene0", "opt4"] == 32.1
    assert round(theirs["implied"]["mandelbulb", "opt4"], 1) == 17.0
    rerun = theirs.loc[("scene0", "opt4"), ["rerun", "rerun_psnr_display_db", "rerun_psnr_db"]]
    assert list(rerun) == [19.6, 31.7, 30.1] and theirs["rerun_psnr_db"]["mandelbulb", "opt4"] == 27.5
    assert math.isinf(theirs["rerun_psnr_display_db"]["scene0", "opt1"])


@pytest.mark.parametrize(
    "path", sorted((ROOT / "results" / "paper").glob("*.csv")), ids=lambda path: path.stem
)
def test_every_number_of_the_paper_names_its_source(path: Path) -> None:
    table = pd.read_csv(path)
    assert len(table) and table["source"].notna().all()
    assert f"`{path.name}`" in (path.parent / "README.md").read_text()


def test_the_rerun_speedups_are_those_of_its_cycles() -> None:
    rerun = paper.read("rerun").set_index(["metric", "scene", "phase"])["value"]
    for (scene, phase), speedup in rerun["speedup"].items():
        ratio = rerun["tsc_cycles", scene, "baseline"] / rerun["tsc_cycles", scene, phase]
        assert ratio == pytest.approx(speedup, abs=0.06)


def test_the_papers_program_is_the_readmes_last_row(run: Path) -> None:
    """Our baseline takes 200 ms a launch, the paper's 250 and its opt4 20: 0.8 and 10 times."""
    base = {"phase": "baseline", "scene": "scene0", "n": 180, "psnr_display_db": None}
    base |= {"ours_launches_ms": [200.0] * 6, "theirs_launches_ms": [250.0] * 6}
    base |= {"ours_over_theirs": {"value": 0.8}}
    rows = [base, base | {"phase": "opt4", "theirs_launches_ms": [20.0] * 6, "psnr_display_db": 31.7}]
    complete.write(run / "original.json", {"rows": rows})
    made = published_tables.originals(run)
    assert made[0][3:6] == ["250.0 [250.0,\u00a0250.0]", "0.800× [0.800,\u00a00.800]", "as ours"]
    assert made[1][3:6] == ["20.00 [20.00,\u00a020.00]", "10.0× [10.0,\u00a010.0]", "31.7 to ours"]
    assert made[0][6:] == ["–"] * 3
    block = published_tables.ladder_block(analysis.load(run), rows_of(run))
    assert "| 32.0× [" in block
    assert block.index("the paper's baseline") < block.index("the paper's opt4") < block.index("320×180")


def test_the_readme_ends_on_the_two_strongest_other_programs(run: Path) -> None:
    """By both scenes together: 2·8 and 4·5 come before 3·9. What is wrong, or draws one scene, is none."""
    both = ("scene0_plain", "mandelbulb_plain")
    times = {"slow": (3, 9), "second": (4, 5), "first": (2, 8), "wrong": (1, 1), "half": (1, None)}
    rows = []
    for name, ratios in times.items():
        for scene, ratio in zip(both, ratios, strict=True):
            interval = {"value": ratio, "low": ratio, "high": ratio, "launches": 6, "sufficient": True}
            row = {"program": name, "kind": "peer", "scene": scene, "threads": 1, "beside": "opt10_scene"}
            row |= {"ms": interval, "ratio": interval, "rmse": 0.01}
            row |= {"psnr_db": 30.0 if name == "wrong" else 60.0}
            rows += [row] * bool(ratio)
    fastest = rows[0] | {"ratio": rows[0]["ratio"] | {"value": 0.1}}
    rows += [fastest | {"program": "second", "threads": 2}, fastest | {"program": "opt4", "kind": "phase"}]
    told = [{"program": name, "least_db": dict.fromkeys(both, 50.0)} for name in times]
    complete.write(run / "peers.json", {"n": 180, "programs": told, "rows": rows})
    found = published_tables.strongest(run, 180)
    assert [cells[0] for cells in found] == ["first", "second"]
    assert found[0][4].startswith("2.00× [2.00,\u00a02.00] ") and found[1][8] == "60.0"
    assert published_tables.strongest(run, 720) == []


PUBLISHED = sorted(file.parent for file in (ROOT / "results" / "reference").glob("*/context.json"))


@pytest.mark.slow
@pytest.mark.parametrize("folder", PUBLISHED, ids=lambda folder: folder.name)
def test_a_published_run_says_what_made_it_and_has_tables(folder: Path) -> None:
    said = tomllib.loads((folder / "run.toml").read_text(encoding="utf-8"))
    assert set(said) == {"machine", "compiler", "time", "commit", "commands", "caveat"} and said["commands"]
    data = analysis.load(folder)
    made = tables.make(ladder.rows(data), experiment.sections(data))
    assert "ladder" in made
    assert (
        not (folder / "tables").exists() and f"`{folder.name}`" in (folder.parent / "README.md").read_text()
    )
