"""A run's files, read for analysis: the timed frames by configuration and launch, and the verified pairs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from operator import attrgetter
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd

from study.core import store
from study.core.cli import StudyError
from study.core.registry import Phase, arithmetic_flags
from study.core.run_schema import Context, PhaseJson, Plan
from study.numbers import clocks, stats
from study.numbers.schema import Pair, Verify
from study.numbers.stats import Interval

SHARE_BESIDE = {
    "psnr_db": "fraction_over_1_255",
    "psnr_display_db": "fraction_over_1_255_display",
    "antialiased_psnr_db": "antialiased_fraction_over_1_255",
}
KEYS = ["scene", "spec", "width", "height", "threads"]
SIMDE = "SIMDe"  # in the instruction set of a frame (common/build/phase_info.py)
MEDIANS = ["core_hz_load", "kernel_compile_ns", "joules", "ns", "tsc_cycles", "core_cycles", "core_hz"]
MEDIANS += ["tsc_hz", "present_ns", "presented_ns", "prepare_ns", "max_rss_kib", "instructions"]
MEDIANS += ["user_ns", "system_ns", "unused_ns", "ctx_voluntary", "ctx_involuntary"]
SECOND_BASE = "opt2"
GENERATED = "generated"  # a frame's `kernel` where code generated for its scene ran


@dataclass(frozen=True)
class Facts:
    """How a configuration was built and run, of its last frame. `kernel`: of all launches (kernel_said)."""

    isa: str | None = None
    precision: str | None = None
    lanes: int | None = None
    flags: str | None = None
    compiler: str | None = None
    libc: str | None = None
    hit_distance: float | None = None
    max_steps: int | None = None
    kernel: str | None = None
    algorithm: str | None = None
    unwarmed: bool = False


@dataclass(frozen=True)
class Cell:
    """One configuration. `values`: a row per launch (medians of its timed frames, whose number is `frames`),
    its index the rounds that they were of, NaN in older files; times in ns, NaN where a clock was not read.
    """

    scene: str
    spec: str
    width: int
    height: int
    threads: int
    facts: Facts
    values: pd.DataFrame
    config: str = ""
    scene_hash: str = ""

    @property
    def phase(self) -> str:
        return self.spec.partition("@")[0]

    @property
    def picture(self) -> tuple[str, int, int]:
        return self.scene, self.width, self.height

    @property
    def pixels(self) -> int:
        return self.width * self.height

    def median(self, column: str) -> Interval:
        return stats.median_interval(self.values[column])

    def over(self, base: Cell) -> Interval:
        return stats.ratio_interval(base.values.ns, self.values.ns)


@dataclass(frozen=True)
class Data:
    """A run as far as its files are there; `notes` has a sentence for each thing that is not."""

    path: Path
    context: Context
    plan: Plan
    frames: pd.DataFrame
    cells: list[Cell]
    pairs: list[Pair]
    notes: list[str]
    height: int | None = None  # of the ladder's pictures; None: the best measured
    kept: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)  # worked out once, by name

    @property
    def by_simde(self) -> list[str]:
        """Programs whose AVX2 code ran as NEON's by SIMDe, as their own frames say."""
        return list(dict.fromkeys(cell.spec for cell in self.cells if SIMDE in (cell.facts.isa or "")))

    def cell(self, scene: str, spec: str, height: int, width: int, threads: int = 1) -> Cell | None:
        wanted = (scene, spec, height, width, threads)
        return next(
            (c for c in self.cells if (c.scene, c.spec, c.height, c.width, c.threads) == wanted), None
        )


def load(path: Path | str | None, timed: bool = False) -> Data:
    """The run in `path`, by default the newest one; what is missing is left empty and named in `notes`.
    Raises StudyError for a broken file and, where the run must be `timed`, without a timed frame."""
    run = store.Run(Path(path)) if path else store.latest()
    if not run.path.is_dir():
        raise StudyError(f"{run.path}: no such run; a run is a folder like results/MACHINE/RUN")
    context = Context.load_if_there(run.path / "context.json")
    plan = Plan.load_if_there(run.path / "plan.json")
    verify = Verify.load_if_there(run.path / "verify.json")
    notes = [
        f"{name} is missing: {without}."
        for found, name, without in (
            (context, "context.json", "the machine and the commit are unknown"),
            (plan, "plan.json", "what was to be measured is unknown"),
            (verify, "verify.json", "no error stands beside the speeds; run scripts/stepwise verify"),
        )
        if found is None and not (name == "verify.json" and plan and plan.programs)
    ]
    frames = _usable(run, notes)
    if frames.empty:
        notes.append("frames.jsonl has no timed frame: there are no speeds; run scripts/stepwise sweep.")
        if timed:
            raise StudyError(f"{run.path}: no timed frame in frames.jsonl; run scripts/stepwise sweep first")
    plan = plan or Plan()
    pairs = (verify.pairs if verify else None) or []
    return Data(run.path, context or Context(), plan, frames, cells_of(frames, plan), pairs, notes)


