"""The artifact appendix's table: a claim, the command that shows it, its minutes, what a run found."""

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from study.core import provenance, show
from study.core.registry import ROOT
from study.experiments.section import Section
from study.numbers.analysis import Data
from study.report import published_tables


class Claim(NamedTuple):
    """`minutes`: on two cores, of a project that is built. `chapter`: of the report, whose first sentence is
    what a run found; without one, `found` says what the command must say."""

    text: str
    command: str
    minutes: int
    chapter: str = ""
    found: str = ""


CLAIMS = (
    Claim("It builds and draws", "make demo", 1, found="a picture by two phases, and the error between them"),
    Claim("Every step is timed against baseline, with its error", "make sweep", 3, "ladder"),
    Claim("Pictures are baseline's, within declared tolerances", "make verify", 2, "verification"),
    Claim("Errors to the exact picture are known, and declared", "make accuracy", 4, "accuracy"),
    Claim(
        "The exact picture is proved: enclosures hold the roots",
        "make enclosures",
        3,
        found="0 tests fail",
    ),
    Claim("Declared FLOPs are the executed ones", "scripts/stepwise flops --validate", 6, "flops"),
    Claim("Each phase is held under the machine's roofs", "make roofline", 2, "roofline"),
    Claim("Each idea is measured alone", "make ablations", 6, "ablations"),
    Claim("Cases with known answers show where phases fail", "make stability", 4, "stability"),
    Claim("Speed can be had for error", "make pareto", 2, "pareto"),
    Claim("The papers' claims are judged", "make study DEPTH=standard", 40, "claims"),
    Claim("The paper's own program is no faster than ours", "make original", 5, found="a ratio a phase"),
    Claim("Other renderers are timed in the same run", "scripts/stepwise peers --install", 15, "peers"),
)


def block(data: Data, sections: Sequence[Section]) -> str:
    """The table, from the chapters of a run."""
    answers = {one.id: one.answer for one in sections}
    lines = [
        [
            one.text,
            f"`{one.command}`",
            str(one.minutes),
            one.found or answers.get(one.chapter) or show.NOTHING,
        ]
        for one in CLAIMS
    ]
    table = published_tables.markdown(["claim", "command", "minutes", "what a run found"], lines)
    path = data.path.resolve()
    run = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path.name
    note = f"Run `{run}`: {show.inert(provenance.place(data.context))}."
    return f"{table}\n{textwrap.fill(note, 100)}\n"
