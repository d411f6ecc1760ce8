"""Files of other tools become runs: what counts as a sample, in ns, and what is said of the rest."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import emitted
import numpy as np
import pytest
from compared import run as compare

from study.core import commands, json_files
from study.core.cli import Outcome, StudyError
from study.core.store import Run
from study.numbers import analysis

pytestmark = pytest.mark.usefixtures("few_resamples")


def repetition(name: str, time: float, unit: str = "ns", **more: Any) -> dict[str, Any]:
    about = {"name": name, "run_name": name, "run_type": "iteration", "iterations": 10, "threads": 1}
    return about | {"real_time": time, "cpu_time": time / 2, "time_unit": unit} | more


def aggregate(name: str, kind: str, time: float, **more: Any) -> dict[str, Any]:
    about = {"name": f"{name}_{kind}", "run_type": "aggregate", "aggregate_name": kind}
    return repetition(name, time) | about | more


ABOUT = {"date": "2026-02-03T05:00:00+02:00", "host_name": "box", "num_cpus": 4, "json_schema_version": 1}
GOOGLE = {
    "context": ABOUT,
    "benchmarks": [
        *(repetition("BM_Mix/64", time) for time in (0.31, 0.33, 0.32, 0.3, 0.35, 0.34)),
        aggregate("BM_Mix/64", "mean", 0.325),
        aggregate("BM_Mix/64", "cv", 0.05, aggregate_unit="percentage"),
        repetition("BM_Gone", 0.0, skipped=True, skip_message="no such file"),
        repetition("BM_Bad", 0.0, error_occurred=True, error_message="out of memory"),
        *(repetition("BM_Long", time, "ms") for time in (20, 22, 21)),
        *(repetition("BM_Hour", time, "s") for time in (3600,)),
    ],
}
HYPERFINE = {
    "results": [
        {"command": "sort -n a", "mean": 0.11, "user": 0.1, "times": [0.1, 0.12], "exit_codes": [0, 0]},
        {"command": "mm 8", "times": [0.5, 0.25], "exit_codes": [0, 1], "parameters": {"n": "8"}},
        {"command": "mm 9", "times": [2.5, 9.0], "exit_codes": [0, None], "parameters": {"n": "9"}},
        {"command": "true", "times": [0.001, 0.0], "exit_codes": [0, 0]},  # its shell took longer
        {"command": "sort -n a", "times": [0.2], "memory_usage_byte": [4096], "exit_codes": [0]},
    ]
}
PYPERF = {
    "version": "1.0",
    "metadata": {"name": "sum", "unit": "second", "cpu_model_name": "Some CPU", "cpu_count": 4},
    "benchmarks": [
        {
            "runs": [
                {"warmups": [[1, 5e-6], [2, 4e-6]], "metadata": {"date": "2026-02-03 04:05:06.5"}},
                {"warmups": [[2, 9e-6]], "values": [2e-6, 3e-6, 2.5e-6]},
                {"warmups": [[2, 9e-6]], "values": [2e-6, 2.25e-6, 4e-6]},
            ]
        },
        {"metadata": {"name": "sum, memory", "unit": "byte"}, "runs": [{"values": [8192.0, 8192.0]}]},
    ],
}


def written(folder: Path, content: Any, name: str = "times.json") -> Path:
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
    return path


def imported(folder: Path, *contents: Any) -> Outcome:
    files = [written(folder, content, f"times{i}.json") for i, content in enumerate(contents)]
    return commands.called("import", [*files, "--results", folder / "results"])[0]


def samples(path: Path) -> dict[tuple[str, str], list[float]]:
    """Program and case → ns, a value a sample."""
    cells = analysis.cells_of(Run.open(path).frames())
    return {(cell.spec, cell.scene): cell.values.ns.tolist() for cell in cells}


def test_google_benchmarks_repetitions_are_samples_and_its_aggregates_are_none(tmp_path) -> None:
    done = imported(tmp_path, GOOGLE)
    ms = {("BM_Long", ""): [2e7, 2.2e7, 2.1e7], ("BM_Hour", ""): [3.6e12]}
    assert samples(done.run) == {("BM_Mix/64", ""): [0.31, 0.33, 0.32, 0.3, 0.35, 0.34]} | ms
    run = Run.open(done.run)
    assert [(one.spec, one.reason) for one in run.plan.skipped] == [("BM_Gone", "no such file")]
    assert [(one.spec, one.message) for one in run.plan.failures] == [("BM_Bad", "out of memory")]
    assert all(any(name in line for line in done.remarks) for name in ("BM_Gone", "BM_Bad"))
    assert (run.context.time, run.context.cpu.logical_cpus) == ("2026-02-03T03:00:00+00:00", 4)


def test_an_old_file_of_google_benchmark_says_aggregates_by_name_alone(tmp_path) -> None:
    names = ("BM_x", "BM_x", "BM_x_mean", "BM_x_stddev", "BM_y_min")
    rows = [{"name": name, "real_time": 5, "time_unit": "us"} for name in names]
    done = imported(tmp_path, {"context": {}, "benchmarks": rows})
    assert samples(done.run) == {("BM_x", ""): [5000, 5000], ("BM_y_min", ""): [5000]}


def test_hyperfines_launches_have_their_parameters_and_exit_codes(tmp_path) -> None:
    done = imported(tmp_path, HYPERFINE)
    assert samples(done.run) == {
        ("sort -n a", ""): pytest.approx([1e8, 1.2e8]),
        ("mm 8", "n=8"): pytest.approx([5e8, 2.5e8]),
        ("mm 9", "n=9"): pytest.approx([2.5e9]),
        ("sort -n a (2)", ""): pytest.approx([2e8]),  # not its memory
    }
    frames = Run.open(done.run).lines()
    assert [one.exit_status for one in frames] == [0, 0, 0, 1, 0, 0]
    assert [(one.spec, one.launch) for one in Run.open(done.run).plan.failures] == [("mm 9", 1)]
    assert [one.spec for one in Run.open(done.run).plan.skipped] == ["true"]
    assert sorted(line.count("mm") for line in done.remarks) == [0, 1, 1]


def test_pyperfs_values_are_of_their_process_without_warm_up_and_calibration(tmp_path) -> None:
    done = imported(tmp_path, PYPERF)
    frames = Run.open(done.run).lines()
    assert [(one.launch, one.frame) for one in frames] == [(i, k) for i in range(2) for k in range(3)]
    assert [one.ns for one in frames] == pytest.approx([2000, 3000, 2500, 2000, 2250, 4000])
    assert samples(done.run) == {("sum", ""): pytest.approx([2500, 2250])}  # medians of each
    assert len(done.remarks) == 1 and "byte" in done.remarks[0] and "sum, memory" in done.remarks[0]
    context = Run.open(done.run).context
    assert (context.cpu.model, context.time) == ("Some CPU", "2026-02-03T04:05:06+00:00")


def timed(factor: float, date: str) -> dict[str, Any]:
    times = factor * (1 + 0.01 * np.random.default_rng(1).standard_normal(8))
    rows = [repetition("BM_Mix", time, "us") for time in times]
    return {"context": ABOUT | {"date": date}, "benchmarks": rows}


def test_compare_history_and_export_read_them(tmp_path) -> None:
    both = (timed(3, "2026-02-03T00:00:00+00:00"), timed(4, "2026-02-04T00:00:00+00:00"))
    done = imported(tmp_path, *both)
    paths = [one["run"] for one in done.result["runs"]]
    (row,) = emitted.result(compare(*paths, "--json").stdout)["rows"]
    assert (row["spec"], row["verdict"]) == ("BM_Mix", "slower") and row["time"]["value"] == pytest.approx(
        3 / 4
    )
    assert compare(*paths, "--fail-on-slower").returncode == 1
    points = emitted.result(compare("--history", "BM_Mix", "--json", tmp_path / "results").stdout)["points"]
    assert [(one["made"], one["step"]) for one in points] == [
        ("2026-02-03T00:00", False),
        ("2026-02-04T00:00", True),
    ]
    (entry,) = json.loads(compare("--export", "github-action-benchmark", paths[1]).stdout)
    assert (entry["name"], entry["unit"]) == ("BM_Mix", "ms") and entry["value"] == pytest.approx(
        0.004, rel=0.02
    )


def test_what_an_imported_run_does_not_know_does_not_differ(tmp_path) -> None:
    (one,) = imported(tmp_path, timed(3, "2026-02-03T00:00:00+00:00")).result["runs"]
    measured = Path(shutil.copytree(one["run"], tmp_path / "measured"))
    for file, known in (("context", {"kernel": "6.1"}), ("plan", {"read_from": []})):
        path = measured / f"{file}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | known))
    assert emitted.result(compare(one["run"], measured, "--json").stdout)["differences"] == {}


def changed(content: Any, at: list[Any], value: Any) -> Any:
    """A copy with another value there."""
    made = json.loads(json.dumps(content))
    inner = made
    for step in at[:-1]:
        inner = inner[step]
    inner[at[-1]] = value
    return made


@pytest.mark.parametrize(
    ("content", "marked"),  # the line that holds it
    [
        (json.dumps(GOOGLE, indent=1).replace("0.33,", "0.33", 1), '"cpu_time": 0.165'),
        (changed(GOOGLE, ["benchmarks", 2, "real_time"], "soon"), '"soon"'),
        (changed(GOOGLE, ["benchmarks", 2, "real_time"], -7.5), "-7.5"),
        (changed(GOOGLE, ["benchmarks", 3, "time_unit"], "hours"), '"hours"'),
        (changed(GOOGLE, ["benchmarks", 1], {"name": "BM_None"}), '"BM_None"'),
        (changed(HYPERFINE, ["results", 1, "times", 1], float("nan")), "NaN"),
        (changed(HYPERFINE, ["results", 2, "times"], "fast"), '"fast"'),
        (changed(PYPERF, ["benchmarks", 0, "runs", 2, "values", 1], 0), " 0,"),
        (changed(PYPERF, ["benchmarks", 0, "runs", 1, "values"], [None]), "null"),
        ({"context": {}, "benchmarks": []}, "{"),
        (changed(PYPERF, ["metadata", "unit"], "byte"), "{"),
        ({"some": "other file"}, "{"),
        ([1, 2], "["),
        ("", ""),
    ],
)
def test_a_broken_file_is_one_line_with_file_and_line(tmp_path, content, marked) -> None:
    """And nothing is written, of the whole file before it neither."""
    good = written(tmp_path, GOOGLE, "good.json")
    bad = written(tmp_path, content, "bad.json")
    lines = bad.read_text().splitlines()
    number = next((n for n, line in enumerate(lines, 1) if marked in line), 1)
    if marked == '"BM_None"':
        number -= 1  # its row begins there
    done = emitted.ran("import", good, bad, "--results", tmp_path / "results")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert f"{bad}:{number}:" in done.stderr
    assert not (tmp_path / "results").exists()


def test_bytes_that_are_no_text_are_in_a_line(tmp_path) -> None:
    path = tmp_path / "bad.json"
    path.write_bytes(b'{"results":\n "\x81"}')
    with pytest.raises(StudyError, match=f"^{re.escape(str(path))}:2: "):
        json_files.read_json(path)


def test_the_line_of_a_value(tmp_path) -> None:
    path = written(tmp_path, '\n{"a": [1,\n [2, "]"],\n 3],\n "b}": {}, "c":\n {"d": 4}}\n')
    where = {"$": 2, "$.a": 2, "$.a[1]": 3, "$.a[1][1]": 3, "$.a[2]": 4, "$.c": 6, "$.c.d": 6, "$.a[9]": 2}
    assert {each: json_files.line(path, each) for each in where} == where
