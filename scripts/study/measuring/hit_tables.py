"""Times, gains and errors to ground truth as cells and columns."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from study.core import show
from study.core.show import Column
from study.measuring.schema import HitErrors

JUDGED = 0.9995  # of the pixels: less is said
TRUTH = "to ground truth"


def ms(row: Any) -> str:
    return show.interval(row, "ms", 3) if row.ms else show.NOTHING


def gain(row: Any) -> str:
    return show.interval(row, "gain", 3, "×") if row.gain else show.NOTHING


def verdict(row: Any) -> str:
    """Whether a gain's interval has 1 outside; without an interval nothing can be told."""
    if row is None or row.gain is None:
        return show.NOTHING
    if row.gain_low is None or row.gain_high is None:
        return "cannot be told"
    return "gain" if row.gain_low > 1 else "loss" if row.gain_high < 1 else "cannot be told"


def ppm(row: HitErrors, name: str = "wrong_ppm", form: Callable[[Any], str] = show.number) -> str:
    """Wrong hits in ppm, and of which share of the pixels where truth does not judge all of them."""
    text, judged = form(getattr(row, name)), row.judged
    return text if judged is None or judged >= JUDGED else f"{text} (of {show.percent(judged)} of the pixels)"


def psnr(row: HitErrors) -> str:
    return "identical" if row.psnr_db is None else f"{row.psnr_db:.1f} dB"


def wrong(row: HitErrors) -> str:
    return ppm(row, form="{:,.0f} ppm".format)


def error(row: HitErrors) -> str:
    return f"{psnr(row)}, {wrong(row)}"


def to_truth(*names: str, group: str = TRUTH) -> list[Column]:
    return [dataclasses.replace(_COLUMNS[name], group=group) for name in names]


def within(name: str, columns: Sequence[Column]) -> list[Column]:
    """The columns of what a row has as `name`; empty where that is None."""

    def of(text: Callable[[Any], str]) -> Callable[[Any], str]:
        return lambda row: show.NOTHING if getattr(row, name) is None else text(getattr(row, name))

    return [dataclasses.replace(one, text=of(one.text)) for one in columns]


_COLUMNS = {
    "false hits": Column(TRUTH, "false hits, ppm", lambda r: ppm(r, "false_hits_ppm")),
    "false misses": Column(TRUTH, "false misses, ppm", lambda r: ppm(r, "false_misses_ppm")),
    "wrong shape": Column(TRUTH, "wrong shape, ppm", lambda r: ppm(r, "wrong_shape_ppm")),
    "wrong hits": Column(TRUTH, "wrong hits, ppm", ppm),
    "dt 50": Column(TRUTH, "|Δt| 50 %", show.plain("dt_p50", 2)),
    "dt 99": Column(TRUTH, "|Δt| 99 %", show.plain("dt_p99", 2)),
    "psnr": Column(TRUTH, "PSNR, dB", show.plain("psnr_db")),
}


def not_finite(rows: Sequence[tuple[str, Any]]) -> list[str]:
    """Sentences for the named rows whose pictures have samples that are not finite."""
    return [f"{name}: {row.non_finite} samples are not finite" for name, row in rows if row.non_finite]
