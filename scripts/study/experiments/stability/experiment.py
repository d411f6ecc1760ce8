"""Hard cases with a known answer."""

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.section import Found, chapters
from study.experiments.shards import Sharded
from study.experiments.stability import cases, command, figures, tables
from study.experiments.stability.schema import FILE, SCHEMAS, Stability
from study.pictures.draw import Drawing

NOTE = (
    "Generated scenes whose answer is known; a parameter makes each harder. Where every phase fails alike, "
    "the method fails (a march that stops at a hit distance or after so many steps), not its arithmetic."
)


def calls(study: Study) -> list[Call]:
    few = ["--strengths", "few", "--phase", *cuts.three()[::2]] if study.quick else []
    if few:  # another compiler's build of the last phase takes minutes
        few += ["--case", *(case.name for case in cases.cases() if case.name != "contraction")]
    return [Call("stability", [*few, "--run", str(study.run)])]


def found(data: Stability) -> Found:
    """How far each phase gets in each case; the table, and each case behind its title."""
    drawn = {"hard-cases": Drawing(figures.CAPTION, NOTE, lambda: figures.draw(data))}
    return Found([], figures.answer(data), drawn, lambda: tables.section(data))


section = chapters("stability", "Hard cases", FILE, Stability, found, "results")
EXPERIMENT = Experiment(
    name="stability",
    what="hard cases",
    turn=70,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="The first and the last phase, at the first, the middle and the last strength of each case but "
    "contraction, which builds them by another compiler.",
    sections=[(530, section)],
    sharded=Sharded(FILE, ("cases", "results"), command.units),
    command=command,
)
