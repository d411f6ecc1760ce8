"""What did not pay: single steps that gain nothing or cost too much of the picture, measured in this run, and
the table of ideas that were tried, docs/what-did-not-pay.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import cli, html, machine, registry, show
from study.core.cli import StudyError
from study.core.show import Column
from study.experiments.ablations.chapter import decibels, gain
from study.experiments.ablations.schema import FILE, IDEAS_FILE, Ablations, Ideas, Row
from study.experiments.section import Section, part
from study.numbers import verdicts
from study.pictures.draw import BAD, Drawing

DOCUMENT = registry.ROOT / "docs" / "what-did-not-pay.md"
COLUMNS = ("idea", "phase", "expected", "measured", "machine", "why")  # of its one table
PAYS, COSTS, NOTHING_GAINED, SLOWER = "pays", "pays, at that error", "no gain", "slower"
ABOUT = (
    "Shown are all scenes of a step whose gain is not clear on every one of them, or whose picture is only "
    f"approximate. “No gain”: all of the interval is below {verdicts.NO_GAIN:g}; “{verdicts.UNSURE}”: it "
    "holds 1 and reaches beyond that.\n"
    "PSNR is of single samples, which on the Mandelbulb are chaotic: there the verdict is by 4×4 means."
)
TRIED = "Each was measured once, on the machine that its row names, and not again in this run."


def outcome(row: Row) -> str:
    """What a step is worth on a scene, its whole interval asked."""
    _, low, high = row.gain.ends
    if not math.isfinite(low):
        return verdicts.TOO_FEW
    if low > 1:
        return COSTS if row.verdict in ("approximate", "OUTSIDE") else PAYS
    if high < 1:
        return SLOWER
    return NOTHING_GAINED if high <= verdicts.NO_GAIN else verdicts.UNSURE


def chosen(result: Ablations | None) -> list[Row]:
    """All rows of the steps that do not plainly pay on each of their scenes."""
    rows = result.rows if result else []
    names = {row.ablation for row in rows if outcome(row) != PAYS}
    return [row for row in rows if row.ablation in names]


def _what(row: Row) -> str:
    """A phase's own step has a patch that takes it out: the gain is the step's, the text the patch's."""
    taken = row.step == "removed"
    return f"left out: {row.what}; the gain is of what was left out" if taken else row.what


STEPS = [
    Column("", "step", lambda r: r.ablation),
    Column("", "what", _what),
    Column("", "scene", lambda r: r.scene),
    Column("", "gain of the step [95 %]", gain),
    Column("PSNR to baseline, dB", "patched", decibels("psnr_db")),
    Column("PSNR to baseline, dB", "without the patch", decibels("against_psnr_db")),
    Column("", "pixels off > 1/255", lambda r: show.percent(r.fraction_over_1_255)),
    Column("", "picture", lambda r: r.verdict),
    Column("", "outcome", outcome, lambda r: "bad" if outcome(r) == SLOWER else ""),
]


def draw(rows: Sequence[Row]) -> Figure:
    """A line a step and scene: its gain with the interval, and what it does to the picture."""
    figure = Figure(figsize=(10, 0.42 * len(rows) + 1.7), layout="constrained")
    figure.suptitle("Steps that did not plainly pay", x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    axes.axvline(1, color="#888888", linewidth=1)
    for place, row in enumerate(rows):
        value, low, high = row.gain.ends
        colour = {SLOWER: BAD, PAYS: "#009E73"}.get(outcome(row), "#E69F00")
        if math.isfinite(low):
            axes.plot([low, high], [place] * 2, color=colour, linewidth=2.2)
        axes.plot([value], [place], "o", color=colour, markersize=6)
        before, after = (decibels(name)(row) for name in ("against_psnr_db", "psnr_db"))
        unit = "" if before == "identical" else " dB"
        same = f"as before: {before}{unit}" if before == after else f"{before} → {after} dB"
        end = high if math.isfinite(high) else value
        axes.annotate(same, (end, place), (8, 0), textcoords="offset points", fontsize=8, va="center")
    axes.set_yticks(range(len(rows)), [f"{row.ablation}, {row.scene}" for row in rows], fontsize=8.5)
    axes.set(
        xlabel="time without the step over time with it: left of 1 it costs time",
        ylim=(len(rows) - 0.5, -0.5),
    )
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, 0.95), max(high, 1.05) + 0.16 * (max(high, 1.05) - min(low, 0.95)))
    kinds = ((SLOWER, BAD), ("no gain, untold, or at an error", "#E69F00"), ("pays on this scene", "#009E73"))
    marks = [Line2D([], [], color=c, marker="o", linewidth=2.2, label=text) for text, c in kinds]
    figure.legend(handles=marks, loc="outside upper right", ncols=3, frameon=False, fontsize=9)
    return figure


def tried(document: Path = DOCUMENT) -> list[list[str]]:
    """The rows of the document's table, a cell for each of COLUMNS. Raises StudyError for another form."""
    rows = []
    for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
            if len(rows[-1]) != len(COLUMNS) or not all(rows[-1]):
                raise StudyError(f"{document}:{number}: a row has {len(COLUMNS)} cells: {', '.join(COLUMNS)}")
    if len(rows) < 2 or tuple(rows[0]) != COLUMNS:
        raise StudyError(f"{document}: no table with the columns {', '.join(COLUMNS)}")
    return rows[2:]  # without its heading and the line below that


def as_html(rows: Sequence[Sequence[str]]) -> str:
    """The table for the page; neither HTML nor pictures pass through."""
    if not rows:
        return ""
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows]
    table = html.markdown().render("\n".join(f"| {' | '.join(line)} |" for line in lines))
    summary = f"Ideas that were tried, from docs/what-did-not-pay.md: {len(rows)}"
    return (
        f'<details><summary>{summary}</summary><div class="scroll prose">{table}</div>'
        f'<p class="small">{TRIED}</p></details>'
    )


def section(path: Path, document: Path = DOCUMENT) -> Section:
    """The page of negative results: of a run's ablations and ideas, and from the document as it is now."""
    result = Ablations.load_if_there(path / FILE)
    rows, drawn = chosen(result), {}
    if result and rows:
        caption = "Gain of steps that did not plainly pay, and what they do to the picture"
        how = f"n = {result.n}, {result.launches} interleaved launches; PSNR to baseline, linear RGB."
        note = f"{machine.name(cli.plain(result.context))}; {how}"
        drawn = {"negative": Drawing(caption, note, lambda: draw(rows))}
    both = [*rows, *chosen(Ideas.load_if_there(path / IDEAS_FILE))]
    parts = part("negative", "Steps that did not plainly pay", both, STEPS, ABOUT)
    about = {"file": path / FILE, "script": "scripts/stepwise ablations", "drawn": drawn}
    about |= {"answer": _answer(both), "html": as_html(tried(document))}
    return Section("negative", "What did not pay", "make ablations", parts, **about)


def _answer(rows: Sequence[Row]) -> str:
    """How many steps did not plainly pay, how many are slower, and the slowest."""
    if not rows:
        return ""
    text = f"{len({row.ablation for row in rows})} steps do not plainly pay on each of their scenes"
    if slower := [row for row in rows if outcome(row) == SLOWER]:
        worst = min(slower, key=lambda row: row.gain.ends[0])
        text += (
            f"; {len({row.ablation for row in slower})} of them are slower somewhere, most of all "
            f"{worst.ablation} on {worst.scene}: {gain(worst)}"
        )
    return f"{text}."
