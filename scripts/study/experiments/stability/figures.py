"""All hard cases as one figure, made from stability.json alone."""

from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from study.experiments.stability.cases import curves, measure
from study.experiments.stability.schema import Stability
from study.pictures.draw import ON_PAPER

CAPTION = "How far each phase gets in each hard case before it first fails"
COLOURS = ("#7a0c05", "#d9694f", "#f6d5c3")  # fails at the first strength … at the last
RIGHT, REFUSES = "#bfe3d6", "#dddddd"


def draw(data: Stability) -> Figure:
    """A line a case, a column a phase: the first strength that fails, darker the easier it is. Paper has no
    room for its number."""
    names = [phase.name for phase in data.phases]
    paper = ON_PAPER.get()
    width = 8.0 if paper else max(8.0, 3.6 + 0.72 * len(names))  # titles of the cases take half of the least
    figure = Figure(figsize=(width, (0.2 if paper else 0.235) * len(data.cases) + 1.9), layout="constrained")
    title = "The first strength of each hard case at which a phase fails"
    figure.suptitle("" if paper else title, x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    fading = LinearSegmentedColormap.from_list("failures", COLOURS)
    found = {(row.number, row.phase): row for row in data.results}
    for line, case in enumerate(data.cases):
        for column, name in enumerate(names):
            row = found[case.number, name]
            share = row.place / len(row.strengths)
            colour = REFUSES if row.refused else RIGHT if share == 1 else fading(share)
            axes.barh(line, 0.94, 0.9, column - 0.47, color=colour)
            if row.first_failure is not None and not row.refused and not paper:
                ink = "white" if share < 0.4 else "black"
                text = curves.number(row.first_failure)
                axes.text(column, line, text, fontsize=7, ha="center", va="center", color=ink)
    axes.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(data.cases) - 0.5, -0.5))
    axes.set_yticks(range(len(data.cases)), [f"{c.number}. {c.title}" for c in data.cases], fontsize=8)
    axes.set_xticks(range(len(names)), names, rotation=45, ha="right", rotation_mode="anchor", fontsize=8.5)
    axes.grid(False)
    axes.tick_params(length=0)
    kinds = (
        ("never fails", RIGHT),
        ("fails late", COLOURS[2]),
        ("fails at once", COLOURS[0]),
        ("refuses", REFUSES),
    )
    marks = [Patch(color=colour, label=text) for text, colour in kinds]
    place = {"loc": "outside upper center", "ncols": len(marks)} if paper else {"loc": "outside right upper"}
    figure.legend(handles=marks, frameon=False, fontsize=8.5, **place)
    return figure


def answer(data: Stability) -> str:
    """How many cases each of the phases fails, from fewest to most, and whether any gave no number at all."""
    failed: dict[str, int] = {phase.name: 0 for phase in data.phases}
    for row in data.results:
        failed[row.phase] += row.first_failure is not None
    if not failed:
        return ""
    order = sorted(failed, key=lambda name: failed[name])
    broken = (row.phase for row in data.results if set(measure.BREAKS) & set(row.states))
    names = dict.fromkeys(broken)
    what = (
        f"{', '.join(names)} wrote NaN, crashed or hung" if names else "no phase wrote NaN, crashed or hung"
    )
    few, many = (f"{failed[name]} ({name})" for name in (order[0], order[-1]))
    said = f"between {few} and {many}" if failed[order[0]] != failed[order[-1]] else f"{failed[order[0]]}"
    return f"Of {len(data.cases)} hard cases a phase fails {said} at some strength; {what}."
