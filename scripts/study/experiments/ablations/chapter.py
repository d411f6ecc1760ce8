"""The chapters of single steps, put in or taken out, and of what did not pay."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from study.core import html, registry, show
from study.core.cli import StudyError
from study.core.show import Column
from study.experiments.ablations import ideas, measure
from study.experiments.ablations.schema import FILE, IDEAS_FILE, SCHEMAS, Ablations, Row
from study.experiments.section import Found, Section, part
from study.numbers import verdicts
from study.pictures import dots
from study.pictures.draw import Drawing

DOCUMENT = registry.ROOT / "docs" / "what-did-not-pay.md"
TRIED = ("idea", "phase", "expected", "measured", "machine", "why")  # columns of its one table
PAYS, COSTS, NOTHING_GAINED, SLOWER = "pays", "pays, at that error", "no gain", "slower"
gain = show.spread_of("gain", "×")


def decibels(name: str) -> Callable[[Row], str]:
    """PSNR of a step's picture: no number stands for an infinite one in JSON."""
    return lambda row: "identical" if (value := getattr(row, name)) is None else show.number(value)


def outcome(row: Row) -> str:
    """What a step is worth on a scene, its whole interval asked."""
    _, low, high = row.gain.ends
    if math.isnan(low):
        return verdicts.TOO_FEW
    if low > 1:
        return COSTS if row.verdict in ("approximate", "OUTSIDE") else PAYS
    if high < 1:
        return SLOWER
    return NOTHING_GAINED if high <= verdicts.NO_GAIN else verdicts.UNSURE


OUTCOME = Column("", "outcome", outcome, lambda r: "bad" if outcome(r) == SLOWER else "")
VERDICT = Column("", "tolerance", lambda r: r.verdict, lambda r: "bad" if r.verdict == "OUTSIDE" else "")
STEPS = [
    Column("", "step", show.word("ablation")),
    Column("", "added or removed", show.word("step")),
    Column("", "against", show.word("against")),
    Column("", "scene", show.picture),
    Column("", "the step's gain [95\u00a0%]", gain),
    OUTCOME,
    Column("", "the paper", lambda r: r.paper.partition(" (")[0]),
    Column("", "the paper's claim", measure.said),
    Column("error against baseline", "PSNR linear, dB", decibels("psnr_db")),
    Column("error against baseline", "of what it is compared with", decibels("against_psnr_db")),
    Column("error against baseline", "pixels off > 1/255", lambda r: show.percent(r.fraction_over_1_255)),
    VERDICT,
    Column("", "what", lambda r: r.what),
]
STEPS_ABOUT = (
    "n = {n}, {launches} launches of one frame on one thread, interleaved. A step is a patch of its phase "
    "(phases/NAME/ablations). The gain is the step's, whichever side has it. Outcome: “no gain” where all of "
    f"the interval is below {verdicts.NO_GAIN:g}, “{verdicts.UNSURE}” where it holds 1 and more."
)
IDEAS = [
    Column("", "idea", lambda r: r.idea),
    Column("", "taken out of", lambda r: r.against),
    Column("", "scene", show.picture),
    Column("", "gain of the idea [95\u00a0%]", gain),
    OUTCOME,
    Column("picture without the idea", "PSNR to the phase's own, dB", ideas.change),
    Column("picture without the idea", "largest difference", show.plain("change_max_abs", 2)),
    Column("error of the phase and without the idea", "against", lambda r: r.reference),
    Column("error of the phase and without the idea", "PSNR of the phase, dB", decibels("against_psnr_db")),
    Column("error of the phase and without the idea", "without the idea", decibels("psnr_db")),
    Column("", "lines", lambda r: str(r.lines)),
    VERDICT,
    Column("", "without the idea", lambda r: r.what),
]
IDEAS_ABOUT = (
    "n = {n}, {launches} launches of one frame on one thread, interleaved. A patch takes the idea out.\n"
    "The gains of a phase's ideas do not multiply to the phase's own, for they share work.\n"
    "Lines: of the code that holds the idea, or of the patch where it is a constant or a condition."
)


