"""What the measuring machine is, as far as it lets itself be read (context.json). Changes nothing."""

import contextlib
import datetime
import hashlib
import importlib.metadata
import os
import platform
import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from study.core import registry
from study.core.host import arm, checkout, energy, quotas, read_text, topology
from study.core.run_schema import Context, Cpu, Limits

LIBRARIES = ("numpy", "pandas", "matplotlib", "OpenImageIO", "Jinja2", "tqdm", "flip-evaluator")
HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"

# Family 6 models by name: Linux, arch/x86/include/asm/intel-family.h.
INTEL = {
    "Sandy Bridge": (42, 45),
    "Ivy Bridge": (58, 62),
    "Haswell": (60, 63, 69, 70),
    "Broadwell": (61, 71, 79, 86),
    "Skylake": (78, 94, 85),
    "Kaby Lake": (142, 158),
    "Comet Lake": (165, 166),
    "Ice Lake": (106, 108, 125, 126),
    "Tiger Lake": (140, 141),
    "Rocket Lake": (167,),
    "Alder Lake": (151, 154),
    "Raptor Lake": (183, 186, 191),
    "Meteor Lake": (170, 172),
    "Arrow Lake": (181, 197, 198),
    "Lunar Lake": (189,),
    "Sapphire Rapids": (143,),
    "Emerald Rapids": (207,),
    "Granite Rapids": (173, 174),
}
# Cores with AMX. A hypervisor may give another model's number: one of these then, or what came after them.
AMX = ("Sapphire Rapids", "Emerald Rapids", "Granite Rapids")
SOME_AMX = "Sapphire Rapids or later"
# (family, first model, last model): Linux, arch/x86/kernel/cpu/amd.c, bsp_init_amd.
AMD = {
    "Zen": ((23, 0x00, 0x2F), (23, 0x50, 0x5F)),
    "Zen 2": ((23, 0x30, 0x4F), (23, 0x60, 0x7F), (23, 0x90, 0x91), (23, 0xA0, 0xAF)),
    "Zen 3": ((25, 0x00, 0x0F), (25, 0x20, 0x5F)),
    "Zen 4": ((25, 0x10, 0x1F), (25, 0x60, 0xAF)),
    "Zen 5": ((26, 0x00, 0x2F), (26, 0x40, 0x4F), (26, 0x60, 0x7F)),
}


