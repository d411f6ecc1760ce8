"""The packet ray tracer as tables and figures: from packets.json alone."""

from __future__ import annotations

import math

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from study import moving, show, verdicts
from study.draw import COLOURS, HATCHES, MARKERS, Drawing, plain_log
from study.functions import VECTORS as ARTICLE_VECTORS
from study.packets import EMBREE, ENOUGH_DB, Row, reached, target_of
from study.sections import Part, part
from study.show import Column
from study.stats import Interval

FIGURE, EQUAL = "packets-rays", "packets-equal-error"
OF_KIND = {
    "primary": "camera",
    "shadow": "to the light",
    "mirror": "mirrored",
    "scattered": "in any direction, in no order",
}


WAYS = dict(zip(EMBREE, ("packets of 16", "single rays", "256 rays a call"), strict=True))


def _variant(row: Row, name: str) -> Row | None:
    return next((v for v in row["variants"] if v["name"] == name), None)


def _rate(row: Row | None) -> str:
    return show.NOTHING if row is None else show.interval(row, "mrays", 3)


def _of(name: str):
    return lambda row: _rate(_variant(row, name))


def _ratio(key: str):
    return lambda row: show.NOTHING if row.get(key) is None else show.interval(row, key, 3, "×")


def fastest(row: Row) -> str | None:
    """Embree's fastest way for these rays, of those that were timed: an older file has no streams."""
    timed = [way for way in EMBREE if row.get(way) is not None]
    return max(timed, key=lambda way: row[way]["mrays"], default=None)


def _over_fastest(row: Row) -> str:
    way = fastest(row)
    if way is None:
        return f"{show.NOTHING} over {row['embree']}"
    return f"{_ratio(f'{way}_ratio')(row)} over Embree by {WAYS[way]} ({row['embree']})"


def verdict(row: Row, goals: Row) -> str:
    """Of the goal for this kind of rays, against the fastest of Embree's ways."""
    goal, way = goals[row["kind"]], fastest(row)
    if goal is None or way is None:
        return show.NOTHING
    ends = [row[f"{way}_ratio{end}"] for end in ("", "_low", "_high")]
    known = [math.nan if end is None else end for end in ends]
    ratio = Interval(*known, launches=0, sufficient=None not in ends)
    return f"≥ {goal:g}×: {verdicts.goal(ratio, goal)}"


def _agreement(row: Row) -> str:
    found = row["agreement"]
    if found is None:
        return show.NOTHING
    off = "" if found["dt_max"] is None else f", |Δt| ≤ {show.number(found['dt_max'], 2)}"
    return f"{found['other_shape']} of {found['compared']:,} others{off}"


def ray_columns(goals: Row) -> list[Column]:
    many = "million rays a second [95 %]"
    return [
        Column("", "scene", lambda r: r["scene"]),
        Column("", "rays", lambda r: f"{OF_KIND[r['kind']]} ({r['rays']:,})"),
        Column(many, "here", _of("own")),
        *(Column(many, f"Embree, {text}", lambda r, w=way: _rate(r.get(w))) for way, text in WAYS.items()),
        *(
            Column("here over Embree [95 %]", text, _ratio(f"{way}_ratio"))
            for way, text in zip(EMBREE, ("packets", "single", "256 a call"), strict=True)
        ),
        Column("", "goal, by the fastest", lambda r: verdict(r, goals)),
        Column("", "hits, ours and Embree's", _agreement),
    ]


VARIANTS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "rays", lambda r: OF_KIND[r["kind"]]),
    *(
        Column("million rays a second [95 %]", text, _of(name))
        for name, text in {
            "own": "BVH, widest",
            "kd-tree": "kd-tree",
            "8 lanes": "8 lanes (AVX2)",
            "4 lanes": "4 lanes (SSE2)",
            "each alone": "each ray alone",
            "root by Newton": "approximate root, one Newton step",
        }.items()
    ),
    Column("", "|Δt| of that root", lambda r: show.number(r["newton_dt_max"], 2)),
]


ROOTS = [
    Column("", "scene", lambda r: f"{r['scene']}, {r['width']}×{r['n']}"),
    Column("", "root", lambda r: {"newton": "approximate, one Newton step"}.get(r["root"], r["root"])),
    Column("", "ms a frame, one thread [95 %]", lambda r: show.interval(r, "ms", 3)),
    Column("", "gain [95 %]", lambda r: "base" if r["gain"] is None else show.interval(r, "gain", 3, "×")),
    Column("to truth", "PSNR, dB", lambda r: show.number(r["psnr_db"])),
    Column("to truth", "wrong hits, ppm", lambda r: show.number(r["wrong_ppm"])),
]


