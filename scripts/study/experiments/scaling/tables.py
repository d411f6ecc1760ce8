"""The tables of how cost grows, made from scaling.json alone."""

from __future__ import annotations

from collections.abc import Callable

from study.core import registry, show
from study.core.show import Column
from study.experiments.scaling.schema import Crowd, Fit, Row, Scaling
from study.experiments.scaling.series import LAW
from study.experiments.section import Part, part
from study.numbers import power_laws
from study.numbers.power_laws import Law

CLOSED = "none: closed forms count 1 for every camera ray"
TOP = 120  # dB: what is nearer is drawn here


def level(row: Row) -> float | None:
    """PSNR in dB to the row's reference, at most TOP; None without one."""
    if row.rmse is None:
        return None
    return TOP if row.psnr_db is None else min(row.psnr_db, TOP)


def evaluations(row: Row) -> float | None:
    """Of a camera ray; none of a program with closed forms, where an older file has a 1 for each."""
    return None if registry.is_exact(row.phase) else row.evals_per_ray


def _evals(row: Fit) -> str:
    if registry.is_exact(row.phase):
        return CLOSED
    return power_laws.text(row.evals.exponent) if row.evals else show.NOTHING


def _worst(law: Law) -> str:
    return show.NOTHING if law.points < power_laws.LEAST else f"{law.worst:.2f}× at {law.worst_x:,g}"


def _both(name: str, form: str) -> Callable[[Crowd], str]:
    """Nothing where one scene of each was timed: the ratio is then of medians."""

    def text(row: Crowd) -> str:
        some = getattr(row, name) if max(row.scenes or [1]) > 1 else None
        return " and ".join(form.format(one) for one in some) if some else show.NOTHING

    return text


def _covered(row: Crowd) -> str:
    return " and ".join(f"{share:.3f}" for share in row.coverage or () if share) or show.NOTHING


EXPONENTS = [
    Column("", "against", lambda r: r.title),
    Column("", "program", lambda r: r.phase),
    Column("", "from … to (points)", lambda r: f"{r.time.first_x:,g} … {r.time.last_x:,g} ({r.time.points})"),
    Column("exponent of time", "fitted [95 %]", lambda r: power_laws.text(r.time.exponent)),
    Column("exponent of time", f"the paper's {LAW}", show.plain("paper")),
    Column("exponent of time", "first two points [95 %]", lambda r: power_laws.text(r.time.first)),
    Column("exponent of time", "last two points [95 %]", lambda r: power_laws.text(r.time.last)),
    Column("does a law fit?", "largest residual", lambda r: _worst(r.time)),
    Column("does a law fit?", "verdict", lambda r: r.verdict),
    Column("", "exponent of evaluations per ray", _evals),
]
CROWDS = [
    Column("", "program", lambda r: r.phase),
    Column("shapes", "scattered, against 16", lambda r: f"{r.shapes:,}" if r.shapes else show.NOTHING),
    Column("shapes", "n", lambda r: str(r.n or show.NOTHING)),
    Column("shapes", "scenes, 16 and many", _both("scenes", "{:,}")),
    Column("shapes", "mean ms, 16 and many", _both("mean_ms", "{:.3g}")),
    Column("shapes", "time over that of 16 [95 %]", show.spread_of("ratio", "×")),
    Column("shapes", "by medians [95 %]", show.spread_of("by_medians", "×")),
    Column("shapes", "share of pixels hit, 16 and many", _covered),
]
POINTS = [
    Column("", "series", lambda r: r.series),
    Column("", "x", lambda r: f"{r.x:,g}"),
    Column("", "program", lambda r: r.phase),
    Column("", "ms a frame [95 %]", show.spread_of("ms", digits=4)),
    Column("", "ns/pixel [95 %]", show.spread_of("ns_per_pixel", digits=4)),
    Column("", "evaluations per ray", lambda r: show.number(evaluations(r))),
    Column("", "share of pixels hit", show.plain("coverage")),
    Column("error", "reference", lambda r: r.reference or r.why_none or "too large to be kept"),
    Column("error", "PSNR, dB", lambda r: show.number(level(r))),
    Column("error", "wrong hit, ppm", show.plain("wrong_ppm")),
]
LEFT_OUT = [
    Column("", "series", lambda r: r.series + (f" ({r.scene})" if r.scene else "")),
    Column("", "x", lambda r: f"{r.x:,g}"),
    Column("", "program", lambda r: r.phase),
    Column("", "one frame, foreseen, s", show.plain("foreseen_s")),
    Column("", "why", lambda r: r.reason),
]


def parts(result: Scaling) -> list[Part]:
    return [
        *part("scaling", f"Exponents of the time of a frame beside {LAW}", result.fits, EXPONENTS),
        *part("scaling-crowds", "Many shapes", result.goals, CROWDS),
        *part("scaling-points", "Every point", result.rows, POINTS),
        *part("scaling-left-out", "Points left out", result.left_out, LEFT_OUT),
    ]


def answer(result: Scaling) -> str:
    """The fastest program's exponents of picture height and of shapes, beside the paper's law."""
    said = []
    for series in ("n-scene0", "shapes-scattered"):
        title = result.titles.get(series)
        fits = [one for one in result.fits if one.title == title]
        if fits:
            last = fits[-1]
            law = f" (the paper's law: {show.number(last.paper, 1)})" if last.paper is not None else ""
            exponent = power_laws.text(last.time.exponent)
            said.append(f"{last.phase}'s time grows with {title} to the power {exponent}{law}")
    return f"{'; '.join(said)}." if said else f"{len(result.rows)} points were timed; no series has a fit."
