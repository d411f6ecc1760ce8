"""The packet ray tracer as tables and a figure, from packets.json alone."""

from pathlib import Path

from matplotlib.figure import Figure
from msgspec.structs import asdict

from study.core import show
from study.core.show import Column
from study.experiments.packets.measure import EMBREE, ENOUGH_DB, MOST_OTHERS, reached, target_of
from study.experiments.packets.schema import FILE, Drawn, Packets, Rate, Rays, Scene
from study.experiments.section import Claim, Part, System, part
from study.measuring import hit_tables
from study.measuring.function_bench import VECTORS
from study.pictures.draw import COLOURS, MARKERS, Drawing, plain_log

OF_KIND = {
    "primary": "camera",
    "shadow": "to the light",
    "mirror": "mirrored",
    "scattered": "in any direction, in no order",
}
WAYS = dict(zip(EMBREE, ("packets of 16", "single rays", "256 rays a call"), strict=True))
MANY = "million rays a second [95 %]"


def variant(row: Rays, name: str) -> Rate | None:
    """One of ours by its name; None where it was not timed."""
    return next((one for one in row.variants if one.name == name), None)


def rate(row: Rate | None) -> str:
    return show.NOTHING if row is None else show.interval(row, "mrays", 3)


def _ratio(row: Rays, way: str) -> str:
    return show.NOTHING if getattr(row, way) is None else show.interval(row, f"{way}_ratio", 3, "×")


def fastest(row: Rays) -> str | None:
    """Embree's fastest way for these rays, of those that were timed."""
    timed = {way: found.mrays for way in EMBREE if (found := getattr(row, way))}
    return max(timed, key=lambda way: timed[way], default=None)


def agreement(row: Rays) -> str:
    """How many hits are others than Embree's, and how far off the same ones are in scene units."""
    found = row.agreement
    if found is None:
        return show.NOTHING
    off = "" if found.dt_max is None else f", |Δt| ≤ {show.number(found.dt_max, 2)}"
    return f"{found.other_shape} of {found.compared:,} others{off}"


def _unlike(row: Rays) -> str:
    met = row.agreement
    return f"{1e6 * met.other_shape / met.compared:,.0f} ppm" if met and met.compared else show.NOTHING


def _variants(names: dict[str, str]) -> list[Column]:
    return [
        Column(MANY, text, lambda row, name=name: rate(variant(row, name))) for name, text in names.items()
    ]


RAYS = [
    Column("", "scene", show.word("scene")),
    Column("", "rays", lambda r: f"{OF_KIND[r.kind]} ({r.rays:,})"),
    *_variants({"own": "here"}),
    *(Column(MANY, f"Embree, {text}", lambda r, w=way: rate(getattr(r, w))) for way, text in WAYS.items()),
    *(
        Column("here over Embree [95 %]", text, lambda r, w=way: _ratio(r, w))
        for way, text in zip(EMBREE, ("packets", "single", "256 a call"), strict=True)
    ),
    Column("", "hits, ours and Embree's", agreement),
]
IN_LESSON = {"spheres40": ("primary", "scattered"), "spheres4096": ("primary", "shadow", "scattered")}
LESSON = [
    Column("", "rays", lambda r: f"{r.scene}, {r.kind}"),
    *_variants({"own": "here"}),
    Column("", "kd-tree", lambda r: rate(variant(r, "kd-tree")).partition(" ")[0]),
    Column("", "Embree [95 %]", lambda r: rate(getattr(r, fastest(r) or "", None))),
    Column("", "ratio [95 %]", lambda r: _ratio(r, fastest(r) or EMBREE[0])),
]
VARIANTS = [
    Column("", "scene", show.word("scene")),
    Column("", "rays", lambda r: OF_KIND[r.kind]),
    *_variants(
        {"own": "BVH, widest", "kd-tree": "kd-tree", "8 lanes": "8 lanes (AVX2)", "4 lanes": "4 lanes (SSE2)"}
        | {"each alone": "each ray alone", "root by Newton": "approximate root, one Newton step"}
    ),
    Column("", "|Δt| of that root", show.plain("newton_dt_max", 2)),
]


