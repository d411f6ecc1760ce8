#!/usr/bin/env python3
"""Compiles the sources of one phase into one object. Run by make (common/rules.mk); standard library only.

    compile.py objects  OUT.o   compiles each source to an object and joins the objects
    compile.py assembly OUT.o   the same by way of assembly/*.s beside OUT; block counters need the assembly
    compile.py read     OUT     compiles only to see the warnings; OUT is an empty file
    compile.py copy     OUT.o   copies the timing build's assembly into assembly/ beside OUT
    compile.py join     OUT.o   joins the objects in the folder --objects

flags.json (made by phase_info.py) holds the phase's flags and variants. A file listed in "each_variant" is
compiled once per variant, as NAME-VARIANT, with LANES and VARIANT(name) defined. A source is compiled again
only if its command or a file that it includes has changed.

A derived phase takes over what its parent's build beside it made, and an ablation, NAME+PATCH, what NAME's
made, wherever all that a source reads has equal texts.

The timing build by gcc contains all variants. With --here only the variants that this CPU can run are
compiled, because no other is ever called. Make passes --here for builds that are sanitized, counted, profiled
or patched, and for clang. A function of a variant that is left out, or that the compiler's machine does not
have, becomes an instruction that traps.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
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

FOLDERS = {"objects": "objects", "assembly": "assembly", "read": "read-only"}  # of the results, beside OUT
STANDARD = ["-std=c11", "-D_GNU_SOURCE"]


def run(command: list[str], show: bool = True) -> str:
    """Runs a command and returns its standard output. If it fails, exits with its status."""
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
    """Precompiled <immintrin.h> or <arm_neon.h>, one per set of compiler flags.

    Parsing it takes a third of a compilation.
    """

    def __init__(self, folder: Path, compiler: str, toolchain: str, name: str) -> None:
        self.folder, self.toolchain, self.name = folder, toolchain, name
        self.compiler = shlex.split(compiler)
        self.ages: str | None = None

    def _headers(self) -> str:
        """Ages and sizes of system headers. They change when the compiler or the C library is upgraded."""
        if self.ages is None:
            found = run([*self.compiler, f"-print-file-name=include/{self.name}"], show=False).strip()
            stats = [os.stat(path) for path in ("/usr/include/stdlib.h", found) if os.path.exists(path)]
            self.ages = " ".join(f"{stat.st_mtime_ns} {stat.st_size}" for stat in stats)
        return self.ages

    def header(self, command: list[str]) -> Path:
        """Returns the header to -include. Two jobs may make it at once, with equal results."""
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
                own.write_text(f"#include <{self.name}>\n")
                with contextlib.suppress(FileExistsError):
                    path.hardlink_to(own)  # replaces no other job's: clang compares the file's age
                own.unlink()
            temporary = made.with_name(f"{made.name}.{os.getpid()}")
            alone = ["env", "CCACHE_DISABLE=1"]  # another clone's has the path of that clone in it
            run([*alone, *words, "-x", "c-header", str(path), "-o", str(temporary)], show=False)
            made.with_name(f"{made.name}.sum").write_text(text)  # what ccache knows it by: no two are equal
            temporary.rename(made)
        return path


def fresh(made: Path, command: list[str]) -> bool:
    """Returns whether this command made the file, after the last change of every file that it read."""
    stamp, needed = made.with_suffix(".cmd"), made.with_suffix(".d")
    try:
        begun, said = stamp.read_text().split("\n", 1)
        words = needed.read_text().replace("\\\n", " ").split(": ", 1)[1].split()
        read = [Path(word).stat().st_mtime_ns for word in words]
        return made.exists() and said == shlex.join(command) and all(age < int(begun) for age in read)
    except (OSError, ValueError, IndexError):
        return False


@functools.cache
def without_line(path: Path) -> str:
    """Returns the text of a file of a tree without the #line that patches.py puts first."""
    text = path.read_text()
    return text.partition("\n")[2] if text.startswith('#line 1 "') else text


