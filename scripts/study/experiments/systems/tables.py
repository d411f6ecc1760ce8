"""The chapter of what other articles built: alternatives to the ladder, each from its own file of the run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from study.core import provenance, show
from study.core.show import Column
from study.experiments import experiment
from study.experiments.section import Claim, Section, part
from study.experiments.systems.pictures import CAPTION, PICTURES

CLAIMS = [
    Column("", "article", show.word("article")),
    Column("", "claim", show.word("claim")),
    Column("", "said", show.word("said")),
    Column("", "here [95 %]", show.word("ours")),
    Column("", "ratio [95 %]", show.word("ratio")),
    Column("", "error to ground truth", show.word("error")),
]


def section(run: Path) -> Section:
    """One table with a row for each figure that an article states, then what each system's file has."""
    sheet = run / "images" / f"{PICTURES}.png"
    drawn, images = {}, {sheet: CAPTION} if sheet.exists() else {}
    claims: list[Claim] = []
    parts, notes, files = [], [], []
    for one in experiment.find_all().values():
        if one.system and (found := one.system(run)):
            claims += found.claims
            parts += found.parts
            notes += [found.note] * bool(found.note)
            files += one.schemas
            drawn |= found.drawn
            images |= found.images
    notes.append(provenance.disturbed(run, files))
    table = part("systems", "Systems of other articles, and ours", claims, CLAIMS, "\n".join(notes))
    return Section(
        "systems",
        "Other systems",
        "make systems",
        table + parts,
        answer=_answer(claims),
        file=run,
        script="scripts/stepwise redraw",
        drawn=drawn,
        images=images if parts else {},
    )


def _answer(claims: Sequence[Claim]) -> str:
    """The span of the ratios to Embree, measured beside it, and of those to what articles state of theirs."""
    said = []
    for found, what in (
        ([c.beside for c in claims if c.beside], "as fast as Embree's, side by side on this machine"),
        ([c.speed for c in claims if c.speed], "as fast as the articles' own figures, of other machines"),
    ):
        if found:
            said.append(f"{show.number(min(found))}× to {show.number(max(found))}× {what}")
    return f"Our systems are {'; '.join(said)}." if said else ""
