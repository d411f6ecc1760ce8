"""Approximations of functions: speed against ulp, vectors normalised."""

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.functions import command, edge_tables, figures, tables
from study.experiments.functions.schema import FILE, SCHEMAS, Functions
from study.experiments.section import Found, chapters, part


def calls(study: Study) -> list[Call]:
    return [Call("functions", [*([] if study.whole else ["--quick"]), "--run", str(study.run)])]


def found(result: Functions) -> Found:
    caption = "The fronts of each function: nothing is nearer and faster, by throughput or by latency"
    parts = part("functions", caption, tables.fronts(result), tables.ON_FRONTS, figures.note(result))
    parts += edge_tables.parts(result)
    foot = figures.normalise_note(result) if result.normalise else ""
    parts += part("normalise", "Vectors normalised", result.normalise, tables.NORMALISE, foot)
    parts += part("functions-all", "Every implementation", result.entries, tables.ENTRIES)
    return Found(parts, tables.answer(result), figures.drawings(result))


section = chapters("functions", "Functions: speed against ulp", FILE, Functions, found, "entries")
EXPERIMENT = Experiment(
    name="functions",
    what="functions: speed against ulp",
    turn=90,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    command=command,
    sections=[(620, section)],
)