@dataclass(frozen=True)
class Kind:
    """A table of the chapter: its file, what a row is called and by which attribute, columns, foot."""

    file: str
    word: str
    name: str
    caption: str
    columns: list[Column]
    about: str


KINDS = (
    Kind(IDEAS_FILE, "idea", "idea", "Each idea alone, against its phase without it", IDEAS, IDEAS_ABOUT),
    Kind(FILE, "step", "ablation", "Each step alone, against the code without it", STEPS, STEPS_ABOUT),
)


def _drawing(result: Ablations, kind: Kind, about: str) -> Drawing:
    title = f"What each {kind.word} gains, and the PSNR that it changes"

    def make() -> Figure:
        rows = [
            dots.of(row.gain, row.scene, f"{getattr(row, kind.name)} ({row.against})", _changed(row), True)
            for row in result.rows
        ]
        return dots.draw(rows, title, "time without it over time with it", True)

    return Drawing(title, about.replace("\n", " "), make)


def _changed(row: Row) -> str:
    before, after = decibels("against_psnr_db")(row), decibels("psnr_db")(row)
    return "" if before == after else f"{before} → {after} dB"


def _answer(rows: list[Row], kind: Kind) -> str:
    """The largest gain, and how many are gains by their whole interval."""
    able = [row for row in rows if row.gain.low is not None]
    if not able:
        return ""
    best = max(able, key=lambda row: row.gain.value)
    some = sum(row.gain.low > 1 for row in able)
    return (
        f"The largest gain of a single {kind.word} is {gain(best)}: “{getattr(best, kind.name)}” against "
        f"{best.against} on {best.scene}; {some} of {len(able)} {kind.word}s and scenes gain by their whole "
        "interval."
    )


def steps(path: Path) -> Section:
    """The ablations: single steps put in or taken out, then the ideas of each phase."""
    made = Found()
    for kind in KINDS:
        result = SCHEMAS[kind.file].load_if_there(path / kind.file)
        if result and result.rows:
            note = kind.about.format(n=result.n, launches=result.launches)
            left_out = "\n".join(f"not measured: {one}" for one in [*result.skipped, *result.failures])
            stem = kind.file.removesuffix(".json")
            foot = f"{note}\n{left_out}".strip()
            made.parts += part(stem, kind.caption, result.rows, kind.columns, foot)
            made.answer += f" {_answer(result.rows, kind)}"
            made.drawn[stem] = _drawing(result, kind, note)
    made.answer = made.answer.strip()
    return made.section("ablations", "What single steps are worth", path / FILE)


def tried(document: Path = DOCUMENT) -> list[list[str]]:
    """The rows of the table of what did not pay, a cell for each of TRIED. Raises StudyError."""
    rows = []
    for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
            if len(rows[-1]) != len(TRIED) or not all(rows[-1]):
                raise StudyError(f"{document}:{number}: a row has {len(TRIED)} cells: {', '.join(TRIED)}")
    return rows[2:]  # without its heading and the line below that


def as_html(rows: Sequence[Sequence[str]]) -> str:
    """The table for the page; neither HTML nor pictures pass through."""
    lines = [TRIED, ["---"] * len(TRIED), *rows]
    table = html.markdown().render("\n".join(f"| {' | '.join(line)} |" for line in lines))
    return (
        f"<details><summary>Ideas that were tried, from docs/what-did-not-pay.md: {len(rows)}</summary>"
        f'<div class="scroll prose">{table}</div><p class="small">Each was measured once, on the machine '
        "that its row names, and not again in this run.</p></details>"
    )


def negative(path: Path, document: Path = DOCUMENT) -> Section:
    """What did not pay: the document as it is now, and a sentence of this run."""
    results = [kind.load_if_there(path / name) for name, kind in SCHEMAS.items()]
    rows = [row for result in results if result for row in result.rows]
    made = Found(answer=_unpaid(rows), fragment=lambda: as_html(tried(document)))
    return made.section("negative", "What did not pay", path / FILE, "ablations")


def _unpaid(rows: Sequence[Row]) -> str:
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