def equal(drawn: Scene, row: Drawn) -> str:
    """Whether the error is ray tracing's, or as small as anybody sees."""
    if row.phase == "packets":
        return show.NOTHING
    traced = next(one for one in drawn.rows if one.phase == "packets")
    if reached(row, target_of(traced)):
        return "reached"
    return f"not reached: {show.number(row.psnr_db)} dB" if row.non_finite == 0 else "not finite"


def drawn_rows(result: Packets) -> list[show.Row]:
    """A row for each scene, phase and number of threads."""
    return [
        {
            "scene": show.picture(drawn),
            "phase": row.phase,
            "hit_distance": row.hit_distance,
            "max_steps": row.max_steps,
            "psnr_db": row.psnr_db,
            "wrong_ppm": row.wrong_ppm,
            "equal": equal(drawn, row),
            **asdict(timed),
        }
        for drawn in result.drawn
        for row in drawn.rows
        for timed in row.threads
    ]


def _gain(row: show.Row) -> str:
    return "base" if row.get("phase") == "packets" else show.interval(row, "gain", 3, "×")


def _own(name: str, title: str) -> Column:
    return Column("", title, lambda r: "the scene's" if r[name] is None else f"{r[name]:g}")


DRAWN = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "threads", show.word("threads")),
    _own("hit_distance", "hit distance"),
    _own("max_steps", "step cap"),
    Column("", "ms a frame [95 %]", lambda r: show.interval(r, "ms", 3)),
    Column("", "packets is faster by [95 %]", _gain),
    Column("", "equal error", show.word("equal")),
    Column(hit_tables.TRUTH, "PSNR, dB", show.plain("psnr_db")),
    Column(hit_tables.TRUTH, "wrong hits, ppm", show.plain("wrong_ppm")),
]
BESIDE = (
    "Rays go through both tracers on one thread, in one order, by turns in one process; Embree's time "
    "is of its tracing alone. Ours gets all rays in one call and shares a frustum among up to 256; "
    "Embree gets packets of 16, single rays, or (Embree 3) 256 a call, and is told which rays go the "
    "same way. trio_balls is a handful of spheres and planes: no test of a tree. spheres4096 is one."
)
NOTE = (
    "Equal error: each marching phase by the hit distance and the cap of steps with which it is fastest"
    " among those that reach the PSNR of packets, or 80 dB. Where none does, by those that come "
    "nearest."
)


def faults(result: Packets) -> list[str]:
    """What must not be: hits that Embree does not have, samples that are not finite."""
    found = [
        f"{r.scene}, {r.kind}: {r.agreement.other_shape} hits are others than Embree's"
        for r in result.rays
        if r.agreement and r.agreement.other_shape > 2 + MOST_OTHERS * r.rays
    ]
    pictures = [(f"{drawn.scene}, {row.phase}", row) for drawn in result.drawn for row in drawn.rows]
    return found + hit_tables.not_finite(pictures)


def parts(result: Packets) -> list[Part]:
    which = sorted({f"Embree: {row.embree}." for row in result.rays})
    equal_error = "Ray tracing against sphere tracing: time to equal error"
    foot = "\n".join([*([BESIDE] * any(row.embree16 for row in result.rays)), *which])
    return [
        *part("packets", "Packet ray tracing: rays a second, beside Embree", result.rays, RAYS, foot),
        *part("packets-equal-error", equal_error, drawn_rows(result), DRAWN, NOTE),
        *part("packets-variants", "Packet ray tracing: trees, lanes, roots", result.rays, VARIANTS),
    ]


def normalise_claims(result: Packets) -> list[Claim]:
    """Scalar code, SSE by the approximate root and one Newton step, and the one over the other."""
    rows = {(row.isa, row.layout, row.name): row for row in result.normalise if row.vectors == VECTORS}
    scalar, sse = rows.get(("scalar", "AoS", "1/sqrt")), rows.get(("SSE", "SoA", "rsqrtps + 1"))
    if scalar is None or sse is None:
        return []
    said, article, made = result.article, "packet rays (P2)", []
    for row, theirs in ((scalar, said.scalar_ms), (sse, said.sse_ms)):
        times, error = theirs / row.ms, f"≤ {show.number(row.max_ulp, 2)} ulp"
        what, ratio = f"normalising {VECTORS:,} vectors, {row.isa}, ms", f"{show.number(times)}×"
        made.append(Claim(article, what, f"{theirs:g}", hit_tables.ms(row), ratio, error, times))
    ratio, times_said = f"{show.number((sse.gain or 0) / said.speed_up)}×", f"{said.speed_up}×"
    ours = hit_tables.gain(sse)
    return [*made, Claim(article, "normalising, SSE over scalar", times_said, ours, ratio, error)]