def drawn_rows(result: Row) -> list[Row]:
    """A row for each scene, phase and number of threads."""
    return [
        {"scene": f"{d['scene']}, {d['width']}×{d['n']}", "equal": equal(d, row), **row, **timed}
        for d in result["drawn"]
        for row in d["rows"]
        for timed in row["threads"]
    ]


def equal(drawn: Row, row: Row) -> str:
    """Whether the error is ray tracing's, or as small as anybody sees; of files without `reached`, too."""
    traced = next(one for one in drawn["rows"] if one["phase"] == "packets")
    if row is traced:
        return show.NOTHING
    if reached(row, target_of(traced)):
        return "reached"
    return f"not reached: {show.number(row['psnr_db'])} dB" if row["non_finite"] == 0 else "not finite"


def _own(key: str):
    return lambda row: "the scene's" if row.get(key) is None else f"{row[key]:g}"


DRAWN = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "hit distance", _own("hit_distance")),
    Column("", "step cap", _own("max_steps")),
    Column("", "ms a frame [95 %]", lambda r: show.interval(r, "ms", 3)),
    Column("", "packets is faster by [95 %]", lambda r: _gain(r)),
    Column("", "equal error", lambda r: r["equal"]),
    Column("to truth", "PSNR, dB", lambda r: show.number(r["psnr_db"])),
    Column("to truth", "wrong hits, ppm", lambda r: show.number(r["wrong_ppm"])),
]


def _gain(row: Row) -> str:
    return "base" if row["phase"] == "packets" else show.interval(row, "gain", 3, "×")


BESIDE = (
    "Rays go through both tracers on one thread, in one order, by turns in one process. Embree's time is of "
    "its tracing alone, a thousand rays at a time put into its own form before; ours reads and writes plain "
    "arrays within its time. Ours gets all rays in one call and shares a frustum among up to 256; Embree "
    "gets packets of 16, single rays, or (Embree 3; Embree 4 has no streams) 256 a call. It is told which "
    "rays go the same way; ours finds out. trio_balls is a handful of spheres and planes: no test of a tree. "
    "spheres4096 is one."
)
NOTE = (
    "Equal error: each marching phase by the hit distance and the cap of steps (the scene's own, and one "
    "that does not bind) with which it is fastest among those that reach the PSNR of packets, or 80 dB. "
    "Where none does it has those with which it comes nearest, and the row says so: errors are not equal."
)


def sentences(result: Row) -> list[str]:
    """For a terminal."""
    found = [
        f"{r['scene']}, {r['kind']}: {_rate(_variant(r, 'own'))} million rays a second; over Embree's "
        + ", ".join(f"{text} {_ratio(f'{way}_ratio')(r)}" for way, text in WAYS.items())
        + f"; {_agreement(r)}"
        for r in result["rays"]
    ]
    return found + [
        f"{r['scene']}, {r['phase']}, {r['threads']} threads: {show.interval(r, 'ms', 3)} ms, "
        f"{show.number(r['psnr_db'])} dB; packets {_gain(r)}; equal error: {r['equal']}"
        for r in drawn_rows(result)
    ]


LAST_MARCHED = ("opt8_streams",)  # of the ladder: behind it, closed forms are in it too
MOST_OTHERS = 1e-4  # of the rays: those that graze


def faults(result: Row) -> list[str]:
    """What must not be: hits that Embree does not have, samples that are not finite."""
    found = [
        f"{r['scene']}, {r['kind']}: {r['agreement']['other_shape']} hits are others than Embree's"
        for r in result["rays"]
        if r["agreement"] and not (r["agreement"]["other_shape"] <= 2 + MOST_OTHERS * r["rays"])
    ]
    found += [
        f"{row['scene']}, root={row['root']}: {row['non_finite']} samples are not finite"
        for row in result.get("roots", [])
        if not (row["non_finite"] <= 0)
    ]
    return found + [
        f"{d['scene']}, {row['phase']}: {row['non_finite']} samples are not finite"
        for d in result["drawn"]
        for row in d["rows"]
        if not (row["non_finite"] <= 0)
    ]


ARTICLES_ROOT = "rsqrtps + 1"  # the approximate root and one Newton step


