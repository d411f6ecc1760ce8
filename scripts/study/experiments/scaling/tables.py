"""The tables of how cost grows, made from scaling.json alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from study.core import registry, show
from study.core.show import Column
from study.experiments.scaling.figures import level
from study.experiments.scaling.series import LAW, Row
from study.numbers import power_laws as scaling_fit


def _exponent(path: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        found: Any = row
        for key in path.split("."):
            found = (found or {}).get(key)
        return show.NOTHING if found is None else scaling_fit.text(found)

    return text


def _worst(row: Row) -> str:
    law = row["time"]
    return (
        show.NOTHING if law["points"] < scaling_fit.LEAST else f"{law['worst']:.2f}× at {law['worst_x']:,g}"
    )


def _plain(name: str) -> Callable[[Row], str]:
    return lambda row: show.NOTHING if row.get(name) is None else show.number(row[name])


def _both(row: Row, name: str, form: str) -> str:
    """Nothing where one scene of each was timed: the ratio is then of medians."""
    if max(row.get("scenes") or [1]) == 1:
        return show.NOTHING
    return " and ".join(form.format(one) for one in row[name])


CLOSED = "none: closed forms count 1 for every camera ray"


def _evaluations(text: Callable[[Row], str], instead: str) -> Callable[[Row], str]:
    """`instead` for a program that meets shapes by closed forms: the 1 in its plane is no count."""
    return lambda row: instead if registry.is_exact(row["phase"]) else text(row)


EXPONENTS = [
    Column("", "against", lambda r: r["title"]),
    Column("", "program", lambda r: r["phase"]),
    Column("", "from … to (points)", lambda r: "{first_x:,g} … {last_x:,g} ({points})".format(**r["time"])),
    Column("exponent of time", "fitted [95 %]", _exponent("time.exponent")),
    Column("exponent of time", f"the paper's {LAW}", _plain("paper")),
    Column("exponent of time", "first two points [95 %]", _exponent("time.first")),
    Column("exponent of time", "last two points [95 %]", _exponent("time.last")),
    Column("does a law fit?", "largest residual", _worst),
    Column("does a law fit?", "verdict", lambda r: r["verdict"]),
    Column("", "exponent of evaluations per ray", _evaluations(_exponent("evals.exponent"), CLOSED)),
]
CROWDS = [
    Column("", "program", lambda r: r["phase"]),
    Column(
        "shapes", "scattered, against 16", lambda r: show.NOTHING if not r["shapes"] else f"{r['shapes']:,}"
    ),
    Column("shapes", "n", lambda r: show.NOTHING if not r["n"] else str(r["n"])),
    Column("shapes", "scenes, 16 and many", lambda r: _both(r, "scenes", "{:,}")),
    Column("shapes", "mean ms, 16 and many", lambda r: _both(r, "mean_ms", "{:.3g}")),
    Column("shapes", "time over that of 16 [95 %]", show.spread_of("ratio", "×")),
    Column("shapes", "by medians [95 %]", show.spread_of("by_medians", "×")),
    Column(
        "shapes",
        "share of pixels hit, 16 and many",
        lambda r: " and ".join(f"{c:.3f}" for c in r["coverage"] or () if c) or show.NOTHING,
    ),
    Column("memory at 3840×2160", "MiB above the frame", _plain("above_frame_mib")),
]
POINTS = [
    Column("", "series", lambda r: r["series"]),
    Column("", "x", lambda r: f"{r['x']:,}"),
    Column("", "program", lambda r: r["phase"]),
    Column("", "ms a frame [95 %]", show.spread_of("ms", digits=4)),
    Column("", "ns/pixel [95 %]", show.spread_of("ns_per_pixel", digits=4)),
    Column("", "evaluations per ray", _evaluations(_plain("evals_per_ray"), show.NOTHING)),
    Column("", "share of pixels hit", _plain("coverage")),
    Column("error", "reference", lambda r: r.get("reference") or r.get("why_none") or "too large to be kept"),
    Column("error", "PSNR, dB", lambda r: show.NOTHING if level(r) is None else show.number(level(r))),
    Column("error", "wrong hit, ppm", _plain("wrong_ppm")),
    Column("", "MiB above the frame", _plain("above_frame_mib")),
]
MEMORY = [
    Column("", "program", lambda r: r["phase"]),
    Column("", "scene", lambda r: r["scene"]),
    Column("", "shapes", lambda r: f"{r['shapes']:,}"),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "seconds of the frame", _plain("seconds")),
    Column("", "peak, MiB", _plain("peak_rss_mib")),
    Column("", "above the frame, MiB", _plain("above_frame_mib")),
]
LEFT_OUT = [
    Column("", "series", lambda r: r["series"] + (f" ({r['scene']})" if "scene" in r else "")),
    Column("", "x", lambda r: f"{r['x']:,}"),
    Column("", "program", lambda r: r["phase"]),
    Column("", "one frame, foreseen, s", _plain("foreseen_s")),
    Column("", "why", lambda r: r["reason"]),
]


def tables(result: dict[str, Any]) -> list[tuple[str, str, list[Row], list[Column]]]:
    """Name, caption, rows and columns."""
    return [
        ("scaling", f"Exponents of the time of a frame beside {LAW}", result["fits"], EXPONENTS),
        ("scaling-crowds", "Many shapes, and memory", result["goals"], CROWDS),
        ("scaling-memory", "Peak memory at 3840×2160", result["memory"], MEMORY),
        ("scaling-points", "Every point", result["rows"], POINTS),
        ("scaling-left-out", "Points left out", result["left_out"], LEFT_OUT),
    ]


def answer(result: dict[str, Any]) -> str:
    """The fastest program's exponents of picture height and of shapes, beside the paper's law."""
    said = []
    for series in ("n-scene0", "shapes-scattered"):
        title = result["titles"].get(series)
        fits = [one for one in result["fits"] if one["title"] == title and one["time"]["exponent"]]
        if fits:
            last = fits[-1]
            law = f" (the paper's law: {show.number(last['paper'], 1)})" if last["paper"] is not None else ""
            said.append(
                f"{last['phase']}'s time grows with {title} to the power "
                f"{scaling_fit.text(last['time']['exponent'])}{law}"
            )
    text = "; ".join(said)
    return f"{text}." if said else f"{len(result['rows'])} points were timed; no series has a fit."
