"""What did not pay: single steps that gain nothing or cost too much of the picture, measured in this run, and
the table of ideas that were tried, docs/what-did-not-pay.md."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import html, machine, registry, show
from study.core.cli import StudyError
from study.core.show import Column
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.section import Section, part, reading
from study.numbers import verdicts
from study.pictures.draw import BAD, Drawing

DOCUMENT = registry.ROOT / "docs" / "what-did-not-pay.md"
COLUMNS = ("idea", "phase", "expected", "measured", "machine", "why")  # of its one table
PAYS, COSTS, NOTHING_GAINED, SLOWER = "pays", "pays, at that error", "no gain", "slower"
UNTOLD = verdicts.UNSURE  # 1 is in the interval, and so is a gain
ABOUT = (
    "Shown are all scenes of a step whose gain is not clear on every one of them, or whose picture is only "
    f"approximate. “No gain”: all of the interval is below {verdicts.NO_GAIN:g}; “{verdicts.UNSURE}”: it "
    "holds 1 and reaches beyond that.\n"
    "PSNR is of single samples, which on the Mandelbulb are chaotic: there the verdict is by 4×4 means."
)
TRIED = "Each was measured once, on the machine that its row names, and not again in this run."
Row = dict[str, Any]


def _ends(row: Mapping[str, Any]) -> tuple[float, float, float]:
    gain = row["gain"]
    return tuple(math.nan if gain[k] is None else gain[k] for k in ("value", "low", "high"))


def outcome(row: Mapping[str, Any]) -> str:
    """What a step is worth on a scene, its whole interval asked."""
    _, low, high = _ends(row)
    if not math.isfinite(low):
        return verdicts.TOO_FEW
    if low > 1:
        return COSTS if row["verdict"] in ("approximate", "OUTSIDE") else PAYS
    if high < 1:
        return SLOWER
    return NOTHING_GAINED if high <= verdicts.NO_GAIN else UNTOLD


def chosen(rows: Iterable[Mapping[str, Any]]) -> list[Row]:
    """All rows of the steps that do not plainly pay on each of their scenes, with their outcome."""
    judged = [{**row, "outcome": outcome(row)} for row in rows]
    names = {row["ablation"] for row in judged if row["outcome"] != PAYS}
    return [row for row in judged if row["ablation"] in names]


def _what(row: Row) -> str:
    """A phase's own step has a patch that takes it out: the gain is the step's, the text the patch's."""
    return (
        f"left out: {row['what']}; the gain is of what was left out"
        if row.get("step") == "removed"
        else row["what"]
    )


def _gain(row: Row) -> str:
    value, low, high = _ends(row)
    return show.interval({"v": value, "v_low": low, "v_high": high}, "v", 3, "×")


def _db(name: str):
    return lambda row: "identical" if row[name] is None else show.number(row[name])


STEPS = [
    Column("", "step", lambda r: r["ablation"]),
    Column("", "what", _what),
    Column("", "scene", lambda r: r["scene"]),
    Column("", "gain of the step [95 %]", _gain),
    Column("PSNR to baseline, dB", "patched", _db("psnr_db")),
    Column("PSNR to baseline, dB", "without the patch", _db("against_psnr_db")),
    Column("", "pixels off > 1/255", lambda r: show.percent(r["fraction_over_1_255"])),
    Column("", "picture", lambda r: r["verdict"]),
    Column("", "outcome", lambda r: r["outcome"], lambda r: "bad" if r["outcome"] == SLOWER else ""),
]


