"""What bounds the hot code: Table 3 of the paper, a top-down split by the PMU where there is one, or a model.

The model takes the regions of the shipped code that samples fall into (innermost loops, and what is in no
loop, per function: bounds.regions), and asks two static analysers (bounds.analysers) what their instructions
need.

It sees a region as a straight line, every load a hit in L1, every branch known and every instruction there
in time: no front end, no branch misses, no cache, nothing of what a call does inside or of what the line's
branches would leave out. Retiring, core and memory are therefore of the cycles that the model knows.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from study.bounds import analysers
from study.bounds.profiles import Profile
from study.bounds.regions import LEAST, assembly, regions
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.counting.elf import Program

LEAST_OSACA = 0.05  # the same for OSACA, which takes seconds

Row = dict[str, Any]


PMU_NAMES = {
    "retiring": "retiring",
    "bad speculation": "bad_speculation",
    "front-end bound": "front_end",
    "back-end bound": "back_end",
    "memory bound": "memory",
    "core bound": "core",
}


def topdown(spec: Spec, scene: Scene, height: int, width: int | None = None) -> Row | None:
    """The split by the PMU where there is one: shares of the pipeline's slots; `remark` of it."""
    try:
        pmu = importlib.import_module("study.counting.pmu")
    except ImportError:
        return None
    if not pmu.available()[0]:
        return None
    wide, high = scene.size(height, width)
    reading = pmu.read_frame(spec, scene.path, high, wide)
    if not reading.topdown:
        return None
    split = {PMU_NAMES[key]: share for key, share in reading.topdown.items() if key in PMU_NAMES}
    return {"split": split, "remark": f"PMU: {reading.remark}"}


def _modelled_regions(
    profile: Profile, built: Program, cpu: str | None, archs: Sequence[str], say: Callable[[str], None]
) -> list[Row]:
    """The regions that hold time, by llvm-mca for `cpu` (None: not) and by OSACA with one of `archs`.

    What an analyser refuses is said once, with the number of its regions and their share of the time.
    """
    rows, arch = [], None
    refused: dict[str, list[float]] = {}  # error → shares
    for region in regions(profile, built):
        if region.share < LEAST:
            break
        text = assembly(region.lines)
        row: Row = {
            "region": region.name,
            "function": region.function,
            "loop": region.loop,
            "share": region.share,
            "instructions": sum(line.startswith("\t") for line in text.splitlines()),
            "calls": sum(line.is_call for line in region.lines),
        }
        try:
            if cpu and row["instructions"]:
                mca = analysers.run_mca(text, cpu)
                row["mca"] = {**vars(mca), "split": mca.split}
            if archs and row["instructions"] and region.share >= LEAST_OSACA:
                arch = arch or analysers.osaca_arch(text, archs)
                row["osaca"] = vars(analysers.run_osaca(text, arch))
        except StudyError as error:
            refused.setdefault(str(error), []).append(region.share)
        rows.append(row)
    for error, shares in refused.items():
        say(f"{profile.spec}: {error} ({len(shares)} of {len(rows)} regions, {sum(shares):.0%} of the time)")
    return rows


def model(
    profile: Profile,
    built: Program,
    instructions: Mapping[str, int] | None = None,
    say: Callable[[str], None] = lambda line: None,
    processor: analysers.Processor | None = None,
    osaca: bool = True,
) -> Row:
    """The modelled split of a shipped build's samples, and its hot regions.

    `instructions`: of one frame by function of the program, counted; without them no time is predicted.
    `osaca` False leaves it out (it takes seconds a region). Missing tools are said and left out.
    """
    processor = processor or analysers.this_processor()
    for lacking in (analysers.mca_missing(), analysers.osaca_missing() if osaca else None):
        if lacking:
            say(lacking)
    cpu, remark = None, None
    if found := analysers.mca_program():
        cpu, remark = analysers.mcpu(processor, found[1])
    archs = analysers.OSACA_ARCH[processor.name] if osaca and analysers.osaca_missing() is None else []
    rows = _modelled_regions(profile, built, cpu, archs, say)
    modelled = [row for row in rows if "mca" in row]
    covered = sum(row["share"] for row in modelled)
    split = (
        {
            name: sum(row["share"] * row["mca"]["split"][name] for row in modelled) / covered
            for name in ("retiring", "memory", "core", "ports", "dependencies")
        }
        if covered
        else None
    )
    return {
        "phase": profile.phase,
        "flags_from": profile.flags_from,
        "scene": profile.scene,
        "width": profile.width,
        "height": profile.height,
        "by": "model",
        "processor": processor.name,
        "model": f"llvm-mca {found[1]} -mcpu={cpu}" if found else None,
        "remark": remark,
        "covered": covered,
        "split": split,
        "cpu_ns": profile.cpu_ns,
        "samples": profile.samples,
        **_prediction(profile, modelled, instructions),
        "regions": _measured(profile, rows, instructions),
    }


def _rate(rows: Iterable[Row], bound: str) -> float:
    """Instructions per cycle of regions together, where each has its share of the time."""
    rows = list(rows)
    share = sum(row["share"] for row in rows)
    return sum(row["share"] * row["instructions"] / row["mca"][bound] for row in rows) / share


def _prediction(profile: Profile, rows: Sequence[Row], counted: Mapping[str, int] | None) -> Row:
    """Cycles of the modelled functions by the model and as measured, and instructions per cycle. Counted
    instructions are needed for both; functions whose regions were modelled to under nine tenths are left out.
    """
    if not counted:
        return {"compared": None}
    cycles = {"throughput": 0.0, "latency": 0.0, "measured": 0.0}
    share = 0.0
    for function in dict.fromkeys(row["function"] for row in rows):
        here = [row for row in rows if row["function"] == function]
        if function not in counted or not counted[function]:
            continue
        mine = sum(row["share"] for row in here)
        for bound in ("throughput", "latency"):
            cycles[bound] += counted[function] / _rate(here, bound)
        cycles["measured"] += mine * profile.core_cycles
        share += mine
    if not share:
        return {"compared": None}
    return {"compared": {"share": share, **cycles}}


def _measured(profile: Profile, rows: Sequence[Row], counted: Mapping[str, int] | None) -> list[Row]:
    """Adds to each region the measured cycles of a pass: its function's cycles per counted instruction times
    its instructions. Right where the function's regions run at one rate; left out without counts.
    """
    made = []
    for row in rows:
        mine = sum(other["share"] for other in rows if other["function"] == row["function"])
        count = (counted or {}).get(row["function"])
        cycles = mine * profile.core_cycles / count * row["instructions"] if count else None
        made.append(row | {"measured": cycles})
    return made
