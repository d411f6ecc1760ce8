"""What a run stands on, in words: machine, noise, what was left out, and the command that repeats it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from study.core import machine as machines
from study.core import registry
from study.core.host import checkout, quotas
from study.numbers import analysis
from study.numbers.analysis import Data

WIDE = 16  # lanes of the newest CPUs


def short_name(data: Data) -> str:
    """The run's machine; of a run whose phases had fewer lanes than that CPU has, with its vectors."""
    found = data.context.get("cpu") or {}
    short = found.get("microarchitecture") or machines.name(data.context)
    if not {"phase", "lanes"} <= set(data.frames):
        return short
    flags = set(found.get("flags") or ())
    wide = [
        phase
        for phase, known in registry.ladder().items()
        if any(one["lanes"] >= WIDE and flags.issuperset(one["isa"]) for one in known.variants)
    ]
    lanes = data.frames[data.frames["phase"].isin(wide)]["lanes"].max()
    return f"{short}, AVX2 alone" if lanes < WIDE else short


def machine(data: Data) -> list[tuple[str, str]]:
    """Label and text of everything known; unknown things are left out."""
    context = data.context
    cpu, git = context.get("cpu") or {}, context.get("git") or {}
    count = f"{cpu['logical_cpus']} logical CPUs" if cpu.get("logical_cpus") else None
    caches = [f"L{c.get('level')} {c.get('type')} {c.get('size')}" for c in context.get("caches") or []]
    libraries = context.get("libraries") or {}
    changes = "none" if checkout.is_clean(git) else git.get("unknown") or ("unknown" if git else None)
    if git.get("dirty"):
        changes = f"yes, SHA-256 {git.get('diff_sha256')}"
    known = {
        "CPU": _join(cpu.get("model"), cpu.get("microarchitecture"), count),
        "caches": _join(*caches),
        "memory": f"{context['memory_kib'] / 2**20:.1f} GiB" if context.get("memory_kib") else None,
        "system": _join(context.get("system"), context.get("kernel")),
        "hypervisor": context.get("hypervisor"),
        "frequency governor": context.get("governor") or ("not readable" if context else None),
        **_measured(data),
        "Python": context.get("python"),
        "libraries": _join(*(f"{name} {version}" for name, version in libraries.items() if version)),
        "commit": git.get("commit"),
        "uncommitted changes": changes,
        "measured": context.get("time"),
        "limits": "; ".join(quotas.notices(context)) or None,
        "energy": context.get("no_energy"),
        "load average before": _join(*(f"{load:.2f}" for load in context.get("load_average") or [])),
    }
    return [(label, str(text)) for label, text in known.items() if text]


def _join(*parts: Any) -> str:
    return ", ".join(str(part) for part in parts if part)


def _measured(data: Data) -> dict[str, str | None]:
    """Toolchain, clocks and noise as the frames have them."""
    frames = data.frames
    if frames.empty:
        return {"compiler": data.context.get("compiler"), "libc": data.context.get("libc")}
    core = (frames["core_hz_before"] + frames["core_hz_after"]) / 2e9
    noise = analysis.noise(data)
    stolen = noise.get("steal_ticks", 0) / 100
    return {
        "compiler": _join(*frames["compiler"].unique()),
        "libc": _join(*frames["libc"].unique()),
        "clocks, measured": f"TSC {frames['tsc_hz'].median() / 1e9:.4f} GHz; core {core.median():.3f} GHz, "
        f"{core.min():.3f} to {core.max():.3f} GHz over all frames",
        "measured frames": f"{noise['frames']} in {noise['launches']} process launches, "
        f"{noise['seconds']:.0f} s in all",
        "disturbances in them": f"{stolen:.2f} s stolen by the hypervisor; context switches: "
        f"{noise.get('ctx_involuntary', 0)} involuntary, {noise.get('ctx_voluntary', 0)} voluntary; "
        f"{noise.get('faults_major', 0)} major page faults",
    }


def skipped(data: Data) -> list[str]:
    """A sentence for each thing that was planned and is not there."""
    found = [f"{_subject(item)}: {item.get('reason')}" for item in data.plan.get("skipped") or []]
    found += [f"{_subject(item)} crashed: {item.get('message')}" for item in data.plan.get("failures") or []]
    short: dict[object, list[str]] = {}
    for item in data.plan.get("not_reached") or []:
        short.setdefault(item.get("launches"), []).append(str(item.get("name")))
    for launches, names in short.items():
        found.append(f"{launches} launches were all that the budget allowed: {'; '.join(names)}")
    return found


def _subject(item: Mapping) -> str:
    size = f"{item['width']}×{item['height']}" if "width" in item else None
    return " ".join(str(part) for part in (item.get("spec"), item.get("scene"), size) if part)


def commands(data: Data) -> list[str]:
    """What makes the same again, from what the run recorded. RUN stands for the new run's folder."""
    heights = {pair.get("height") for pair in data.pairs}
    size = f" -n {heights.pop()}" if len(heights) == 1 else ""
    sweep, rest = (
        command(data.plan) or "scripts/stepwise sweep",
        ("scripts/stepwise pictures --run RUN", "scripts/stepwise report RUN"),
    )
    return [sweep, f"scripts/stepwise verify --run RUN{size}", *rest]


def command(plan: Mapping) -> str:
    """The sweep that measures the same again, from what the plan recorded."""
    asked = plan.get("configurations") or []
    parts = ["scripts/stepwise sweep"]
    for option, values in (
        ("--phase", [c.get("spec") for c in asked]),
        ("--scene", [c.get("scene") for c in asked]),
        ("-n", [f"{c['width']}x{c['height']}" for c in asked if "width" in c]),
        ("--threads", [c.get("threads") for c in asked]),
        *((f"--{key}", [plan.get(key)]) for key in ("launches", "reps", "warmup", "long", "seed", "cpu")),
        ("--budget", [plan.get("budget_s")]),
    ):
        given = [shlex.quote(str(value)) for value in dict.fromkeys(values) if value is not None]
        parts += [option, *given] if given else []
    return " ".join(parts) if asked else ""