def take_over(made: Path, command: list[str], args: argparse.Namespace, other: str | None) -> bool:
    """Takes a result from the build of the phase `other` if all that it read has equal texts.

    Returns False, with nothing done, if that result is missing, stale or made by another command.
    """
    if not other:
        return False
    tree, build, of = args.tree, args.build, args.build.parent / other
    places = (of / "source", Path("phases", other), Path("systems", other), Path(other))
    from_tree = next(place for place in places if place.is_dir())

    def theirs(word: str | Path) -> str:
        return str(word).replace(str(tree), str(from_tree)).replace(str(build), str(of))

    try:
        parent = Path(theirs(made))
        if not fresh(parent, [theirs(word) for word in command]):
            return False
        needed = parent.with_suffix(".d").read_text()
        for word in needed.replace("\\\n", " ").split(": ", 1)[1].split():
            if word.startswith(f"{from_tree}/"):
                if without_line(Path(word)) != without_line(tree / Path(word).relative_to(from_tree)):
                    return False
            elif word.startswith(f"{of}/"):
                return False
        for own in (
            {made, made.parent.parent / "objects" / f"{made.stem}.o"} if args.kind != "read" else {made}
        ):
            shutil.copyfile(theirs(own), own)
        made.with_suffix(".d").write_text(needed.replace(f"{from_tree}/", f"{tree}/"))
        return True
    except OSError:
        return False


def sources(tree: Path) -> list[Path]:
    """Returns the C files of the tree, sorted. Exits if two have the same name: so would their objects."""
    found = sorted(tree.rglob("*.c"))
    names = [path.name for path in found]
    if twice := {name for name in names if names.count(name) > 1}:
        sys.exit(f"{tree}: two files are named {sorted(twice)[0]}; objects are named by them")
    return found


def versions(args: argparse.Namespace, about: dict[str, Any]) -> list[tuple[Path, str]]:
    """Returns what to compile: pairs of source and variant. The variant of a source compiled once is ""."""
    if args.kind == "read":
        variants = about["variants"] if args.every else about["rest"]
    else:
        variants = about["here"] if args.here else about["variants"]
    once = [""] if args.kind != "read" or args.every else []
    each = about["each_variant"]
    return [
        (path, version)
        for path in sources(args.tree)
        for version in (variants if str(path.relative_to(args.tree)) in each else once)
    ]


def compile_all(args: argparse.Namespace, about: dict[str, Any]) -> Path:
    """Compiles everything and returns the folder of the objects. Removes objects of deleted sources."""
    intrinsics = any("<immintrin.h>" in path.read_text() for path in args.tree.rglob("*.[ch]"))
    header = "immintrin.h" if intrinsics or not about["never"] else "arm_neon.h"
    parsed = Parsed(args.parsed, args.cc, args.toolchain, header)
    wide = not about["each_variant"] and intrinsics
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
            command += ["-Og"]  # compiles in two thirds of the time of -O1, and runs as fast
        command += [
            *args.include,
            "-iquote",
            str(args.tree),
            "-iquote",
            str(args.build),
            *shlex.split(args.more),
        ]
        if version or wide:
            command += ["-include", str(parsed.header(command))]
        if "-fsyntax-only" not in command and "-S" not in command:
            command += ["-S" if by_assembly else "-c"]
        command += ["-MMD", str(source), "-o", str(made)]
        if not fresh(made, [args.toolchain, *command]):
            begun = time.time_ns()
            taken = take_over(made, [args.toolchain, *command], args, about["shares_with"])
            if not taken:
                run(command, show=not args.quiet)
            if args.kind == "read":
                made.write_text("")  # only the warnings were wanted
            if by_assembly and not taken:
                run(
                    [*shlex.split(args.cc), "-c", str(made), "-o", str(objects / f"{made.stem}.o")],
                    show=False,
                )
            made.with_suffix(".cmd").write_text(f"{begun}\n{shlex.join([args.toolchain, *command])}")
    for path in [*folder.iterdir(), *objects.iterdir()] if args.kind != "read" else folder.iterdir():
        if path.stem not in kept and path.exists():
            path.unlink()
    return objects


def copy(args: argparse.Namespace, about: dict[str, Any]) -> None:
    """Copies the timing build's assembly, except for variants that this CPU cannot run."""
    folder = args.out.parent / "assembly"
    shutil.rmtree(args.out.parent, ignore_errors=True)
    folder.mkdir(parents=True)
    for path in sorted((args.build / "assembly").glob("*.s")):
        if not path.stem.endswith(tuple(f"-{variant}" for variant in about["rest"])):
            shutil.copy(path, folder)


