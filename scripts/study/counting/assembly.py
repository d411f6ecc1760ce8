"""Puts a counter into every basic block of compiler output (gcc or clang -S, AT&T syntax).

Run by make (common/rules.mk) on the FILE.s of a phase; makes, in one folder,
    plain/FILE.o    the text as it is, with a local symbol at the start of each block. Symbols emit no bytes:
                    it is the shipped code, byte for byte, and where each block's bytes lie is known;
    counted/FILE.o  the same with counters, which is what runs;
    table.json      what each counter stands for, for counting.blocks; blocks_table.h for counting/blocks.c.

study.counting.assembly_source has the text's blocks and what counts them.
"""

import argparse
import hashlib
import shlex
import shutil
from pathlib import Path

import msgspec

from study.core import cli, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.counting.assembly_source import Counters, Source


class Block(msgspec.Struct):
    """`entry`: what enters the block calls the function. `bytes`: in hexadecimal digits, at `offset` of the
    section."""

    function: str
    entry: bool
    file: str
    section: str
    offset: int
    bytes: str


class Table(msgspec.Struct):
    """What the counters of one program stand for. `calls`: block, callee, and the block that runs when it is
    not called, or None. `masked`, `repeated`: block and place in it. `hash`: the program has it, too."""

    blocks: list[Block]
    calls: list[tuple[int, str, int | None]]
    masked: list[tuple[int, int]]
    repeated: list[tuple[int, int]]
    hash: str = ""


def table(sources: list[Source], counters: Counters) -> Table:
    made = Table([], [], list(counters.masked), list(counters.repeated))
    for source in sources:
        for number, one in enumerate(source.blocks, source.first):
            place = source.path.name, one.section, one.offset, one.code.hex()
            made.blocks.append(Block(one.function, one.entry, *place))
            if one.callee:
                callee = source.aliases.get(one.callee, one.callee)
                made.calls.append((number, callee, number + 1 if one.conditional else None))
    made.hash = hashlib.sha256(msgspec.json.encode(made)).hexdigest()
    return made


def _assemble(compiler: list[str], text: str, path: Path, name: str) -> Path:
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
    for path in paths:
        sources.append(Source(path, sum(len(s.blocks) for s in sources)))
        obj = _assemble(compiler, sources[-1].marked(), folder / "plain", path.stem)
        sources[-1].locate(obj)
    counters = Counters.of(sources)
    for source in sources:
        _assemble(compiler, source.counted(counters), folder / "counted", source.path.stem)
    made = table(sources, counters)
    header = [
        "// Written by scripts/study/counting/assembly.py.",
        f"#define BLOCKS {counters.blocks}",
        f"#define MASKED {len(counters.masked)}",
        f"#define REPEATED {len(counters.repeated)}",
        f'#define TABLE_HASH "{made.hash}"',
    ]
    store.write_text(folder / "blocks_table.h", "\n".join(header) + "\n")
    store.write_json(folder / "table.json", made)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cc", default="cc", help="what assembles (%(default)s)")
    parser.add_argument("folder", type=Path, help="where plain/, counted/ and table.json are made")
    parser.add_argument("sources", type=Path, nargs="+", metavar="FILE.s", help="of one program")
    args = parser.parse_args()
    instrument(shlex.split(args.cc), args.sources, args.folder)


if __name__ == "__main__":
    cli.main(main)