def draw(rows: Sequence[Row]) -> Figure:
    """A line a step and scene: its gain with the interval, and what it does to the picture."""
    figure = Figure(figsize=(10, 0.42 * len(rows) + 1.7), layout="constrained")
    figure.suptitle("Steps that did not plainly pay", x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    axes.axvline(1, color="#888888", linewidth=1)
    for place, row in enumerate(rows):
        value, low, high = _ends(row)
        colour = BAD if row["outcome"] == SLOWER else "#E69F00" if row["outcome"] != PAYS else "#009E73"
        if math.isfinite(low):
            axes.plot([low, high], [place] * 2, color=colour, linewidth=2.2)
        axes.plot([value], [place], "o", color=colour, markersize=6)
        before, after = (_db(name)(row) for name in ("against_psnr_db", "psnr_db"))
        unit = "" if before == "identical" else " dB"
        same = f"as before: {before}{unit}" if before == after else f"{before} → {after} dB"
        end = high if math.isfinite(high) else value
        axes.annotate(same, (end, place), (8, 0), textcoords="offset points", fontsize=8, va="center")
    axes.set_yticks(range(len(rows)), [f"{row['ablation']}, {row['scene']}" for row in rows], fontsize=8.5)
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


def tried(document: Path = DOCUMENT) -> list[dict[str, str]]:
    """The rows of the document's table. Raises StudyError for a file or a row that is not of its form."""
    try:
        lines = document.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{document}: {getattr(error, 'strerror', None) or error}") from None
    rows = []
    for number, line in enumerate(lines, 1):
        if not line.startswith("|"):
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) != len(COLUMNS) or not all(cells):
            raise StudyError(f"{document}:{number}: a row has {len(COLUMNS)} cells: {', '.join(COLUMNS)}")
        rows.append(dict(zip(COLUMNS, cells, strict=True)))
    if len(rows) < 2 or tuple(rows[0].values()) != COLUMNS:
        raise StudyError(f"{document}: no table with the columns {', '.join(COLUMNS)}")
    return rows[2:]  # without its heading and the line below that


def as_html(rows: Sequence[Mapping[str, str]]) -> str:
    """The table for the page; neither HTML nor pictures pass through."""
    if not rows:
        return ""
    lines = [COLUMNS, ["---"] * len(COLUMNS), *(list(row.values()) for row in rows)]
    table = html.markdown().render("\n".join(f"| {' | '.join(line)} |" for line in lines))
    summary = f"Ideas that were tried, from docs/what-did-not-pay.md: {len(rows)}"
    return (
        f'<details><summary>{summary}</summary><div class="scroll prose">{table}</div>'
        f'<p class="small">{TRIED}</p></details>'
    )


def section(path: Path, document: Path = DOCUMENT) -> Section:
    """The page of negative results: of a run's ablations and ideas, and from the document as it is now."""
    file = path / "ablations.json"
    rows: list[Row] = []
    drawn = {}
    with reading(file, f"scripts/stepwise ablations --run {path}"):
        rows = chosen(ablations.read(file)["rows"])
        if rows:
            caption = "Gain of steps that did not plainly pay, and what they do to the picture"
            drawn = {"negative": Drawing(caption, _note(ablations.read(file)), lambda: draw(rows))}
    with reading(path / ideas.FILE, f"scripts/stepwise ideas --run {path}"):
        both = [*rows, *chosen(ablations.read(path / ideas.FILE)["rows"])]
        parts = part("negative", "Steps that did not plainly pay", both, STEPS, ABOUT)
    about = {
        "file": file,
        "script": "scripts/stepwise ablations",
        "drawn": drawn,
        "html": as_html(tried(document)),
    }
    answer = _answer(both)
    return Section("negative", "What did not pay", "make ablations", parts, answer=answer, **about)


def _answer(rows: Sequence[Row]) -> str:
    """How many steps did not plainly pay, how many are slower, and the slowest."""
    if not rows:
        return ""
    names = {row["ablation"] for row in rows}
    slower = [row for row in rows if row["outcome"] == SLOWER]
    text = f"{len(names)} steps do not plainly pay on each of their scenes"
    if slower:
        worst = min(slower, key=lambda row: row["gain"]["value"])
        text += (
            f"; {len({row['ablation'] for row in slower})} of them are slower somewhere, most of all "
            f"{worst['ablation']} on {worst['scene']}: {_gain(worst)}"
        )
    return f"{text}."


def _note(result: Mapping[str, Any]) -> str:
    cpu = machine.name(result.get("context"))
    return (
        f"{cpu}; n = {result['n']}, {result['launches']} interleaved launches; PSNR to baseline, linear RGB."
    )
