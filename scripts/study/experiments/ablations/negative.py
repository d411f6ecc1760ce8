"""What did not pay: the table of ideas that were tried, docs/what-did-not-pay.md, and how many single steps
of this run gain nothing or cost too much of the picture (their rows are in the chapter of single steps)."""

from collections.abc import Sequence
from pathlib import Path

from study.core import html, registry
from study.core.cli import StudyError
from study.experiments.ablations.chapter import PAYS, SLOWER, gain, outcome
from study.experiments.ablations.schema import FILE, SCHEMAS, Row
from study.experiments.section import Section

DOCUMENT = registry.ROOT / "docs" / "what-did-not-pay.md"
COLUMNS = ("idea", "phase", "expected", "measured", "machine", "why")  # of its one table
TRIED = "Each was measured once, on the machine that its row names, and not again in this run."


def tried(document: Path = DOCUMENT) -> list[list[str]]:
    """The rows of the document's table, a cell for each of COLUMNS. Raises StudyError for another form."""
    rows = []
    for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
            if len(rows[-1]) != len(COLUMNS) or not all(rows[-1]):
                raise StudyError(f"{document}:{number}: a row has {len(COLUMNS)} cells: {', '.join(COLUMNS)}")
    return rows[2:]  # without its heading and the line below that


def as_html(rows: Sequence[Sequence[str]]) -> str:
    """The table for the page; neither HTML nor pictures pass through."""
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows]
    table = html.markdown().render("\n".join(f"| {' | '.join(line)} |" for line in lines))
    summary = f"Ideas that were tried, from docs/what-did-not-pay.md: {len(rows)}"
    return (
        f'<details><summary>{summary}</summary><div class="scroll prose">{table}</div>'
        f'<p class="small">{TRIED}</p></details>'
    )


def section(path: Path, document: Path = DOCUMENT) -> Section:
    """The page of negative results: the document as it is now, and a sentence of this run."""
    results = [kind.load_if_there(path / name) for name, kind in SCHEMAS.items()]
    rows = [row for result in results for row in (result.rows if result else ())]
    about = {"file": path / FILE, "script": "scripts/stepwise ablations", "answer": answer(rows)}
    return Section(
        "negative", "What did not pay", "make ablations", [], html=as_html(tried(document)), **about
    )


def answer(rows: Sequence[Row]) -> str:
    """How many steps did not plainly pay on each of their scenes, how many are slower, and the slowest."""
    names = {row.ablation for row in rows if outcome(row) != PAYS}
    if not names:
        return ""
    text = f"{len(names)} steps do not plainly pay on each of their scenes"
    if slower := [row for row in rows if outcome(row) == SLOWER]:
        worst = min(slower, key=lambda row: row.gain.ends[0])
        text += (
            f"; {len({row.ablation for row in slower})} of them are slower somewhere, most of all "
            f"{worst.ablation} on {worst.scene}: {gain(worst)}"
        )
    return f"{text}."