def _usable(run: store.Run, notes: list[str]) -> pd.DataFrame:
    """Frames that belong in a ladder: with the scene's own parameters, and of its latest version."""
    frames = run.frames()
    if frames.empty:
        return frames
    if "overridden" in frames and (changed := frames.overridden.fillna(False).astype(bool)).any():
        notes.append(f"{int(changed.sum())} frames with changed scene parameters are left out.")
        frames = frames[~changed]
    last = frames.groupby("scene").scene_hash.transform("last")
    if (stale := frames.scene_hash != last).any():
        notes.append(f"{int(stale.sum())} frames of an older version of their scene are left out.")
        frames = frames[~stale]
    return frames if (~frames.warmup.astype(bool)).any() else frames.iloc[:0]


def described(plan: Plan) -> dict[str, PhaseJson]:
    """Phase → its phase.json as the plan recorded it, in order."""
    order = sorted(plan.phases.items(), key=lambda each: (str(each[1].family), each[1].order or 0))
    return dict(order)


def cells_of(frames: pd.DataFrame, plan: Plan | None = None) -> list[Cell]:
    """Cells by scene and phase in the plan's order (others from slow to fast), then size."""
    if frames.empty:
        return []
    plan = plan or Plan()
    about = described(plan)
    pace = (frames.ns / (frames.width * frames.height)).groupby(frames.phase).median()
    phases = [*about, *(c.phase for c in plan.configurations), *pace.sort_values(ascending=False).index]
    scenes = [*(c.scene for c in plan.configurations), *sorted(frames.scene.unique())]
    told = {"warmup": frames.warmup.astype(bool), "presented_ns": frames.ns + frames.present_ns}
    frames = clocks.clocked(frames).assign(**told)
    by = [*KEYS, "launch"]
    launches = frames[~frames.warmup].groupby(by)
    values = launches[[name for name in MEDIANS if name in frames]].median()
    first = frames.sort_values("frame").groupby(by)[["prepare_ns", "ns"]].first()  # right after set-up
    values = values.assign(
        setup_first_ns=first.prepare_ns + first.ns,
        frames=launches.size(),
        round=launches["round"].first() if "round" in frames else math.nan,
        kernel=frames.groupby(by).kernel.first() if "kernel" in frames else None,
    )
    warmed = frames.groupby(KEYS).warmup.any()
    last = {attrgetter(*KEYS)(one): one for one in frames.drop_duplicates(KEYS, keep="last").itertuples()}
    cells = []
    for key, mine in values.groupby(KEYS):
        one = last[key]
        told = {each.name: getattr(one, each.name, None) for each in fields(Facts)}
        told |= {"kernel": kernel_said(mine.kernel), "unwarmed": not warmed[key]}
        told |= {"algorithm": about.get(one.phase, PhaseJson()).algorithm}
        mine = mine.drop(columns="kernel").set_index("round")
        cells.append(Cell(*key, Facts(**told), mine, one.config, one.scene_hash))

    def place(c: Cell) -> tuple:
        name = c.spec if c.spec in phases else c.phase  # other programs may have an @ in their names
        return scenes.index(c.scene), c.pixels, phases.index(name), c.spec, c.threads

    return sorted(cells, key=place)


def by_key(cells: Iterable[Cell]) -> dict[tuple[str, int, int, int, str], Cell]:
    return {(*cell.picture, cell.threads, cell.spec): cell for cell in cells}


def kernel_said(launches: pd.Series) -> str | None:
    """Which code a program's launches ran; where some had no kernel for their scene, how many and why."""
    if launches.isna().all():
        return None
    others = launches[launches != GENERATED]
    if others.empty or len(others) == len(launches):
        return str(launches.iloc[-1])
    return f"{others.iloc[0]}, in {len(others)} of {len(launches)} launches"


def flat(pair: Pair) -> dict[str, Any]:
    """A row of a table: `antialiased` drawn in; a null PSNR beside a share is infinite, else NaN."""
    row = msgspec.to_builtins(pair)
    inner = row.pop("antialiased", None) or {}
    row |= {f"antialiased_{key}": value for key, value in inner.items()}
    for psnr, share in SHARE_BESIDE.items():
        if psnr in row and row[psnr] is None:
            row[psnr] = math.nan if row.get(share) is None else math.inf
    return row | {"failed": " ".join(pair.failed or []), "why": "; ".join(pair.why or [])}


def flags(cell: Cell, about: Mapping[str, Phase | PhaseJson]) -> str:
    """Flags that change arithmetic; of a phase with variants what all share. `about`: phase → phase.json."""
    variants = about[cell.phase].variants if cell.phase in about else []
    return arithmetic_flags(cell.facts.flags or "", variants)


def second_base(cell: Cell, cells: Iterable[Cell], about: Mapping[str, Phase | PhaseJson]) -> Cell | None:
    """opt2 on one thread, built with the flags of `cell`: what its code gains alone."""
    mine = [c for c in cells if (c.phase, c.threads, c.picture) == (SECOND_BASE, 1, cell.picture)]
    return next((c for c in mine if flags(c, about) == flags(cell, about)), None)
