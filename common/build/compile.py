#!/usr/bin/env python3
"""Compiles the sources of one phase into one object. Run by make (common/rules.mk); standard library only.

    compile.py objects  OUT.o   each source to an object, joined
    compile.py assembly OUT.o   the same by way of OUT's folder/assembly/*.s, which stay: blocks are counted in them
    compile.py read     OUT     compiled for its warnings alone; OUT is an empty file
    compile.py copy     OUT.o   the timing build's assembly, of the variants to be made, into OUT's folder/assembly
    compile.py join     OUT.o   --objects FOLDER: its objects joined

flags.json (phase_info.py) has the phase's flags and variants. A file of "each_variant" is compiled once for each
variant as NAME-VARIANT, with LANES and VARIANT(name) defined. A source is compiled again only when its command
or a file that it includes has changed.

Which variants: what gcc times has all of them. What is sanitized, counted, profiled or patched, and what clang
makes, has those that this CPU runs (--here): no other is ever called. The functions of a variant that is left
out stand for an instruction that traps.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

FOLDERS = {"objects": "objects", "assembly": "assembly", "read": "read-only"}  # of what is made, beside OUT
STANDARD = ["-std=c11", "-D_GNU_SOURCE"]


def run(command: list[str], show: bool = True) -> str:
    """Standard output of a command that ends well; else its status is this program's."""
    if show:
        print(shlex.join(command), flush=True)
    try:
        done = subprocess.run(command, stdout=None if show else subprocess.PIPE, text=True)
    except OSError as error:
        sys.exit(f"compile.py: {command[0]}: {error.strerror}")
    if done.returncode:
        sys.exit(done.returncode if done.returncode > 0 else 1)
    return done.stdout or ""


class Parsed:
    """<immintrin.h>, parsed once for each set of compiler flags: it is a third of each source's compilation."""

    def __init__(self, folder: Path, compiler: str, toolchain: str) -> None:
        self.folder, self.toolchain = folder, toolchain
        self.compiler = shlex.split(compiler)
        self.ages: str | None = None

    def _headers(self) -> str:
        """Ages and sizes of what is parsed: an upgrade of the compiler or the C library parses anew."""
        if self.ages is None:
            found = run([*self.compiler, "-print-file-name=include/immintrin.h"], show=False).strip()
            stats = [os.stat(path) for path in ("/usr/include/stdlib.h", found) if os.path.exists(path)]
            self.ages = " ".join(f"{stat.st_mtime_ns} {stat.st_size}" for stat in stats)
        return self.ages

    def header(self, command: list[str]) -> Path:
        """The header to -include. Two jobs may make it at once: the last one wins, and both are alike."""
        skipped = ("-DLANES=", "-DVARIANT", "-DSTEPWISE_")
        words = [word for i, word in enumerate(command) if not word.startswith(skipped)]
        while "-iquote" in words:
            at = words.index("-iquote")
            del words[at : at + 2]
        words = [word for word in words if word not in ("-c", "-S", "-fsyntax-only", "-MMD")]
        text = " ".join([self._headers(), self.toolchain, *words])
        path = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.h"
        made = path.with_name(f"{path.name}.gch")
        if not made.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            if not path.exists():
                own = path.with_name(f"{path.name}.{os.getpid()}")
                own.write_text("#include <immintrin.h>\n")
                own.rename(path)
            temporary = made.with_name(f"{made.name}.{os.getpid()}")
            run([*words, "-x", "c-header", str(path), "-o", str(temporary)], show=False)
            temporary.rename(made)
        return path


def fresh(made: Path, command: list[str]) -> bool:
    """Whether that command made the file after the last change of all that it read."""
    stamp, needed = made.with_suffix(".cmd"), made.with_suffix(".d")
    try:
        begun, said = stamp.read_text().split("\n", 1)
        words = needed.read_text().replace("\\\n", " ").split(": ", 1)[1].split()
        read = [Path(word).stat().st_mtime_ns for word in words]
        return made.exists() and said == shlex.join(command) and all(age < int(begun) for age in read)
    except (OSError, ValueError, IndexError):
        return False


def sources(tree: Path) -> list[Path]:
    """The C files of the tree, in order. Exits where two have one name: their objects would."""
    found = sorted(tree.rglob("*.c"))
    names = [path.name for path in found]
    if twice := {name for name in names if names.count(name) > 1}:
        sys.exit(f"{tree}: two files are named {sorted(twice)[0]}; objects are named by them")
    return found


def versions(args: argparse.Namespace, about: dict[str, Any]) -> list[tuple[Path, str]]:
    """(source, variant, or "" for what is built once) of all that is to be compiled."""
    counted = args.out.parent.name == "count"
    every = args.clang and counted
    if args.kind == "read":
        variants = about["variants"] if every else about["rest"]
    else:
        variants = about["here"] if args.here else about["variants"]
    once = [""] if args.kind != "read" or every else []
    each = about["each_variant"]
    return [
        (path, version)
        for path in sources(args.tree)
        for version in (variants if str(path.relative_to(args.tree)) in each else once)
    ]


