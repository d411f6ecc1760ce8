"""Systems of other articles: what each experiment with a `system` has in a run, in one chapter."""

from __future__ import annotations

from collections.abc import Sequence

from study.core import provenance, show
from study.core.show import Column
from study.experiments.experiment import Call, Experiment, Study, find_all
from study.experiments.section import Claim, Section, part
from study.experiments.systems import pictures
from study.numbers.analysis import Data

COMMANDS = ("rods", "flight --still", "lattice", "fixed", "packets")  # each writes its own file


def calls(study: Study) -> list[Call]:
    run = ["--run", str(study.run)]
    made = [Call(name, [*words, *run], may_lack=True) for name, *words in map(str.split, COMMANDS)]
    return [*made, Call("redraw", [str(study.run), "--only", pictures.PICTURES], may_lack=True)]


ERRORS = (
    "Errors: PSNR to ground truth, and ppm of the pixels with a wrong hit; of rays beside Embree, ppm with "
    "another hit than Embree's; of vectors the largest, in ulp."
)
CLAIMS = [
    Column("", "article", show.word("article")),
    Column("", "claim", show.word("claim")),
    Column("", "said", show.word("said")),
    Column("", "here [95 %]", show.word("ours")),
    Column("", "ratio [95 %]", show.word("ratio")),
    Column("", "error", show.word("error")),
]


def section(data: Data) -> Section:
    """One table with a row for each figure that an article states, then what each system's file has."""
    run = data.path
    sheet = run / "images" / f"{pictures.PICTURES}.png"
    drawn: dict = {}
    images = {sheet: pictures.CAPTION} if sheet.exists() else {}
    claims: list[Claim] = []
    parts: list = []
    notes: list[str] = []
    files: list[str] = []
    for one in find_all().values():
        if one.system and (found := one.system(run)):
            claims += found.claims
            parts += found.parts
            notes += [found.note] * bool(found.note)
            files += one.schemas
            drawn |= found.drawn
            images |= found.images
    notes += [ERRORS, provenance.disturbed(run, files)]
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


EXPERIMENT = Experiment(
    name="systems",
    what="systems of other articles",
    turn=170,
    schemas={},
    calls=calls,
    depth="full",
    cut="Builds and animations of six programs take minutes.",
    sections=[(640, section)],
    sheets={pictures.PICTURES: pictures.write_pictures},
)