def _output(*command: str) -> str | None:
    try:
        done = subprocess.run(command, capture_output=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.decode(errors="replace").strip() if done.returncode == 0 else None


def microarchitecture(
    vendor: str | None, family: int, model: int, stepping: int = 0, flags: Sequence[str] = ()
) -> str | None:
    """Common name, e.g. "Zen 4", or None when the tables above do not have it. `flags`: of /proc/cpuinfo."""
    if vendor == "AuthenticAMD":
        ranges = ((name, r) for name, several in AMD.items() for r in several)
        return next((name for name, (f, low, high) in ranges if f == family and low <= model <= high), None)
    if vendor != "GenuineIntel":
        return None
    name = next((name for name, models in INTEL.items() if family == 6 and model in models), None)
    if (family, model) == (6, 85) and stepping >= 5:
        name = "Cooper Lake" if stepping >= 10 else "Cascade Lake"
    return SOME_AMX if "amx_tile" in flags and name not in AMX else name


def cpu(cpuinfo: str | None = None) -> Cpu:
    """The first processor of /proc/cpuinfo, of arm64 the fastest. `cpuinfo`: its text, for tests."""
    text = read_text("/proc/cpuinfo") if cpuinfo is None else cpuinfo
    counts = {"logical_cpus": os.cpu_count(), "usable_cpus": len(os.sched_getaffinity(0))}
    if "CPU implementer" in text:
        return msgspec.structs.replace(arm.named(arm.block(text, topology.FASTEST)), **counts)
    lines = (line.partition(":") for line in text.split("\n\n")[0].splitlines())
    info = {key.strip(): value.strip() for key, _, value in lines}
    family, model, stepping = (arm.number(info, key) for key in ("cpu family", "model", "stepping"))
    vendor, flags = info.get("vendor_id"), info.get("flags", "").split()
    known = info.get("model name", platform.machine())
    return Cpu(
        model=vendor if known == "unknown" else known,  # as gVisor has it
        vendor=vendor,
        family=family,
        model_number=model,
        stepping=stepping,
        microcode=info.get("microcode"),
        microarchitecture=microarchitecture(vendor, family, model, stepping, flags),
        cores=arm.number(info, "cpu cores") or None,
        flags=flags,
        **counts,
    )


def not_x86() -> str | None:
    """What this machine calls itself where it is not x86-64."""
    return None if (here := platform.machine()) in ("x86_64", "amd64") else here


def name(context: Context | Mapping[str, Any] | None) -> str:
    """The CPU of a context.json, and what it is (a virtual machine's may be called just "AMD EPYC")."""
    found = msgspec.convert(context or {}, Context).cpu
    known = found.microarchitecture
    if not known and found.family and found.family != arm.ARMV8:
        known = f"family {found.family} model {found.model_number}"
    model = found.model
    if model and known and known not in model:
        return f"{model} ({known})"
    return model or known or "unknown CPU"


def slug(cpuinfo: str | None = None) -> str:
    """Folder name made from the CPU: maker, name, family and model: intel-xeon-6-207."""
    found = cpu(cpuinfo)
    words = r"\((R|TM|C)\)|@.*|\b(CPU|Processor|\d+-Core)\b"
    name = re.sub(words, " ", found.model or "", flags=re.IGNORECASE)
    return re.sub(r"[^a-z0-9]+", "-", f"{name} {found.family} {found.model_number}".lower()).strip("-")


def steal_ticks() -> int:
    """Time the hypervisor has taken from all CPUs since boot, in 1/100 s."""
    fields = read_text("/proc/stat").split("\n")[0].split()
    return int(fields[8]) if len(fields) > 8 and fields[8].isdecimal() else 0


def differs(then: Context, now: Context) -> list[str]:
    """What is another machine's between two contexts, in words: none, if a run can go on."""
    of_cpu = ("model", "microcode", "logical_cpus", "usable_cpus", "cores")
    told = [(key.replace("_", " "), getattr(then.cpu, key), getattr(now.cpu, key)) for key in of_cpu]
    told += [(key, getattr(then, key), getattr(now, key)) for key in ("machine", "kernel", "hypervisor")]
    if then.limits != Limits():
        told.append(("quota of CPUs", then.limits.cpus, now.limits.cpus))
    said = [f"{key} {one}, here {other}" for key, one, other in told if one != other]
    memory, here = then.memory_kib or 0, now.memory_kib or 0
    if abs(memory - here) > 0.01 * max(memory, here):  # a kernel keeps some of it, not always the same
        said.append(f"memory {memory / 2**20:.1f} GiB, here {here / 2**20:.1f} GiB")
    return said


def compiler_words() -> list[str]:
    """The compiler as make calls it: several words where CC is `ccache gcc`."""
    with contextlib.suppress(ValueError):  # an open quotation mark: make will say so
        return shlex.split(os.environ.get("CC", "")) or ["gcc"]
    return ["gcc"]


def _chosen(text: str) -> str | None:
    """The choice in brackets of a kernel's line: `always [madvise] never`."""
    found = re.search(r"\[(\w+)\]", text)
    return found[1] if found else text or None


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def context(pinned: int = topology.FASTEST) -> Context:
    """Everything a figure of this run stands on; `pinned`: of one thread. Unreadable things are None."""
    memory = re.search(r"MemTotal:\s+(\d+)", read_text("/proc/meminfo"))
    found, at = cpu(), topology.pinned(pinned)
    # One switch for all CPUs; since Linux 6.11 one each as well.
    switches = [topology.SYSTEM / folder / "cpufreq" / "boost" for folder in (".", f"cpu{pinned}")]
    makers = map(read_text, ("/sys/hypervisor/type", "/sys/class/dmi/id/sys_vendor"))
    return Context(
        schema=1,
        time=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        machine=slug(),
        cpu=found,
        pinned=at,
        caches=topology.caches(pinned),
        memory_kib=int(memory[1]) if memory else None,
        kernel=platform.release(),
        system=platform.freedesktop_os_release().get("PRETTY_NAME") if read_text("/etc/os-release") else None,
        hypervisor=next(filter(None, makers), "yes, name unknown") if "hypervisor" in found.flags else None,
        governor=at.governor,
        no_turbo=read_text("/sys/devices/system/cpu/intel_pstate/no_turbo") or None,
        boost=next(filter(None, map(read_text, switches)), None),
        huge_pages=_chosen(read_text(HUGE_PAGES)),
        compiler=(_output(*compiler_words(), "--version") or "").split("\n")[0] or None,
        libc=" ".join(platform.libc_ver()).strip() or None,
        python=platform.python_version(),
        libraries={name: _version(name) for name in LIBRARIES},
        git=checkout.state(),
        limits=quotas.limits(),
        no_energy=energy.missing(),
        load_average=list(os.getloadavg()),
        steal_ticks=steal_ticks(),
        scenes={
            name: hashlib.sha256(scene.path.read_bytes()).hexdigest()
            for name, scene in registry.own_scenes().items()
        },
    )