def normalise_rows(result: Row) -> list[Row]:
    """The article's only figures, of normalising vectors: scalar, by SSE, and the one over the other."""
    rows = {(r["isa"], r["layout"], r["name"]): r for r in result.get("normalise", [])}
    scalar = rows.get(("scalar", "AoS", "1/sqrt"))
    if scalar is None:
        return []
    said, many = result["article"], f"normalising {scalar['vectors']:,} vectors"

    def error(row: Row) -> str:
        return f"≤ {show.number(row['max_ulp'], 2)} ulp"

    def timed(row: Row, how: str, key: str) -> Row:
        alike = scalar["vectors"] == ARTICLE_VECTORS
        return {
            "what": f"{many}, {how}, ms",
            "article": f"{said[key]} ({said['cpu']})" if alike else show.NOTHING,
            "ours": show.interval(row, "ms", 3),
            "ratio": show.number(said[key] / row["ms"]) + "× its speed" if alike else show.NOTHING,
            "error": error(row),
        }

    found = [timed(scalar, "scalar", "scalar_ms")]
    for isa in dict.fromkeys(isa for isa, _, name in rows if name == ARTICLES_ROOT):
        one = rows[isa, "SoA", ARTICLES_ROOT]
        found.append(timed(one, f"{isa}, approximate root and a Newton step", "sse_ms"))
        over = {
            "what": f"{many}, {isa} over scalar",
            "article": f"{said['speed_up']}×",
            "ours": show.interval(one, "gain", 3, "×"),
            "ratio": show.number(one["gain"] / said["speed_up"]) + "× of it",
            "error": error(one),
        }
        found.append(over)
    return [{"system": "packet ray tracer (P2)", **row} for row in found]


def system_rows(result: Row) -> list[Row]:
    """Rows of the table of all systems. The article times the normalising of vectors, and no rays."""
    found = normalise_rows(result)
    for row in result["rays"]:
        own = _variant(row, "own")
        found.append(
            {
                "system": "packet ray tracer (P2)",
                "what": f"{row['scene']}, rays {OF_KIND[row['kind']]}, million a second",
                "article": "“millions of rays per second, per core”",
                "ours": _rate(own),
                "ratio": _over_fastest(row),
                "error": show.NOTHING if row["agreement"] is None else f"against Embree: {_agreement(row)}",
            }
        )
    for drawn in result["drawn"]:
        rows = {row["phase"]: row for row in drawn["rows"]}
        own, marched = rows["packets"], [row for name, row in rows.items() if name in LAST_MARCHED]
        for other in marched:
            timed, said = other["threads"][0], equal(drawn, other)
            with_what = "at equal error" if said == "reached" else f"equal error {said}"
            found.append(
                {
                    "system": "packet ray tracer (P2)",
                    "what": f"{drawn['scene']} {drawn['width']}×{drawn['n']}, ms a frame, one thread",
                    "article": show.NOTHING,
                    "ours": show.interval(own["threads"][0], "ms", 3),
                    "ratio": f"{show.interval(timed, 'gain', 3, '×')} over {other['phase']}, {with_what}",
                    "error": f"{show.number(own['psnr_db'])} dB, {own['wrong_ppm']:,.0f} ppm wrong hits",
                }
            )
    return found


def parts(result: Row) -> list[Part]:
    """Its tables on the page; none without rows."""
    if not result["rays"]:
        return []
    caption = "Packet ray tracing: rays a second, beside Embree on the same rays"
    found = part("packets", caption, result["rays"], ray_columns(result["goals"]))
    caption = "Ray tracing against sphere tracing: time to equal error"
    found += part("packets-equal-error", caption, drawn_rows(result), DRAWN)
    caption = "Packet ray tracing: trees, lanes, roots"
    found += part("packets-variants", caption, result["rays"], VARIANTS, folded=True)
    caption = "Packet ray tracing: the exact root and the approximate one in whole frames"
    return found + part("packets-roots", caption, result.get("roots", []), ROOTS, folded=True)


def remarks(result: Row) -> list[str]:
    """How to read them."""
    if not result["rays"]:
        return []
    which = {r["embree"] for r in result["rays"]}  # or why there is none
    beside = [BESIDE] * any(r["embree16"] is not None for r in result["rays"])
    moved = [f"The animation: {moving.NOTE}"] * bool(result.get("animation"))
    return [*beside, NOTE, *moved, *(f"Embree: {text}." for text in sorted(which))]


