"""Chapters of the report that belong to no experiment: claims, pictures, phases, machine, units."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Any

import msgspec
import pandas as pd
from matplotlib.figure import Figure

from study.claims import claims
from study.claims.claims import Checked
from study.core import html, patches, registry
from study.core.registry import Phase
from study.core.run_schema import PhaseJson
from study.experiments import experiment
from study.experiments.section import Section, part
from study.numbers import analysis, columns, paper, verdicts
from study.numbers.analysis import Data
from study.pictures import embed
from study.pictures.draw import Drawing
from study.report import compared, facts, history_chapter, lessons, programs_chapter

MORE = 6  # the question of a chapter whose place is of no other
PICTURES = {  # of stepwise pictures
    "contact-sheet.png": "Every scene by every phase, with its error against baseline",
    "evaluations.png": "Distance evaluations of each camera ray of baseline: where the time goes",
}
COLOURS = dict(
    zip(verdicts.WORDS, ("#009E73", "#8CCFB9", "#b3261e", "#E69F00", "#e0e0e0", "#bdbdbd"), strict=True)
)
PAPERS = (
    "P1: Isik, El Okaili, Cavaleri and Graf, A highly optimized CPU rendering engine using raymarcher based "
    "on sphere tracing (ETH Zurich, 2020), on an i7-7700 at 3.6 GHz. P2: a real-time ray tracer. P3: an "
    "integer ray tracer on the TILE-Gx. P4: rod marching. Lines: of the texts that results/paper names.\n"
    "A figure within 10 % of the stated one holds. “In part”: the same direction and less of it. What does "
    "not hold here is not thereby refuted there: machine, compiler and program are others."
)
RERUN = (
    "By its tables: cycles = FLOPs / (FLOPs per cycle). “Its program, run again”: the authors' public "
    "program at 1280×720 on one thread of a Zen 5 virtual machine, errors against its own baseline. Its opt4 "
    "changes the hit distance, the fog and the bounds; here no phase changes a parameter of a scene."
)


def by_paper(found: Sequence[Checked]) -> dict[str, Counter[str]]:
    """Paper → how many of its claims have which verdict."""
    counts: dict[str, Counter[str]] = {}
    for claim in found:
        word = next(word for word in verdicts.WORDS if claim.verdict.startswith(word))
        counts.setdefault(claim.text, Counter())[word] += 1
    return dict(sorted(counts.items()))


def _draw(found: Sequence[Checked]) -> Figure:
    counts = by_paper(found)
    figure = Figure(figsize=(9, 0.5 * len(counts) + 1.5), layout="constrained")
    figure.suptitle("What became of the papers' claims here", x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    left = dict.fromkeys(counts, 0)
    for word, colour in COLOURS.items():
        many = [counts[name][word] for name in counts]
        if any(many):
            bars = axes.barh(list(counts), many, 0.7, list(left.values()), color=colour, label=word)
            axes.bar_label(bars, [str(one) if one else "" for one in many], label_type="center", fontsize=8)
        left = {name: left[name] + counts[name][word] for name in counts}
    axes.invert_yaxis()
    axes.set_xlabel("claims")
    axes.grid(False, axis="y")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8.5)
    return figure


def reproduced(data: Data, rows: pd.DataFrame) -> Section:
    found = claims.check(data, rows)
    totals = sum(by_paper(found).values(), Counter())
    said = [f"{totals[word]} “{word}”" for word in verdicts.WORDS if totals[word]]
    measured = any(word not in (verdicts.OPEN, verdicts.NEVER) for word in totals)
    answer = f"Of {len(found)} claims, here: {', '.join(said)}." if measured else ""
    about = "The claims register: what the papers say, and what this run says"
    parts = part("claims", about, found, claims.COLUMNS, PAPERS)
    theirs = paper.ladder().to_dict("records")
    parts += part(
        "paper", "The paper's ladder, by its tables and by its program", theirs, columns.PAPER, RERUN
    )
    note = "P1 is the paper, P2 a ray tracer, P3 a ray tracer in integers, P4 rod marching. "
    note += "Each claim is judged by this run's own numbers; results/paper/README.md has the rules."
    drawn = {"claims": Drawing("The papers' claims by verdict", note, lambda: _draw(found))}
    title, make = "The papers' numbers and claims", "make study"
    return Section("claims", title, make, parts, answer=answer, script="scripts/stepwise report", drawn=drawn)


def pictures(data: Data) -> Section:
    """What stepwise pictures draws, and the verified pictures to compare."""
    images = {data.path / "figures" / name: text for name, text in PICTURES.items()}
    images = {path: text for path, text in images.items() if path.is_file()}
    answer = f"{next(iter(images.values()))}." if images else ""
    lacking = "scripts/stepwise pictures --run RUN"
    html = partial(compared.fragment, data)
    return Section("pictures", "Pictures", lacking, [], answer=answer, images=images, fragment=html)


def notes_html(text: str) -> str:
    """A phase's NOTES.md as HTML below the page's own headings; neither HTML nor pictures pass through, and
    a link to a file of the project is its words alone."""
    text = re.sub(r"^!\[[^\]]*\]\([^)]*\)$", "", text, flags=re.MULTILINE)
    text = re.sub(r"\[([^\]]*)\]\((?![a-z]+://)[^)]*\)", r"\1", text)
    markdown = html.markdown()
    tokens = markdown.parse(text)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1]) + 3, 6)}"
    return markdown.renderer.render(tokens, markdown.options, {})


def described(data: Data) -> list[dict[str, Any]]:
    """What each phase of the run is, as recorded with it, and its NOTES.md as it is now. Of one that is built
    for several numbers of lanes, what ran: lanes, instruction sets, flags.
    """
    about: dict[str, Phase | PhaseJson] = {**analysis.described(data.plan)}
    if not about:
        measured = {cell.spec.partition("@")[0] for cell in data.cells}
        about = {name: phase for name, phase in registry.phases().items() if name in measured}
    ran = {cell.spec: cell.facts for cell in data.cells}
    made = []
    for name, one in about.items():
        phase = msgspec.structs.asdict(one)
        if one.variants and name in ran:
            own = ran[name]
            phase |= {"lanes": int(own.lanes or 1), "isa": (own.isa or "").split("+"), "cflags": own.flags}
        file = patches.folders().get(name, registry.ROOT) / "NOTES.md"
        notes = notes_html(file.read_text(encoding="utf-8")) if file.is_file() else None
        figure = file.with_name(lessons.NAME)
        lesson = embed.data_uri(figure.read_bytes(), "svg+xml") if notes and figure.is_file() else None
        made.append({**phase, "notes": notes, "lesson": lesson})
    return made


def phases(data: Data) -> Section:
    """A line a phase, and its lesson behind its title."""
    found = described(data)
    answer = ""
    if found:
        last = f", from {found[0]['name']} to {found[-1]['name']}" if len(found) > 1 else ""
        answer = f"The run has {len(found)} phase{'s' * (len(found) > 1)}{last}; each has a lesson."
    return Section("phases", "The phases", "", [], answer=answer)


def ran(data: Data) -> Section:
    """Machine, noise, what was left out, the commands that make it again."""
    known = dict(facts.machine(data))
    told = {"CPU": "", "compiler": "", "measured frames": "measured frames: "}
    said = [f"{before}{known[label]}" for label, before in told.items() if label in known]
    answer = f"{'; '.join(said)}." if said else ""
    return Section("machine", "Machine, noise, commands", "", [], answer=answer)


def asked(data: Data, rows: pd.DataFrame) -> dict[str, list[Section]]:
    """Question → its chapters, both in their order."""
    measured = experiment.placed(data)  # first: it names a broken file
    own = [
        (300, reproduced(data, rows)),
        (190, history_chapter.over_time(data, rows)),
        (650, pictures(data)),
        (660, phases(data)),
        (700, ran(data)),
        (710, Section("units", "Units and method", "", [])),
    ]
    if data.plan.programs:  # of other programs there is nothing else to say
        ran_how = list(experiment.QUESTIONS.values())[-1]
        return {
            programs_chapter.QUESTION: [programs_chapter.timed(data)],
            ran_how: [one for _, one in own[-2:]],
        }
    made: dict[str, list[Section]] = {text: [] for text in experiment.QUESTIONS.values()}
    for place, section in sorted([*measured, *own], key=lambda each: each[0]):
        made[experiment.QUESTIONS.get(place // 100, experiment.QUESTIONS[MORE])].append(section)
    return made
