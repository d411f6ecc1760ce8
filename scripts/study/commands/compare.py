"""Two runs or machines side by side: what got slower, what faster, and what differs between them."""

from __future__ import annotations

import argparse
from typing import Any

import pandas as pd

from study.core import cli, provenance
from study.core.cli import StudyError
from study.core.store import Run
from study.experiments.sweep import summary
from study.numbers import stats

DESCRIPTION = """\
Compares the times of two runs, configuration by configuration: ratio of the medians A / B (over 1: B is
faster) with a 95 % bootstrap interval over launches. Slower or faster means that the interval excludes 1; of
forty configurations that did not change, two will by chance, and more where the machine's hour changed
between the runs, which no interval of launches knows. Scenes and limits must be the same."""
KEY = ["scene", "width", "height", "threads", "spec"]
LIMITS = ["hit_distance", "max_steps"]
COLUMNS = [("spec", "phase"), ("scene", "scene"), ("size", "size"), ("threads", "threads")]
COLUMNS += [("a_ms", "A ms [95 %]"), ("b_ms", "B ms [95 %]"), ("ratio", "A / B [95 %]"), ("verdict", "B is")]
CONTEXT = ("compiler", "libc", "kernel", "system", "hypervisor", "governor", "no_turbo", "memory_kib")
CONTEXT_PARTS = {
    "cpu": ("model", "microarchitecture", "stepping", "microcode", "logical_cpus"),
    "git": ("commit", "dirty", "diff_sha256"),
}


def check_scenes(a: pd.DataFrame, b: pd.DataFrame) -> None:
    """StudyError for a scene that both runs have, but not with the same limits and content."""
    for scene in sorted(set(a["scene"]) & set(b["scene"])):
        for column in [*LIMITS, "scene_hash"]:
            ours, theirs = (set(frames.loc[frames["scene"] == scene, column]) for frames in (a, b))
            if ours != theirs:
                values = " and ".join(", ".join(map(str, sorted(each))) for each in (ours, theirs))
                raise StudyError(f"{scene}: {column} differs ({values}); only the same work can be compared")


def rows(a: pd.DataFrame, b: pd.DataFrame) -> list[dict[str, Any]]:
    """One row per configuration of both runs: a_ms, b_ms, ratio (Interval), verdict."""
    check_scenes(a, b)
    ours, theirs = (dict(list(stats.launch_values(frames, "ns").groupby(KEY))) for frames in (a, b))
    found = []
    for key in ours.keys() & theirs.keys():
        times = [group["value"].to_numpy(float) for group in (ours[key], theirs[key])]
        ratio = stats.ratio_interval(*times, rounds=False)  # two runs have none in common
        verdict = "the same within noise" if ratio.sufficient else "unknown (too few launches)"
        if stats.distinguishable(*times, rounds=False):
            verdict = "faster" if ratio.low > 1 else "slower"
        found.append(
            dict(zip(KEY, key, strict=True))
            | {"size": f"{key[1]}x{key[2]}", "ratio": ratio, "verdict": verdict}
            | {name: stats.median_interval(t / 1e6) for name, t in zip(("a_ms", "b_ms"), times, strict=True)}
        )
    return sorted(found, key=lambda row: [row[key] for key in KEY])


def facts(run: Run, frames: pd.DataFrame) -> dict[str, Any]:
    """What may explain a difference: from the context, and flags and compiler of each spec."""
    context = run.context
    found = {name: context.get(name) for name in CONTEXT}
    for part, names in CONTEXT_PARTS.items():
        found |= {f"{part}.{name}": (context.get(part) or {}).get(name) for name in names}
    for (spec, flags, compiler, libc), _ in frames.groupby(["spec", "flags", "compiler", "libc"]):
        found[f"build of {spec}"] = f"{compiler}, glibc {libc}, {flags}"
    return found


def differences(a: dict[str, Any], b: dict[str, Any]) -> dict[str, list[Any]]:
    """Facts that both have and that are not the same: name -> [A, B]."""
    return {name: [a[name], b[name]] for name in a if name in b and a[name] != b[name]}


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "something is slower in B (with --fail-on-slower)"})
    parser.add_argument("a", metavar="RUN_A", help="folder of a run, the base")
    parser.add_argument("b", metavar="RUN_B", help="folder of the run to judge")
    parser.add_argument("--fail-on-slower", action="store_true", help="status 1 if something got slower")
    return parser.parse_args()


def main() -> int:
    options = arguments()
    runs = [Run.open(path) for path in (options.a, options.b)]
    frames = [run.frames() for run in runs]
    for run, each in zip(runs, frames, strict=True):
        if run.context is None:
            raise StudyError(f"{run.path / 'context.json'}: should be a JSON object")
        provenance.check(run.context, run.path / "context.json")
        if each.empty or each["warmup"].all():
            raise StudyError(
                f"{run}: no timed frame; measure with scripts/stepwise sweep --run {run} --resume"
            )
    found = rows(*frames)
    if not found:
        raise StudyError(f"{runs[0]} and {runs[1]} have no phase, scene and size in common")
    names = [{" ".join(map(str, key)) for key in each[KEY].itertuples(index=False)} for each in frames]
    only = {"only_a": sorted(names[0] - names[1]), "only_b": sorted(names[1] - names[0])}
    differ = differences(*(facts(run, each) for run, each in zip(runs, frames, strict=True)))
    if options.json:
        paths = {"a": str(runs[0]), "b": str(runs[1])}
        cli.emit(paths | {"rows": found, "differences": differ} | only)
    else:
        print(f"A: {runs[0]}\nB: {runs[1]}\n")
        print(summary.table(found, COLUMNS))
        for letter, missing in zip("AB", only.values(), strict=True):
            for name in missing:
                print(f"only in {letter}: {name}")
        print("\nwhat differs" if differ else "\nmachine, compiler and commit are the same")
        for name, (ours, theirs) in differ.items():
            print(f"  {name}\n    A  {ours}\n    B  {theirs}")
    slower = any(row["verdict"] == "slower" for row in found)
    return cli.FAILED if options.fail_on_slower and slower else cli.OK