def compile_all(args: argparse.Namespace, about: dict[str, Any]) -> Path:
    """Compiles, and returns the folder of the objects: of these sources and no others."""
    parsed = Parsed(args.parsed, args.cc, args.toolchain)
    wide = not about["each_variant"] and any(
        "<immintrin.h>" in path.read_text() for path in args.tree.rglob("*.[ch]")
    )
    by_assembly = args.kind == "assembly"
    objects = args.out.parent / "objects"
    folder = args.out.parent / FOLDERS[args.kind]
    for path in {folder, objects if by_assembly else folder}:
        path.mkdir(parents=True, exist_ok=True)
    ending = ".s" if by_assembly or args.kind == "read" else ".o"
    kept = set()
    for source, version in versions(args, about):
        made = folder / f"{source.stem}{'-' if version else ''}{version}{ending}"
        kept.add(made.stem)
        command = [*shlex.split(args.cc), *STANDARD, *shlex.split(about["cflags"])]
        if version:
            command += shlex.split(about["flags"][version])
        command += shlex.split(args.flags)
        if version and args.sanitized:
            command += ["-Og"]  # a third less to compile than -O1 and as fast
        command += [*args.include, "-iquote", str(args.tree), "-iquote", str(args.build), *shlex.split(args.more)]
        if version or wide:
            command += ["-include", str(parsed.header(command))]
        if "-fsyntax-only" not in command and "-S" not in command:
            command += ["-S" if by_assembly else "-c"]
        command += ["-MMD", str(source), "-o", str(made)]
        if not fresh(made, [args.toolchain, *command]):
            begun = time.time_ns()
            run(command)
            if by_assembly:
                run([*shlex.split(args.cc), "-c", str(made), "-o", str(objects / f"{made.stem}.o")], show=False)
            made.with_suffix(".cmd").write_text(f"{begun}\n{shlex.join([args.toolchain, *command])}")
    if args.kind == "read":
        shutil.rmtree(folder)
        return folder
    for path in [*folder.iterdir(), *objects.iterdir()]:
        if path.stem not in kept and path.exists():
            path.unlink()
    return objects


def copy(args: argparse.Namespace, about: dict[str, Any]) -> None:
    """The assembly that the timing build was made from, without the variants that this CPU does not run."""
    folder = args.out.parent / "assembly"
    shutil.rmtree(args.out.parent, ignore_errors=True)
    folder.mkdir(parents=True)
    for path in sorted((args.build / "assembly").glob("*.s")):
        if not path.stem.endswith(tuple(f"-{variant}" for variant in about["rest"])):
            shutil.copy(path, folder)


def join(objects: Path, out: Path, args: argparse.Namespace, about: dict[str, Any]) -> None:
    """One object of all. Of a variant's symbols only VARIANT_… are seen from outside of it."""
    folder = out.parent / "joined"
    folder.mkdir(parents=True, exist_ok=True)
    made = about["here"] if args.here else about["variants"]
    parts = [path for path in sorted(objects.glob("*.o")) if "-lanes" not in path.stem]
    for variant in made:
        part = folder / f"{variant}.o"
        run(["ld", "-r", "-o", str(part), *map(str, sorted(objects.glob(f"*-{variant}.o")))], show=False)
        run(["objcopy", "-w", f"--keep-global-symbol={variant}_*", str(part)], show=False)
        parts.append(part)
    whole = folder / "whole.o"
    run(["ld", "-r", "-o", str(whole), *map(str, parts)], show=False)
    left_out = [variant for variant in about["variants"] if variant not in made]
    if left_out:
        wanted = [line.split()[-1] for line in run(["nm", "-u", str(whole)], show=False).splitlines()]
        names = [name for name in wanted if name.startswith(tuple(f"{variant}_" for variant in left_out))]
        traps = "".join(f".globl {name}\n{name}: ud2\n" for name in names)
        (folder / "without.s").write_text(f'.section .note.GNU-stack,"",@progbits\n.text\n{traps}')
        run([*shlex.split(args.cc), "-c", str(folder / "without.s"), "-o", str(folder / "without.o")], show=False)
        run(["ld", "-r", "-o", f"{out}.tmp", str(whole), str(folder / "without.o")], show=False)
        os.replace(f"{out}.tmp", out)
    else:
        whole.replace(out)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kind", choices=("objects", "assembly", "read", "copy", "join"))
    parser.add_argument("out", type=Path)
    parser.add_argument("--build", type=Path, required=True, help="the phase's folder: flags.json, phase_info.h")
    parser.add_argument("--tree", type=Path, required=True, help="the phase's sources")
    parser.add_argument("--cc", required=True)
    parser.add_argument("--toolchain", default="", help="its version: another one compiles anew")
    parser.add_argument("--flags", default="", help="behind the phase's own: warnings, sanitizers")
    parser.add_argument("--more", default="", help="behind all of them")
    parser.add_argument("--include", action="append", default=[], help="a folder of headers, as -IFOLDER")
    parser.add_argument("--parsed", type=Path, default=Path("build/common/parsed"), help="parsed headers")
    parser.add_argument("--objects", type=Path, help="of join: the folder")
    parser.add_argument("--here", action="store_true", help="only the variants that this CPU runs")
    parser.add_argument("--sanitized", action="store_true")
    parser.add_argument("--clang", action="store_true", help="the compiler is clang")
    args = parser.parse_args()
    args.include = [f"-I{folder}" for folder in args.include]
    return args


def main() -> None:
    args = arguments()
    about = json.loads((args.build / "flags.json").read_text())
    args.out.parent.mkdir(parents=True, exist_ok=True)
    if args.kind == "copy":
        copy(args, about)
    elif args.kind == "read":
        compile_all(args, about)
        args.out.write_text("")
    else:
        join(args.objects if args.kind == "join" else compile_all(args, about), args.out, args, about)


if __name__ == "__main__":
    main()