def draw_equal(result: Packets) -> Figure:
    """Time on one thread against error to ground truth, a panel a scene."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, len(result.drawn), squeeze=False)[0]
    names = list(dict.fromkeys(row.phase for drawn in result.drawn for row in drawn.rows))
    for panel, drawn in zip(panels, result.drawn, strict=True):
        for row in drawn.rows:
            if row.non_finite:  # no PSNR for another reason than 160 dB's
                continue
            i, traced = names.index(row.phase), row.phase == "packets"
            colour = COLOURS[4] if traced else COLOURS[(0, 1, 2, 3, 5, 6)[i % 6]]
            marker = "*" if traced else MARKERS[i % len(MARKERS)]
            style = {"marker": marker, "markersize": 14 if traced else 7, "color": colour}
            point = [row.threads[0].ms], [160 if row.psnr_db is None else row.psnr_db]
            panel.plot(*point, linestyle="none", label=row.phase, **style)
        panel.axhline(ENOUGH_DB, color="#888888", linestyle=":", linewidth=1)
        panel.set(xscale="log", title=drawn.scene, xlabel="ms a frame, one thread", ylim=(20, 165))
        panel.margins(x=0.25)
        plain_log(panel.xaxis)
    panels[0].set_ylabel("PSNR to ground truth, dB (dotted: nobody sees more)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(names), frameon=False, fontsize=9)
    return figure


def drawings(result: Packets) -> dict[str, Drawing]:
    title = "Ray tracing (star) against sphere tracing: time and error (upper left is better)"
    note = "Each marching phase by the hit distance and step cap with which it is fastest at equal error."
    drawn = Drawing(title, note, lambda: draw_equal(result))
    return {"packets-equal-error": drawn} if result.drawn else {}


def rays_claims(result: Packets) -> list[Claim]:
    """The article's “millions of rays per second”, beside Embree: the scenes and kinds of rays where ours is
    fastest and slowest over it."""
    rows = [(getattr(r, f"{way}_ratio"), way, r) for r in result.rays if (way := fastest(r))]
    rows.sort(key=lambda one: one[0])
    return [
        Claim(
            "packet rays (P2)",
            f"{row.scene}, rays {OF_KIND[row.kind]}, million a second",
            "“millions”",
            rate(variant(row, "own")),
            _ratio(row, way),
            _unlike(row),
            beside=times,
        )
        for times, way, row in (*rows[:1], *rows[1:][-1:])
    ]


def lessons(result: Packets) -> list[Part]:
    """Kinds of rays beside Embree's fastest way, the hits of all, a picture beside sphere tracing."""
    rows = [row for row in result.rays if row.kind in IN_LESSON.get(row.scene, ())]
    met = [row.agreement for row in result.rays if row.agreement]
    others, compared = sum(one.other_shape for one in met), sum(one.compared for one in met)
    told = [f"{others} of {compared:,} hits are others than Embree's."]
    for drawn in result.drawn:
        times = [
            f"{row.phase} takes {hit_tables.ms(row.threads[0])} ms at {show.number(row.psnr_db)} dB"
            for row in drawn.rows
            if row.phase in ("packets", "opt8_streams")
        ]
        told += [f"On {show.picture(drawn)}, {', '.join(times)}."] * (drawn.scene == "spheres40")
    about = f"Rays beside {result.rays[0].embree.partition(',')[0]}, by the fastest of its three ways"
    return part("packets", f"{about}; {result.launches} interleaved launches", rows, LESSON, " ".join(told))


def system(run: Path) -> System | None:
    result = Packets.load_if_there(run / FILE)
    if result is None:
        return None
    note = (
        f"P2: {result.article.cpu}; “millions of rays per second, per core”. Of all "
        "scenes and kinds of rays here are the best and the worst; their ratio is over Embree's fastest way."
    )
    claims = [*normalise_claims(result), *rays_claims(result)]
    return System(claims, parts(result), note, drawings(result), lessons=lambda: lessons(result))
