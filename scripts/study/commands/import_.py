"""Reads times of other tools into runs, or the paper's scene files into scenes.

Of JSON files with times each becomes a run, which compare, --history, --export and the report read. A
sample is google/benchmark's repetition, hyperfine's launch, or pyperf's worker process. Aggregates, warm-ups
and calibrations are left out; what failed or was skipped is named.

Of a scene file of the paper's program, what its program has compiled in (fog, the march's limits, soft
shadows) is as on its branch master. The size of its picture is no part of a scene here: the last line says
it as options of `render`.
"""

import argparse
from pathlib import Path
from typing import Any

from study.core import json_files, store
from study.core.cli import Outcome, StudyError
from study.measuring import foreign, paper_scenes
from study.numbers import analysis, programs, summary

KINDS = "JSON of google/benchmark, hyperfine or pyperf, or a scene of the paper's program (scenes/*.json)"


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("files", type=Path, nargs="+", metavar="FILE", help=KINDS)
    add("-o", "--out", type=Path, metavar="PATH", help="of a scene; default: FILE's name in this folder")
    about = "parent of the runs' folders; default: results"
    add("--results", type=Path, default=store.RESULTS, metavar="DIR", help=about)


def scene(path: Path, wanted: Path | None) -> Outcome:
    theirs = paper_scenes.read(path)
    out = wanted or Path(path.name)
    if out.exists() and (not wanted or out.samefile(path)):
        raise StudyError(f"{out}: is there already; -o names another file")
    made = paper_scenes.converted(theirs, path)
    store.write_json(out, made)
    wide, high = theirs.camera.width, theirs.camera.height
    result = {"schema": 1, "scene": out, "width": wide, "height": high}
    return Outcome(result, [f"{out}: {len(made['shapes'])} shapes; -n {high} -w {wide}"])


def times(files: list[Path], contents: list[Any], results: Path) -> Outcome:
    """Nothing is written before all files are read."""
    every = [foreign.read(path, content) for path, content in zip(files, contents, strict=True)]
    told, lines, remarks = [], [], []
    for path, found in zip(files, every, strict=True):
        run = foreign.written(found, path, results)
        plan = run.plan
        rows = programs.rows(analysis.cells_of(run.frames(), plan), plan)
        left = {"skipped": found.skipped, "failures": found.failures, "remarks": found.remarks}
        told.append({"file": path, "tool": found.tool, "run": run.path, "rows": rows} | left)
        lines += [f"{path}, of {found.tool}", summary.table(rows, programs.COLUMNS), run.path, ""]
        remarks += [f"skipped: {one.spec}: {one.reason}" for one in found.skipped]
        remarks += [f"failed: {one.spec}: {one.message}" for one in found.failures]
        remarks += [*found.remarks, *programs.remarks(rows)]
    return Outcome({"runs": told}, lines, told[0]["run"] if len(told) == 1 else None, remarks)


def run(args: argparse.Namespace) -> Outcome:
    contents = [json_files.read_json(path) for path in args.files]
    if len(contents) == 1 and isinstance(contents[0], dict) and "geometric_objects" in contents[0]:
        return scene(args.files[0], args.out)
    for path, content in zip(args.files, contents, strict=True):
        if not foreign.reader(content):
            raise StudyError(f"{path}:1: of none of these: {KINDS}, scenes one at a time")
    if args.out:
        raise StudyError("-o names a scene; runs get a folder below --results")
    return times(args.files, contents, args.results)
