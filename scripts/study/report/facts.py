"""What a run stands on, in words: machine, noise, what was left out, and the command that repeats it."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from study.core import machine as machines
from study.core import registry, store
from study.core.host import checkout, quotas
from study.core.run_schema import Context, Git, Left, Plan
from study.numbers import noise
from study.numbers.analysis import Data

WIDE = 16  # lanes of the newest CPUs


def short_name(data: Data) -> str:
    """The run's machine; of a run whose phases had fewer lanes than that CPU has, with its vectors."""
    cpu = data.context.cpu
    short = cpu.microarchitecture or machines.name(data.context)
    if not {"phase", "lanes"} <= set(data.frames):
        return short
    flags = set(cpu.flags)
    wide = [
        phase
        for phase, known in registry.ladder().items()
        if any(one.lanes >= WIDE and flags.issuperset(one.isa) for one in known.variants)
    ]
    lanes = data.frames[data.frames["phase"].isin(wide)]["lanes"].max()
    return f"{short}, AVX2 alone" if lanes < WIDE else short


def machine(data: Data) -> list[tuple[str, str]]:
    """Label and text of everything known; unknown things are left out."""
    context = data.context
    cpu, git, there = context.cpu, context.git, context != Context()
    count = f"{cpu.logical_cpus} logical CPUs" if cpu.logical_cpus else None
    caches = [f"L{cache.level} {cache.type} {cache.size}" for cache in context.caches]
    changes = "none" if checkout.is_clean(git) else git.unknown or ("unknown" if git != Git() else None)
    if git.dirty:
        changes = f"yes, SHA-256 {git.diff_sha256}"
    known = {
        "CPU": _join(cpu.model, cpu.microarchitecture, count),
        "caches": _join(*caches),
        "memory": f"{context.memory_kib / 2**20:.1f} GiB" if context.memory_kib else None,
        "system": _join(context.system, context.kernel),
        "hypervisor": context.hypervisor,
        "frequency governor": context.governor or ("not readable" if there else None),
        **_measured(data),
        "Python": context.python,
        "libraries": _join(*(f"{name} {version}" for name, version in context.libraries.items() if version)),
        "commit": git.commit,
        "uncommitted changes": changes,
        "measured": context.time,
        "limits": "; ".join(quotas.notices(context)) or None,
        "energy": context.no_energy,
        "load average before": _join(*(f"{load:.2f}" for load in context.load_average or [])),
    }
    return [(label, str(text)) for label, text in known.items() if text]


def _join(*parts: Any) -> str:
    return ", ".join(str(part) for part in parts if part)


def _measured(data: Data) -> dict[str, str | None]:
    frames = data.frames
    if frames.empty:
        return {"compiler": data.context.compiler, "libc": data.context.libc}
    core = (frames["core_hz_before"] + frames["core_hz_after"]) / 2e9
    found = noise.counted(data)
    return {
        "compiler": _join(*frames["compiler"].unique()),
        "libc": _join(*frames["libc"].unique()),
        "clocks, measured": None
        if data.plan.programs
        else f"timer {frames['tsc_hz'].median() / 1e9:.4f} GHz; core {core.median():.3f} GHz, "
        f"{core.min():.3f} to {core.max():.3f} GHz over all frames",
        "measured frames": f"{found.frames} in {found.launches} process launches, "
        f"{found.seconds:.0f} s in all",
        "disturbances in them": f"{found.steal_ticks / 100:.2f} s stolen by the hypervisor; context "
        f"switches: {found.ctx_involuntary} involuntary, {found.ctx_voluntary} voluntary; "
        f"{found.faults_major} major page faults",
    }


def skipped(data: Data) -> list[str]:
    """A sentence for each thing that was planned and is not there."""
    found = [f"{_subject(item)}: {item.reason}" for item in data.plan.skipped]
    found += [f"{_subject(item)} crashed: {item.message}" for item in data.plan.failures]
    short: dict[int, list[str]] = {}
    for item in data.plan.not_reached:
        short.setdefault(item.launches, []).append(item.name)
    for launches, names in short.items():
        found.append(f"{launches} launches were all that the budget allowed: {'; '.join(names)}")
    return found


def _subject(item: Left) -> str:
    size = f"{item.width}×{item.height}" if item.width else None
    return " ".join(part for part in (item.spec, item.scene, size) if part)


def commands(data: Data) -> list[str]:
    """What makes the same again, from what the run recorded. RUN stands for the new run's folder."""
    heights = {pair.height for pair in data.pairs}
    size = f" -n {heights.pop()}" if len(heights) == 1 else ""
    own = {path.stem: path for path in (data.path / store.OWN_SCENES).glob("*.json")}
    sweep = command(data.plan, own) or "scripts/stepwise sweep"
    rest = "scripts/stepwise pictures --run RUN", "scripts/stepwise report RUN"
    verify = f"scripts/stepwise verify --run RUN{size}"
    return [sweep, rest[1]] if data.plan.programs else [sweep, verify, *rest]


def command(plan: Plan, own: Mapping[str, Path] = MappingProxyType({})) -> str:
    """What measures the same again, from what the plan recorded. `own`: files of scenes."""
    if plan.programs:
        return shlex.join(["scripts/stepwise", *(plan.words or ["import", *plan.read_from])])
    asked = plan.configurations
    parts = ["scripts/stepwise sweep"]
    given: dict[str, list] = {
        "--phase": [c.spec or None for c in asked],
        "--scene": [own.get(c.scene, c.scene) for c in asked],
        "-n": [f"{c.width}x{c.height}" for c in asked if c.width],
        "--threads": [c.threads for c in asked],
        **{f"--{key}": [getattr(plan, key)] for key in ("launches", "reps", "warmup", "long", "seed", "cpu")},
        "--budget": [plan.budget_s],
    }
    for option, values in given.items():
        words = [shlex.quote(str(value)) for value in dict.fromkeys(values) if value is not None]
        parts += [option, *words] if words else []
    return " ".join(parts) if asked else ""
