"""The integer ray tracer as tables and figures, from fixed.json alone."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import asdict, replace

from study.core import show
from study.core.show import Column
from study.experiments.fixed import measure
from study.experiments.fixed.schema import FILE, Fixed, Moving, Row
from study.experiments.section import Claim, Part, System, part
from study.measuring import animations, launches
from study.measuring.animations import per_article
from study.measuring.hit_tables import error, ms, to_truth
from study.measuring.schema import Spread

MS = Column("", "ms [95 %]", ms)


def _ratio(key: str, group: str) -> Column:
    """ "base" in the row that others are compared with."""

    def text(row: Row) -> str:
        if getattr(row, key) is None:
            return "base" if key == "gain" or row.phase == "fixed_float" else show.NOTHING
        return show.interval(row, key, 3, "×")

    return Column("", f"× {group} [95 %]", text)


CASES = [
    Column("", "case", lambda r: r.case),
    Column("", "settings", lambda r: r.settings),
    MS,
    _ratio("gain", "the article's on one lane"),
    _ratio("over_float", "float in the most lanes that ran"),
    _ratio("over_like_float", "float in as many lanes"),
    *to_truth("wrong hits", "dt 99", "psnr"),
]
LESSONS = {  # phase → cases of its lesson, the first of which is what the others are compared with
    "fixed": ("article, 1 lane", "1 lane", "16 lanes, 28 bits", "float, 16 lanes"),
    "fixed_simd": ("1 lane", "8 lanes", "16 lanes", "16 lanes, 28 bits"),
    "fixed_float": ("16 lanes", "16 lanes, 28 bits", "float, 16 lanes", "8 lanes", "float, 8 lanes"),
}
LESSON = [
    Column("", "numbers", lambda r: f"{'' if r.phase == 'fixed_float' else 'integers: '}{r.case}"),
    MS,
    _ratio("gain", "the first"),
    *to_truth("psnr", "wrong hits", group=""),
]
SWEEP = [
    Column("", "bits of fraction", lambda r: str(r.bits)),
    Column("", "roots", lambda r: "the article's" if r.roots == "article" else f"{r.roots} Newton steps"),
    MS,
    *to_truth("wrong hits", "dt 50", "dt 99", "psnr"),
    Column("", "refused", show.word("refused")),
]
MEANING = {
    "never": "none is cleared",
    "corners": "the article's four corners",
    "safe": "planes against spheres",
    "lists": "the same, and a list of spheres for each block",
}
CLEARING = [
    Column("", "picture", lambda r: f"{r.width}×{r.n}"),
    Column("", "blocks", lambda r: MEANING[r.clear]),
    MS,
    Column("", "cleared, % of the pixels", lambda r: show.number(100 * r.cleared)),
    Column("", "wrongly cleared, ppm", show.plain("wrongly_cleared_ppm")),
    Column("", "as seen by", lambda r: "itself without clearing" if r.against else "ground truth"),
    *to_truth("psnr"),
]
PROGRAMS = {
    "article": "the article's roots and corners, one lane",
    "lanes": "integers in lanes",
    "floats": "floats in lanes",
    "": "the article's CPU",
}
ANIMATION = [
    Column("", "program", lambda r: f"{PROGRAMS[r.program]} ({r.phase})"),
    Column("", "shadows", lambda r: "hard" if r.shadows else "none"),
    Column("", "cores", lambda r: str(r.threads)),
    *animations.FRAMES,
    Column(
        "", "pixels per core and second, × the article's", lambda r: _times(per_article(r, measure.ARTICLE))
    ),
]
NOTE = (
    "The article's program shades otherwise (no shadow, no falloff, mirrors of full weight) and moves "
    "its spheres otherwise. Here is this house's shading, so that ground truth can judge it. Its time "
    "is the mean of 900 frames on 35 cores of a CPU without vectors. On one core and by the article's "
    "program fewer frames are timed, from the first on; what they show drifts: compare programs by the "
    f"mean of the frames that all rows have. They are measured one after the other. {animations.NOTE}"
)


def _times(ratio: float | None) -> str:
    return show.NOTHING if ratio is None else f"{show.number(ratio)}×"


def articles(result: Fixed) -> Moving:
    """What the article says of its program."""
    said = result.article
    return Moving(
        program="",
        shadows=False,
        phase=said.cpu,
        threads=said.cores,
        frames=said.frames,
        width=said.width,
        n=said.height,
        ms=Spread(mean=said.ms),
        core_ns_per_pixel=said.ms * 1e6 * said.cores / (said.width * said.height),
    )


def claims(result: Fixed) -> list[Claim]:
    """The article's one figure beside ours of as many frames on every core."""
    stills = {row.phase: row for row in reversed(result.rows)}
    found = []
    for row in result.animation:
        times = per_article(row, result.article)
        if times is None:
            continue
        what = f"{animations.MOVING}, {PROGRAMS[row.program]}, {row.threads} cores, ms a frame"
        shown = row.error or (stills.get(row.phase) if row.shadows else None)
        said = error(shown) if shown else show.NOTHING
        ours, theirs = show.number(row.ms.mean), f"{result.article.ms}"
        found.append(Claim("integer rays (P3)", what, theirs, ours, _times(times), said))
    return found


def parts(result: Fixed) -> list[Part]:
    moved = [articles(result), *result.animation]
    caption = "Rays in integers: the article's animation, beside what it says of its own CPU"
    return [
        *part("fixed", "Rays in integers: lanes, floats", result.rows, CASES),
        *part("fixed-animation", caption, moved, ANIMATION, NOTE),
        *part("fixed-clearing", "Rays in integers: which blocks are cleared", result.clearing, CLEARING),
        *part("fixed-bits", "Rays in integers: bits of fraction × roots", result.sweep, SWEEP),
    ]


def lessons(result: Fixed) -> list[Part]:
    """The cases of each phase's lesson, with how many times as fast as the first of them each is."""
    known, own, made = {row.case: row for row in result.rows}, result.rows[0], []
    about = f"{measure.SCENE}, {own.width}×{own.n}, errors to ground truth"
    for phase, cases in LESSONS.items():
        first, *others = (known[case] for case in cases if case in known)
        base = first.launches or []
        rows = [replace(row, **asdict(launches.gain(base, row.launches or []))) for row in others]
        rows.insert(0, replace(first, gain=None))
        made += part(phase, f"{about}; {result.launches} interleaved launches", rows, LESSON)
    return made


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = Fixed.load_if_there(run / FILE)
    if result is None:
        return None
    said = result.article
    note = (
        f"P3: {said.cpu}; the mean of {said.frames} frames of {said.width}×"
        f"{said.height} without shadows. The ratio is of pixels per core and second."
    )
    return System(claims(result), parts(result), note, lessons=lambda: lessons(result))