def binutils(compiler: list[str], name: str) -> str:
    """Returns the program of that name that belongs to the compiler: a cross compiler has its own."""
    return run([*compiler, f"-print-prog-name={name}"], show=False).strip()


def join(objects: Path, out: Path, args: argparse.Namespace, about: dict[str, Any]) -> None:
    """Joins all objects to one. Of a variant's symbols, only those that start with VARIANT_ stay global."""
    folder = out.parent / "joined"
    folder.mkdir(parents=True, exist_ok=True)
    compiler = shlex.split(args.cc)
    ld, objcopy, nm = (binutils(compiler, name) for name in ("ld", "objcopy", "nm"))
    trap = "ud2" if run([*compiler, "-dumpmachine"], show=False).startswith("x86_64") else "brk #1"
    made = about["here"] if args.here else about["variants"]
    parts = [path for path in sorted(objects.glob("*.o")) if "-lanes" not in path.stem]
    for variant in made:
        part = folder / f"{variant}.o"
        run([ld, "-r", "-o", str(part), *map(str, sorted(objects.glob(f"*-{variant}.o")))], show=False)
        run([objcopy, "-w", f"--keep-global-symbol={variant}_*", str(part)], show=False)
        parts.append(part)
    whole = folder / "whole.o"
    run([ld, "-r", "-o", str(whole), *map(str, parts)], show=False)
    left_out = [variant for variant in [*about["variants"], *about["never"]] if variant not in made]
    if left_out:
        wanted = [line.split()[-1] for line in run([nm, "-u", str(whole)], show=False).splitlines()]
        traps, tables = "", ""
        for variant in left_out:  # a function of it is an instruction that is none
            mine = [name for name in wanted if name.startswith(f"{variant}_")]
            traps += "".join(f".globl {name}\n" for name in mine) + f"{variant}_left_out:\n"
            traps += "".join(f"{name}:\n" for name in mine if not name.endswith("_kernel")) + f"{trap}\n"
            table = f".quad {variant}_left_out\n" * 8  # longer than any of functions (workers/lane_kernel.h)
            tables += "".join(f"{name}:\n{table}" for name in mine if name.endswith("_kernel"))
        traps += f".data\n.balign 8\n{tables}"
        (folder / "without.s").write_text(f'.section .note.GNU-stack,"",@progbits\n.text\n{traps}')
        run(
            [*shlex.split(args.cc), "-c", str(folder / "without.s"), "-o", str(folder / "without.o")],
            show=False,
        )
        run([ld, "-r", "-o", f"{out}.tmp", str(whole), str(folder / "without.o")], show=False)
        os.replace(f"{out}.tmp", out)
    else:
        whole.replace(out)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kind", choices=("objects", "assembly", "read", "copy", "join"))
    parser.add_argument("out", type=Path)
    parser.add_argument("--build", type=Path, required=True, help="folder of flags.json, phase_info.h")
    parser.add_argument("--tree", type=Path, required=True, help="the phase's sources")
    parser.add_argument("--cc", required=True)
    parser.add_argument("--toolchain", default="", help="version of the compiler")
    parser.add_argument("--flags", default="", help="follow the phase's own flags: warnings, sanitizers")
    parser.add_argument("--more", default="", help="follow all other flags")
    parser.add_argument("--include", action="append", default=[], help="a folder of headers")
    parser.add_argument(
        "--parsed", type=Path, default=Path("build/common/parsed"), help="precompiled headers"
    )
    parser.add_argument("--objects", type=Path, help="for join: the folder of objects")
    parser.add_argument("--here", action="store_true", help="compile only variants that this CPU can run")
    parser.add_argument("--sanitized", action="store_true")
    parser.add_argument(
        "--every", action="store_true", help="for read: every source and variant, not only what is not built"
    )
    parser.add_argument("--quiet", action="store_true", help="print no command")
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
    try:
        main()
    except OSError as error:  # a folder that cannot be written, a full disk
        sys.exit(f"compile: {error.filename or 'output'}: {error.strerror or error}")