def _timed(row: Row, bar: str) -> Row | None:
    """Of a row of rays: one of Embree's ways, or a variant of ours; None where it was not timed."""
    found: Row | None = row.get(bar) if bar.startswith("embree") else _variant(row, bar)
    return found


def draw_rays(result: Row) -> Figure:
    """Million rays a second of ours and Embree's, a panel a scene."""
    names = list(dict.fromkeys(r["scene"] for r in result["rays"]))
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    every = ("4 lanes", "8 lanes", "kd-tree", "own", *EMBREE)
    # Without AVX-512 eight lanes are the widest, and no row beside it.
    made = {bar: [_timed(r, bar) for r in result["rays"]] for bar in every}
    bars = [bar for bar in every if any(made[bar])]
    widest = "/".join(sorted({str(one["lanes"]) for one in made["own"] if one and one.get("lanes")}, key=int))
    labels = {
        "4 lanes": "here, 4 lanes (SSE2)",
        "8 lanes": "here, 8 lanes (AVX2)",
        "kd-tree": "here, kd-tree",
        "own": f"here, BVH, {widest or 'widest'} lanes",
        **{way: f"Embree, {text}" for way, text in WAYS.items()},
    }
    for panel, name in zip(panels, names, strict=True):
        rows = [r for r in result["rays"] if r["scene"] == name]
        for i, bar in enumerate(bars):
            found = [_timed(r, bar) for r in rows]
            at = [
                place + (i - (len(bars) - 1) / 2) / (len(bars) + 1) for place, one in enumerate(found) if one
            ]
            panel.bar(
                at,
                [one["mrays"] for one in found if one],
                1 / (len(bars) + 1),
                color=COLOURS[(i + 1) % len(COLOURS)],
                hatch=HATCHES[i],
                edgecolor="white",
            )
        panel.set(yscale="log", title=name)
        panel.set_xticks(range(len(rows)), [r["kind"] for r in rows], fontsize=9)
        plain_log(panel.yaxis)
    panels[0].set_ylabel("million rays a second, one thread")
    marks = [
        Patch(
            facecolor=COLOURS[(i + 1) % len(COLOURS)], hatch=HATCHES[i], edgecolor="white", label=labels[bar]
        )
        for i, bar in enumerate(bars)
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=6, frameon=False, fontsize=9)
    return figure


def draw_equal(result: Row) -> Figure:
    """Time on one thread against error to truth, a panel a scene."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, len(result["drawn"]), squeeze=False)[0]
    names = list(dict.fromkeys(row["phase"] for d in result["drawn"] for row in d["rows"]))
    looks = {
        name: {
            "marker": "*" if name == "packets" else MARKERS[i % len(MARKERS)],
            "color": COLOURS[4] if name == "packets" else COLOURS[(0, 1, 2, 3, 5, 6)[i % 6]],
            "markersize": 14 if name == "packets" else 7,
            "linestyle": "none",
        }
        for i, name in enumerate(names)
    }
    for panel, drawn in zip(panels, result["drawn"], strict=True):
        for row in drawn["rows"]:
            if row["non_finite"]:  # no PSNR for another reason than 160 dB's
                continue
            shown = 160 if row["psnr_db"] is None else row["psnr_db"]
            panel.plot([row["threads"][0]["ms"]], [shown], **looks[row["phase"]])
        panel.axhline(ENOUGH_DB, color="#888888", linestyle=":", linewidth=1)
        panel.set(xscale="log", title=drawn["scene"], xlabel="ms a frame, one thread", ylim=(20, 165))
        panel.margins(x=0.25)
        plain_log(panel.xaxis)
    panels[0].set_ylabel("PSNR to truth, dB (dotted: nobody sees more)")
    marks = [Line2D([], [], label=name, **looks[name]) for name in names]
    figure.legend(handles=marks, loc="outside upper center", ncols=len(names), frameon=False, fontsize=9)
    return figure


def drawings(result: Row) -> dict[str, Drawing]:
    """What packets.json suffices for."""
    if not result["rays"]:
        return {}
    found = {
        FIGURE: Drawing(
            "Rays a second: the packet ray tracer by lanes and tree, and Embree (higher is better)",
            "The same rays, one thread; scattered: from the hits in any direction, in no order.",
            lambda: draw_rays(result),
        )
    }
    if result["drawn"]:
        found[EQUAL] = Drawing(
            "Ray tracing (star) against sphere tracing: time and error (upper left is better)",
            "Each marching phase by the hit distance and step cap with which it is fastest at equal error.",
            lambda: draw_equal(result),
        )
    return found
