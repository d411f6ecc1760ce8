#!/usr/bin/env python3
"""Turns a phase's phase.json into flags.json for compile.py and phase_info.h for the driver.

Usage: phase_info.py NAME FLAGS_FROM OUTPUT_FOLDER COMPILER SANITIZERS MACHINE [SHIM]. Uses only the standard
library, because it runs before anything is installed.

NAME is the phase with the sources. FLAGS_FROM, usually the same phase, gives compiler flags and instruction
set. Of the environment, CFLAGS_MORE is appended to the flags (scripts/stepwise toolchains), CC is what make
compiles with (rules.mk), and STEPWISE_WIDEST leaves ablations, but those that it names, the variant that
runs (tests/builds.py). For a phase with variants, the files of "each_variant" are built once per variant,
with the variant's flags last. The widest variant that the CPU supports runs (driver/variant.h). MACHINE is
what the compiler makes programs for, as -dumpmachine says it: x86's flags and instruction sets are left out
for others. SHIM is the folder of an <immintrin.h> that emulates AVX-512. Flags in COPY_FLAGS are dropped
for compilers other than gcc 12 or newer; clang copies that way by default.
"""

import json
import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from study.core import patches  # noqa: E402  (standard library only)

KEYS = {
    "name": str,
    "title": str,
    "isa": list,
    "precision": str,
    "lanes": int,
    "threads": bool,
    "cflags": str,
}
# Flags that copy structs in moves as wide as the lanes; pictures stay the same.
COPY_FLAGS = ("-mmove-max=", "-mstore-max=", "-mmemcpy-strategy=", "-mmemset-strategy=")


def load(name: str) -> dict:
    """Returns the checked phase.json of a phase or of NAME+PATCH, with the keys of its parent."""
    try:
        path = patches.folder(name.partition("+")[0], ROOT) / "phase.json"
        info = patches.described(name, ROOT)
        files = set(patches.files(name.partition("+")[0], ROOT))
    except patches.PatchError as error:
        sys.exit(f"phase_info: {error}")
    for key, kind in KEYS.items():
        if not isinstance(info.get(key), kind):
            sys.exit(f"phase_info: {path}: $.{key}: {kind.__name__} required")
    for key in ("display", "groups"):
        if not isinstance(info.get(key, False), bool):
            sys.exit(f"phase_info: {path}: $.{key}: bool required")
    planes = info.get("planes", [])
    if not isinstance(planes, list) or len(planes) > 32 or not all(isinstance(i, str) for i in planes):
        sys.exit(f"phase_info: {path}: $.planes: a list of at most 32 names of channels required")
    check_variants(path, info, files)
    if info["name"] != name:
        sys.exit(f"phase_info: {path}: $.name: {info['name']!r} is not the folder's name")
    return info


def check_variants(path: Path, info: dict, files: set[str]) -> None:
    """Checks $.variants and $.each_variant: a phase has both or neither. Exits on an error."""
    variants, each = info.get("variants", []), info.get("each_variant", [])
    good = isinstance(variants, list) and all(
        isinstance(one, dict)
        and {key: type(value) for key, value in one.items()} == {"lanes": int, "isa": list, "flags": str}
        for one in variants
    )
    lanes = [one["lanes"] for one in variants] if good else []
    if not good or lanes != sorted(set(lanes), reverse=True):
        sys.exit(f"phase_info: {path}: $.variants: a list of {{lanes, isa, flags}}, widest first, required")
    if not isinstance(each, list) or bool(each) != bool(variants):
        sys.exit(f"phase_info: {path}: $.each_variant: the files built for each of $.variants required")
    for name in each:
        if name not in files:
            sys.exit(f"phase_info: {path}: $.each_variant: there is no {name!r} in the phase's tree")


