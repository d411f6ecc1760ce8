"""Puts a counter into every basic block of compiler output (gcc or clang -S, AT&T syntax).

Run by make (common/rules.mk) on the FILE.s of a phase; makes, in one folder,
    plain/FILE.o    the text as it is, with a local symbol at the start of each block. Symbols emit no bytes:
                    it is the shipped code, byte for byte, and where each block's bytes lie is known;
    counted/FILE.o  the same with counters, which is what runs;
    table.json      what each counter stands for, for counting.blocks; blocks_table.h for counting/blocks.c.

study.counting.assembly_source has the text's blocks, study.counting.assembly_counters what counts them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shlex
import shutil
from pathlib import Path
from typing import Any

from study.core import cli, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.counting.assembly_source import Counters, Source
from study.counting.decode import Disassembler

SCHEMA = 1


def table(sources: list[Source], counters: Counters) -> dict[str, Any]:
    """What blocks needs. `calls`: (block, callee, block that runs when it is not called, or None)."""
    blocks, calls = [], []
    for source in sources:
        for number, block in enumerate(source.blocks, source.first):
            blocks.append(
                {
                    "function": block.function,
                    "entry": block.entry,
                    "file": source.path.name,
                    "section": block.section,
                    "offset": block.offset,
                    "bytes": block.code.hex(),
                }
            )
            if block.callee:
                callee = source.aliases.get(block.callee, block.callee)
                calls.append([number, callee, number + 1 if block.conditional else None])
    made = {
        "schema": SCHEMA,
        "blocks": blocks,
        "calls": calls,
        "masked": [list(key) for key in counters.masked],
        "repeated": [list(key) for key in counters.repeated],
    }
    return made | {"hash": digest(made)}


def digest(made: dict[str, Any]) -> str:
    """SHA-256 of a table without its own hash."""
    text = json.dumps({k: v for k, v in made.items() if k != "hash"}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _assemble(compiler: list[str], text: str, path: Path, name: str) -> Path:
    """Writes FOLDER/NAME.s and assembles it to FOLDER/NAME.o."""
    path.mkdir(parents=True, exist_ok=True)
    source, made = path / f"{name}.s", path / f"{name}.o"
    source.write_text(text, encoding="utf-8")
    try:
        done = child.run([*compiler, "-c", str(source), "-o", str(made)], capture_output=True, text=True)
    except OSError as error:
        raise StudyError(f"{compiler[0]}: {error.strerror}", CANNOT_RUN) from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise StudyError(f"{source}: cannot be assembled: {said}")
    return made


def instrument(compiler: list[str], paths: list[Path], folder: Path) -> None:
    """All of it; table.json comes last, when everything else stands."""
    for kind in ("plain", "counted"):  # objects of sources that are gone would be linked
        shutil.rmtree(folder / kind, ignore_errors=True)
    sources: list[Source] = []
    disassembler = Disassembler()
    for path in paths:
        sources.append(Source(path, sum(len(s.blocks) for s in sources)))
        obj = _assemble(compiler, sources[-1].marked(), folder / "plain", path.stem)
        sources[-1].locate(obj, disassembler)
    counters = Counters.of(sources)
    for source in sources:
        _assemble(compiler, source.counted(counters), folder / "counted", source.path.stem)
    made = table(sources, counters)
    header = [
        "// Written by scripts/study/counting/assembly.py.",
        f"#define BLOCKS {counters.blocks}",
        f"#define MASKED {len(counters.masked)}",
        f"#define REPEATED {len(counters.repeated)}",
        f'#define TABLE_HASH "{made["hash"]}"',
    ]
    store.write_text(folder / "blocks_table.h", "\n".join(header) + "\n")
    store.write_json(folder / "table.json", made)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cc", default="cc", help="what assembles (%(default)s)")
    parser.add_argument("folder", type=Path, help="where plain/, counted/ and table.json are made")
    parser.add_argument("sources", type=Path, nargs="+", metavar="FILE.s", help="of one program")
    args = parser.parse_args()
    names = [path.stem for path in args.sources]
    if len(set(names)) < len(names):
        raise StudyError(f"two sources of the same name among {', '.join(sorted(names))}")
    instrument(shlex.split(args.cc), args.sources, args.folder)


if __name__ == "__main__":
    cli.main(main)
