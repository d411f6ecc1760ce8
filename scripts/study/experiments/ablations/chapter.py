"""The chapter of single steps, put in or taken out, and of the ideas of each phase."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.ablations.schema import FILE, SCHEMAS, Ablations, Row
from study.experiments.section import Part, Section, part
from study.numbers import verdicts
from study.pictures import dots
from study.pictures.draw import Drawing

PAYS, COSTS, NOTHING_GAINED, SLOWER = "pays", "pays, at that error", "no gain", "slower"
gain = show.spread_of("gain", "×")


def decibels(name: str) -> Callable[[Row], str]:
    """Of a step's picture: no number stands for an infinite one in JSON."""
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
    Column("", "step", lambda r: r.ablation),
    Column("", "added or removed", lambda r: r.step),
    Column("", "against", lambda r: r.against),
    Column("", "scene", show.picture),
    Column("", "the step's gain [95\u00a0%]", gain),
    OUTCOME,
    Column("", "the paper", lambda r: r.paper.partition(" (")[0]),
    Column("", "the paper's claim", ablations.said),
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
    Kind(ideas.FILE, "idea", "idea", "Each idea alone, against its phase without it", IDEAS, IDEAS_ABOUT),
    Kind(FILE, "step", "ablation", "Each step alone, against the code without it", STEPS, STEPS_ABOUT),
)


def _drawing(result: Ablations, kind: Kind, about: str) -> Drawing:
    """A dot for each gain."""
    title = f"What each {kind.word} gains, and the PSNR that it changes"

    def make() -> Figure:
        rows = [
            dots.of(row.gain, row.scene, f"{getattr(row, kind.name)} ({row.against})", _changed(row), True)
            for row in result.rows
        ]
        return dots.draw(rows, title, "time without it over time with it", True)

    return Drawing(title, about.replace("\n", " "), make)


def _changed(row: Row) -> str:
    """PSNR to baseline before and after, where it changes."""
    before, after = decibels("against_psnr_db")(row), decibels("psnr_db")(row)
    return "" if before == after else f"{before} → {after} dB"


def _answer(rows: list[Row], kind: Kind) -> str:
    """The largest gain, and how many are gains by their whole interval."""
    able = [(row.gain.value or 0, row.gain.low, row) for row in rows if row.gain.low is not None]
    if not able:
        return ""
    best = max(able, key=lambda one: one[0])[2]
    some = sum(low > 1 for _, low, _ in able)
    return (
        f"The largest gain of a single {kind.word} is {gain(best)}: “{getattr(best, kind.name)}” against "
        f"{best.against} on {best.scene}; {some} of {len(able)} {kind.word}s and scenes gain by their whole "
        "interval."
    )


def steps(path: Path) -> Section:
    """The ablations: single steps put in or taken out, then the ideas of each phase."""
    parts: list[Part] = []
    said: list[str] = []
    drawn: dict[str, Drawing] = {}
    for kind in KINDS:
        result = SCHEMAS[kind.file].load_if_there(path / kind.file)
        if result and result.rows:
            note = kind.about.format(n=result.n, launches=result.launches)
            left_out = "\n".join(f"not measured: {one}" for one in [*result.skipped, *result.failures])
            stem = kind.file.removesuffix(".json")
            parts += part(stem, kind.caption, result.rows, kind.columns, f"{note}\n{left_out}".strip())
            said.append(_answer(result.rows, kind))
            drawn[stem] = _drawing(result, kind, note)
    about = {"file": path / FILE, "script": "scripts/stepwise ablations", "drawn": drawn}
    title = "What single steps are worth"
    return Section("ablations", title, "make ablations", parts, answer=" ".join(said), **about)