def supported(variants: list[dict]) -> list[str]:
    """Returns the names of the variants that this CPU can run; all of them if its features are unknown."""
    try:
        found = re.search(r"^flags\s*:(.*)", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    have = set(found[1].split()) if found else {i for one in variants for i in one["isa"]}
    return [f"lanes{one['lanes']}" for one in variants if have >= set(one["isa"])]


def widest_will_do(name: str) -> bool:
    """Returns whether tests need an ablation's widest variant alone: its patch calls no other one."""
    of, plus, title = name.partition("+")
    excepted = os.environ.get("STEPWISE_WIDEST")
    if not plus or excepted is None or name in excepted.split():
        return False
    patch = patches.file(of, title, ROOT)
    return len(set(re.findall(r"\blanes\d+(?=_)", patch.read_text()))) < 2


def for_other_machine(name: str, info: dict) -> dict:
    """Returns phase.json for a machine that is not x86-64: without x86's flags (-m…) and instruction sets,
    with the variants of 8 lanes and fewer, and with `made_by`: what its lanes are."""
    files = patches.files(name.partition("+")[0], ROOT).values()
    by_simde = any("<immintrin.h>" in path.read_text() for path in files if path.suffix in (".c", ".h"))
    variants = [one for one in info.get("variants", []) if one["lanes"] <= 8]
    return info | {
        "isa": [],
        "cflags": drop_flags(info["cflags"], "-m"),
        "variants": [one | {"isa": [], "flags": ""} for one in variants],
        "made_by": "avx2 by SIMDe" if by_simde else "neon" if info["lanes"] > 1 else "aarch64",
    }


def needs(isa: list) -> str:
    return " ".join(f"need({json.dumps(i)})" for i in isa)


def variant_line(one: dict, isa: list, flags: str, emulated: bool, made_by: str) -> str:
    """Returns a variant for variant.c: lanes, features as one word, flags, features that the phase lacks."""
    features = [name for name in one["isa"] if not emulated or not name.startswith("avx512")]
    whole = "+".join(sorted({*isa, *features})) or made_by
    whole = json.dumps(f"{whole}, {one['lanes']} lanes emulated" if emulated else whole)
    debug = "-Og" if "-fsanitize" in flags and not emulated else ""
    flags = json.dumps(" ".join(filter(None, [flags, one["flags"], debug])))
    return f"variant({one['lanes']}, {whole}, {flags}, {needs(one['isa'])})"


def knows_copies(compiler: str) -> bool:
    """Returns whether the first line of --version is of gcc 12 or newer: "gcc (Debian 12.2.0-14) 12.2.0"."""
    found = re.search(r"\) (\d+)\.", compiler)
    return found is not None and int(found[1]) >= 12 and "clang" not in compiler


def drop_flags(flags: str, *beginnings: str) -> str:
    return " ".join(word for word in flags.split() if not word.startswith(beginnings))


def emulate(one: dict, shim: str) -> dict:
    """Returns a variant built without AVX-512. It still lists AVX-512, for STEPWISE_ISA_LIMIT to hide."""
    flags = [drop_flags(one["flags"], "-mavx512", "-mprefer-vector-width", *COPY_FLAGS)]
    flags = [*flags, "-mavx2", "-mfma", "-isystem", shim, "-Wno-psabi"]
    return one | {"flags": " ".join(flags), "isa": [*one["isa"], "avx2", "fma"]}


def flattened(name: str, folders: list[Path], seen: set[Path]) -> list[str]:
    """Returns a source's lines with includes of the phase's files and of common/ expanded, each as often as
    the compiler would: what says `#pragma once`, once."""
    path = next((folder / name for folder in folders if (folder / name).is_file()), None)
    if path is None or path in seen:
        return [] if path else [f'#include "{name}"']
    text = path.read_text()
    if "\n#pragma once\n" in text:
        seen.add(path)
    lines = []
    for line in text.splitlines():
        include = re.match(r'#include "(.*\.[ch])"', line)
        if include:
            lines += flattened(include[1], folders, seen)
        elif line and not line.lstrip().startswith(("//", "#line", "#pragma once")):
            lines.append(line)
    return lines


def embed(files: list[str], folder: Path, output: Path) -> None:
    """Writes embedded.h: the files $.embedded as strings, one source, which is compiled at run time."""
    lines: list[str] = []
    seen: set[Path] = set()
    for name in files:
        if not (folder / name).is_file():
            sys.exit(f"phase_info: $.embedded: there is no {name!r} in the phase's tree")
        lines += flattened(name, [folder, ROOT / "common"], seen)
    text = [f'    {json.dumps(line, ensure_ascii=False)[:-1]}\\n",' for line in lines]
    replace(
        output / "embedded.h", "\n".join(["static const char *const embedded_lines[] = {", *text, "};", ""])
    )


def replace(path: Path, text: str) -> None:
    """Writes a file only if its text changes, so that make rebuilds only what is necessary."""
    if not path.is_file() or path.read_text() != text:
        temporary = path.with_suffix(f".{os.getpid()}.tmp")
        temporary.write_text(text)
        temporary.rename(path)


def main() -> None:
    name, flags_from, folder, compiler, sanitizers = *sys.argv[1:3], Path(sys.argv[3]), *sys.argv[4:6]
    machine = sys.argv[6] if len(sys.argv) > 6 else "x86_64"
    shim = sys.argv[7] if len(sys.argv) > 7 else ""
    phase, flags = load(name), load(flags_from)
    names = [f"lanes{one['lanes']}" for one in phase.get("variants", [])]
    if not machine.startswith("x86_64"):
        phase, flags = for_other_machine(name, phase), for_other_machine(flags_from, flags)
    made_by = phase.get("made_by", "x86-64")
    isa = sorted(set(phase["isa"]) | set(flags["isa"]))
    folder.mkdir(parents=True, exist_ok=True)
    cflags = " ".join(filter(None, [flags["cflags"], os.environ.get("CFLAGS_MORE")]))
    variants = phase.get("variants", [])
    if not knows_copies(compiler):
        variants = [one | {"flags": drop_flags(one["flags"], *COPY_FLAGS)} for one in variants]
    emulated = [bool(shim) and any(i.startswith("avx512") for i in one["isa"]) for one in variants]
    variants = [emulate(one, shim) if is_so else one for one, is_so in zip(variants, emulated, strict=True)]
    built = [f"lanes{one['lanes']}" for one in variants]
    # For a sanitized or cross-built phase the widest alone, which is the one that runs: half the time.
    here = built if shim else supported(variants)[: 1 if sanitizers or widest_will_do(name) else None]
    run_here = " ".join(here)
    of, plus, _ = name.partition("+")
    about = {
        "shares_with": of if plus else phase.get("derives") if name == flags_from else None,
        "cflags": cflags,
        "variants": built,
        "here": here,
        "rest": [one for one in built if one not in here],
        "never": [one for one in names if one not in built],
        "each_variant": phase.get("each_variant", []),
        "flags": {
            f"lanes{n}": f"{one['flags']} -DLANES={n} '-DVARIANT(a)=lanes{n}_##a'"
            for one in variants
            for n in [one["lanes"]]
        },
    }
    replace(folder / "flags.json", json.dumps(about, indent=1) + "\n")
    flags = " ".join(filter(None, [cflags, sanitizers]))
    choice = [
        variant_line(one, isa, flags, is_so, made_by) for one, is_so in zip(variants, emulated, strict=True)
    ]
    lines = [
        f"#define PHASE_NAME {json.dumps(name)}",
        f"#define PHASE_FLAGS_FROM {json.dumps(flags_from)}",
        f"#define PHASE_FLAGS {json.dumps(flags)}",
        f"#define PHASE_COMPILER {json.dumps(compiler)}",
        f"#define PHASE_CC {json.dumps(os.environ.get('CC', '').strip() or 'gcc')}",  # as make has it
        f"#define PHASE_ISA {json.dumps('+'.join(isa) or made_by)}",
        f"#define PHASE_NEEDS(need) {needs(isa)}",
        f"#define PHASE_VARIANTS(variant, need) {' '.join(choice)}",
        f"#define PHASE_EMULATED {int(any(emulated))}",
        f"// On this CPU: {run_here}",  # so that another CPU rebuilds everything (rules.mk)
        f"// Sources: {' '.join(sorted(patches.files(name.partition('+')[0], ROOT)))}",
        f"#define PHASE_PRECISION {json.dumps(phase['precision'])}",
        f"#define PHASE_LANES {phase['lanes']}",
        f"#define PHASE_THREADS {int(phase['threads'])}",
        f"#define PHASE_DISPLAY {int(phase.get('display', False))}",
        f"#define PHASE_GROUPS {int(phase.get('groups', False))}",
        f"#define PHASE_PLANES {' '.join(json.dumps(i) + ',' for i in phase.get('planes', []))}",
    ]
    replace(folder / "phase_info.h", "\n".join(lines) + "\n")
    if phase.get("embedded"):
        patches.write(name, folder / "source")  # as make does for a derived phase and an ablation
        embed(phase["embedded"], folder / "source", folder)


if __name__ == "__main__":
    try:
        main()
    except OSError as error:  # a folder that cannot be written, a full disk
        sys.exit(f"phase_info: {error.filename or 'output'}: {error.strerror or error}")
