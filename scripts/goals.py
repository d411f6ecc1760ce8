#!/usr/bin/env python3
"""What was set out to be reached, beside what runs have of it: a column per machine, met or missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from study import cli  # first: it may start the script again with the venv's Python

# isort: split
from study import analysis, goals_page, show, store
from study.cli import StudyError
from study.readme import between
from study.registry import ROOT

README, WHOLE = ROOT / "README.md", ROOT / "results" / "reference" / "goals.md"
BEGIN, END = "<!-- goals:begin -->", "<!-- goals:end -->"


def marked(text: str, table: str, note: str) -> str:
    """A page's text with the block between the marks made anew. Raises StudyError without marks."""
    return between(text, BEGIN, END, f"{table}\n{note}\n")


def pages(found: Sequence[goals_page.Row], used: Mapping[str, str]) -> dict[Path, tuple[str, str]]:
    """Page -> its table and the note below: README's verdicts, and the page that has all of it."""
    short = show.markdown(show.table(goals_page.briefly(found), goals_page.brief_columns(list(used))))
    whole = show.markdown(show.table(found, goals_page.columns(list(used))))
    return {README: (short, goals_page.BRIEF_NOTE), WHOLE: (whole, note(used, found))}


def note(used: Mapping[str, str], found: Sequence[goals_page.Row]) -> str:
    """Below the table; `used`: machine → its runs; `found`: the table's rows."""
    told = " ".join(filter(None, (goals_page.NOTE, goals_page.by_other_cycles(found))))
    return f"{told} Runs: {'; '.join(f'{here}: {runs}' for here, runs in used.items())}."


def main() -> int:
    parser = cli.parser(__doc__)
    add = parser.add_argument
    add("runs", nargs="*", type=Path, metavar="RUN", help="folders of runs (all of results/reference)")
    add(
        "--readme", action="store_true", help="rewrite the tables of README.md and results/reference/goals.md"
    )
    args = parser.parse_args()
    folders = args.runs or sorted(p.parent for p in (ROOT / "results" / "reference").glob("*/context.json"))
    if not folders:
        raise StudyError(f"{ROOT / 'results' / 'reference'}: has no run; name one")
    found, used = goals_page.rows([analysis.load(folder, strict=False) for folder in folders])
    if not found:
        raise StudyError(f"{', '.join(map(str, folders))}: no figure that a goal is about; make sweep N=720")
    if args.readme:
        for page, block in pages(found, used).items():
            try:
                store.write_text(page, marked(page.read_text(encoding="utf-8"), *block))
            except OSError as error:
                raise StudyError(f"{page}: {error.strerror}") from None
            print(page)
    elif args.json:
        cli.emit({"goals": found, "runs": used})
    else:
        table, said = pages(found, used)[WHOLE]
        print(f"{table}\n{said}")
    return cli.OK


if __name__ == "__main__":
    cli.main(main)
