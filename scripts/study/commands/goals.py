"""What was set out to be reached, beside what runs have of it: a column per machine, met or missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from study.core import cli, provenance, show, store
from study.core.cli import StudyError
from study.core.marked_blocks import between
from study.core.registry import ROOT
from study.numbers import analysis
from study.report import goals_page

PAGE = ROOT / "results" / "reference" / "goals.md"
BEGIN, END = "<!-- goals:begin -->", "<!-- goals:end -->"


def marked(text: str, table: str, note: str) -> str:
    """A page's text with the block between the marks made anew. Raises StudyError without marks."""
    return between(text, BEGIN, END, f"{table}\n{note}\n")


def page(found: Sequence[goals_page.Row], used: Mapping[str, str]) -> tuple[str, str]:
    """The table, and the note below. `used`: machine → its runs."""
    runs = "; ".join(show.inert(f"{here}: {names}") for here, names in used.items())
    return show.markdown(
        show.table(found, goals_page.columns(list(used)))
    ), f"{goals_page.NOTE} Runs: {runs}."


def main() -> int:
    parser = cli.parser(__doc__)
    add = parser.add_argument
    add("runs", nargs="*", type=Path, metavar="RUN", help="their folders; default: all of results/reference")
    add("--write", action="store_true", help="rewrite the table of results/reference/goals.md")
    cli.add_unclean(parser)
    args = parser.parse_args()
    folders = args.runs or sorted(p.parent for p in (ROOT / "results" / "reference").glob("*/context.json"))
    if not folders:
        raise StudyError(f"{ROOT / 'results' / 'reference'}: has no run; name one")
    for folder in folders:
        provenance.need_clean(folder, args.unclean)
    runs = [analysis.load(folder, strict=False) for folder in folders]
    found, used = goals_page.rows(runs, checked=not args.runs)
    if not found:
        raise StudyError(f"{', '.join(map(str, folders))}: no figure that a goal is about; make sweep N=720")
    if args.write:
        try:
            store.write_text(PAGE, marked(PAGE.read_text(encoding="utf-8"), *page(found, used)))
        except OSError as error:
            raise StudyError(f"{PAGE}: {error.strerror}") from None
        print(PAGE)
    elif args.json:
        cli.emit({"goals": found, "runs": used})
    else:
        print("\n".join(page(found, used)))
    return cli.OK
