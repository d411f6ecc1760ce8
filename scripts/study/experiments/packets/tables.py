"""The packet ray tracer as tables and sentences: from packets.json alone."""

from __future__ import annotations

from study.core import show
from study.core.show import Column
from study.experiments.packets.measure import EMBREE, Row, reached, target_of
from study.experiments.section import Part, part

OF_KIND = {
    "primary": "camera",
    "shadow": "to the light",
    "mirror": "mirrored",
    "scattered": "in any direction, in no order",
}
WAYS = dict(zip(EMBREE, ("packets of 16", "single rays", "256 rays a call"), strict=True))


def variant(row: Row, name: str) -> Row | None:
    """Of a row of rays: one of ours by its name; None where it was not timed."""
    return next((v for v in row["variants"] if v["name"] == name), None)


def rate(row: Row | None) -> str:
    """Million rays a second with the interval."""
    return show.NOTHING if row is None else show.interval(row, "mrays", 3)


def _of(name: str):
    return lambda row: rate(variant(row, name))


def _ratio(key: str):
    return lambda row: show.NOTHING if row.get(key) is None else show.interval(row, key, 3, "×")


def fastest(row: Row) -> str | None:
    """Embree's fastest way for these rays, of those that were timed: an older file has no streams."""
    timed = [way for way in EMBREE if row.get(way) is not None]
    return max(timed, key=lambda way: row[way]["mrays"], default=None)


def over_fastest(row: Row) -> str:
    """Our rate over that of Embree's fastest way, with the way and its version."""
    way = fastest(row)
    if way is None:
        return f"{show.NOTHING} over {row['embree']}"
    return f"{_ratio(f'{way}_ratio')(row)} over Embree by {WAYS[way]} ({row['embree']})"


def agreement(row: Row) -> str:
    """How many hits are others than Embree's, and how far off the same ones are in scene units."""
    found = row["agreement"]
    if found is None:
        return show.NOTHING
    off = "" if found["dt_max"] is None else f", |Δt| ≤ {show.number(found['dt_max'], 2)}"
    return f"{found['other_shape']} of {found['compared']:,} others{off}"


MANY = "million rays a second [95 %]"
RAYS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "rays", lambda r: f"{OF_KIND[r['kind']]} ({r['rays']:,})"),
    Column(MANY, "here", _of("own")),
    *(Column(MANY, f"Embree, {text}", lambda r, w=way: rate(r.get(w))) for way, text in WAYS.items()),
    *(
        Column("here over Embree [95 %]", text, _ratio(f"{way}_ratio"))
        for way, text in zip(EMBREE, ("packets", "single", "256 a call"), strict=True)
    ),
    Column("", "hits, ours and Embree's", agreement),
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
    Column("to ground truth", "PSNR, dB", lambda r: show.number(r["psnr_db"])),
    Column("to ground truth", "wrong hits, ppm", lambda r: show.number(r["wrong_ppm"])),
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
    Column("to ground truth", "PSNR, dB", lambda r: show.number(r["psnr_db"])),
    Column("to ground truth", "wrong hits, ppm", lambda r: show.number(r["wrong_ppm"])),
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
        f"{r['scene']}, {r['kind']}: {rate(variant(r, 'own'))} million rays a second; over Embree's "
        + ", ".join(f"{text} {_ratio(f'{way}_ratio')(r)}" for way, text in WAYS.items())
        + f"; {agreement(r)}"
        for r in result["rays"]
    ]
    return found + [
        f"{r['scene']}, {r['phase']}, {r['threads']} threads: {show.interval(r, 'ms', 3)} ms, "
        f"{show.number(r['psnr_db'])} dB; packets {_gain(r)}; equal error: {r['equal']}"
        for r in drawn_rows(result)
    ]


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


def parts(result: Row) -> list[Part]:
    """Its tables on the page; none without rows."""
    if not result["rays"]:
        return []
    caption = "Packet ray tracing: rays a second, beside Embree on the same rays"
    found = part("packets", caption, result["rays"], RAYS, beside(result))
    caption = "Ray tracing against sphere tracing: time to equal error"
    found += part("packets-equal-error", caption, drawn_rows(result), DRAWN, NOTE)
    caption = "Packet ray tracing: trees, lanes, roots"
    found += part("packets-variants", caption, result["rays"], VARIANTS)
    caption = "Packet ray tracing: the exact root and the approximate one in whole frames"
    return found + part("packets-roots", caption, result.get("roots", []), ROOTS)


def beside(result: Row) -> str:
    """How rays are traced by both, and which Embree that is, or why there is none."""
    which = sorted({f"Embree: {row['embree']}." for row in result["rays"]})
    return "\n".join([*([BESIDE] * any(r["embree16"] is not None for r in result["rays"])), *which])
