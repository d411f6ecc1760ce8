"""Flights as tables and a figure, from flight.json alone; the throttle's choices, from throttle.json."""

import math
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from study.core import show
from study.core.show import Column
from study.experiments.flight.schema import FILE, THROTTLE, Flight, Large, Place, Row, Setting, Throttle, Way
from study.experiments.section import Found, Part, System, chapters, part
from study.measuring.hit_tables import gain, ms, to_truth, verdict, within
from study.pictures.draw import COLOURS, Drawing, plain_log

NAMES = {
    "rods": "rods, as in the article",
    "packets": "packets alone",
    "throttle": "rods and packets, by the throttle",
    "fastest": "the ladder",
}


def ways(row: Row, name: str) -> dict[float, Way]:
    """What was measured of one way, by the seconds of the places."""
    return {place.seconds: way for place in row.places for way in place.ways if way.name == name}


def rates(row: Row, name: str) -> list[float]:
    """Frames a second along the path."""
    return [1e3 / (way.ms or math.nan) for way in ways(row, name).values()]


def _summary(row: Row, name: str) -> show.Row:
    """One way along one path: the least, middle and most frames a second, the worst error."""
    made = list(ways(row, name).values())
    rate = sorted(rates(row, name))
    return {
        "scene": show.picture(row),
        "way": f"{NAMES[name]} ({made[0].phase})",
        "places": f"{len(made)} of {len(row.places)}",
        "least": rate[0],
        "middle": rate[len(rate) // 2],
        "most": rate[-1],
        "psnr": min((way.psnr_db for way in made if way.psnr_db is not None), default=None),
        "wrong": max(way.wrong_ppm or 0 for way in made),
        "evaluations": sum(way.evaluations or 0 for way in made) / len(made),
    }


SUMMARY = [
    Column("", "scene", show.word("scene")),
    Column("", "drawn by", show.word("way")),
    Column("", "places", show.word("places")),
    Column("frames a second", "least", show.plain("least")),
    Column("frames a second", "median", show.plain("middle")),
    Column("frames a second", "most", show.plain("most")),
    Column("worst place, to ground truth", "PSNR, dB", show.plain("psnr")),
    Column("worst place, to ground truth", "wrong hits, ppm", show.plain("wrong")),
    Column("", "evaluations a pixel", show.plain("evaluations")),
]


def _place(row: Row, place: Place) -> show.Row:
    made = {way.name: way for way in place.ways}
    said = words_of(made.get("throttle"))
    times = {name: ms(made[name]) if name in made else show.NOTHING for name in NAMES}
    return {"scene": row.scene, "seconds": place.seconds, "chosen": said, **times}


PLACES = [
    Column("", "scene", show.word("scene")),
    Column("", "time, s", show.plain("seconds")),
    Column("", "the throttle's choice", show.word("chosen")),
    *(Column("ms a frame [95 %]", text, show.word(name)) for name, text in NAMES.items()),
]


def sentence(row: Row) -> str:
    """The chapter's answer."""
    fast = ways(row, "fastest")
    phase = next(iter(fast.values())).phase
    over = []
    for name in ("rods", "packets"):
        found = sorted((way.ms or 0) / (fast[at].ms or 1) for at, way in ways(row, name).items())
        over.append(f"{show.number(found[0])} to {show.number(found[-1])} times as fast as {name}")
    rate, worst = sorted(rates(row, "fastest")), [way.psnr_db for way in fast.values() if way.psnr_db]
    near = f"{show.number(min(worst))} dB or more" if worst else "equal"
    return (
        f"Along {show.picture(row)}, one thread, {phase} is {' and '.join(over)}: {show.number(rate[0])} to "
        f"{show.number(rate[-1])} frames a second, {near} to ground truth."
    )


def _draw(row: Row, article: float) -> Figure:
    figure = Figure(figsize=(12, 4), layout="constrained")
    title = f"A flight through {row.scene}, {row.width}×{row.n} pixels, one thread"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    speed, error = figure.subplots(1, 2)
    for number, (name, words) in enumerate(NAMES.items()):
        if not (made := ways(row, name)):
            continue
        label = made[min(made)].phase if name == "fastest" else words
        style = {"color": COLOURS[number], "marker": "o", "markersize": 4, "label": label}
        speed.plot(list(made), rates(row, name), **style)
        near = [math.nan if way.psnr_db is None else way.psnr_db for way in made.values()]
        error.plot(list(made), near, **style)
    if "mandelbox" in row.scene:  # the article's own scene
        label = "the article's figure, of no stated size"
        speed.axhline(article, color="#888888", linestyle=":", label=label)
    speed.set(yscale="log", xlabel="time of the flight, s", ylabel="frames a second")
    plain_log(speed.yaxis)
    speed.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    error.set(xlabel="time of the flight, s", ylabel="PSNR to ground truth, dB", ylim=(0, None))
    handles, labels = speed.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9)
    return figure


def drawings(result: Flight) -> dict[str, Drawing]:
    note = f"{result.machine}; {result.launches} interleaved launches a place."
    article = result.article.frames_a_second
    return {
        f"flight-{row.scene}": Drawing(
            f"Frames a second and error along {show.picture(row)}", note, lambda row=row: _draw(row, article)
        )
        for row in result.rows
    }


def found(result: Flight) -> Found:
    """How fast a flight is drawn, and how near to ground truth."""
    summary = [_summary(row, name) for row in result.rows for name in NAMES if ways(row, name)]
    foot = (
        f"The article says {result.article.frames_a_second} frames a second of {result.article.of}, without "
        "a size or an error. The throttle takes the fastest of its settings with "
        f"{result.psnr_db:g} dB or more and {result.wrong_ppm:g} ppm of wrong hits or fewer, or with what "
        "packets alone reach where that is worse."
    )
    parts = part("flight", "Frames a second along a camera's path", summary, SUMMARY, foot)
    places = [_place(row, place) for row in result.rows for place in row.places]
    parts += part("flight-places", "Each place, and what the throttle chose there", places, PLACES)
    return Found(parts, " ".join(map(sentence, result.rows)), drawings(result))


section = chapters("flight", "A flight through a scene", FILE, Flight, found)


# --- the throttle of still scenes


def words_of(row: Setting | Way | None) -> str:
    if row is None:
        return "none is within the error"
    one = dict(word.split("=") for word in row.settings.split())
    steps, finish = (
        f"at most {one[key]} steps" if one[key] != "0" else "the scene's cap of steps"
        for key in ("steps", "finish")
    )
    return f"rods of {one['size']} to {one['least']} pixels by {steps}, each pixel finished by {finish}"


def apart(row: Large) -> str:
    psnr = "identical" if row.psnr_db is None else f"{show.number(row.psnr_db)} dB"
    return f"{'not finite' if row.non_finite else psnr}, {row.other_ppm:,.0f} ppm other hits"


TIME, EVALUATIONS, LARGER = "ms a frame [95 %]", "evaluations a pixel", "larger"
COLUMNS = [
    Column("", "scene", show.picture),
    Column("", "error allowed", lambda r: f"≥ {r.psnr_db:.4g} dB, ≤ {r.wrong_ppm:.4g} ppm"),
    Column("", "within it", lambda r: f"{r.within} of {r.tried - 1}"),
    Column("", "the throttle's choice", lambda r: words_of(r.chosen)),
    *within("chosen", [Column(TIME, "rods first", ms)]),
    *within("plain", [Column(TIME, "packets alone", ms)]),
    Column("", "gain [95 %]", gain),
    Column("", "verdict", verdict),
    *within(
        "large",
        [
            Column(LARGER, "size", lambda r: f"{r.width}×{r.n}"),
            Column(LARGER, "gain [95 %]", gain),
            Column(LARGER, "verdict", verdict),
            Column(LARGER, "against packets alone", apart),
        ],
    ),
    *within("chosen", [Column(EVALUATIONS, "rods first", show.plain("evaluations"))]),
    *within("plain", [Column(EVALUATIONS, "packets alone", show.plain("evaluations"))]),
    *within("chosen", to_truth("psnr", "wrong hits", group="rods first, to ground truth")),
    *within("plain", to_truth("psnr", "wrong hits", group="packets alone, to ground truth")),
]
IN_LESSON = ("scene0", "spheres40", "two_spheres", "mandelbulb", "cubes")
LESSON = [
    Column("", "scene", show.word("scene")),
    *within("chosen", [Column("", "settings", lambda r: r.settings.partition(" ")[2])]),
    *within("large", [Column("", "gain [95 %]", gain)]),
    Column("", EVALUATIONS, lambda r: " → ".join(show.number(w.evaluations) for w in (r.plain, r.chosen))),
]
FOOT = (
    "A choice is the fastest of several finalists, whose times thereby say too much: gains are of launches "
    "after it was made."
)


def throttle_parts(result: Throttle) -> list[Part]:
    caption = "Rods, then packets: the throttle's choice of each scene"
    return part("throttle", caption, result.rows, COLUMNS, FOOT)


def lessons(result: Throttle) -> list[Part]:
    """What the throttle gains on some scenes, and between which ends on all of them."""
    larges = [row.large for row in result.rows if row.large]
    least, most = (show.number(end(one.gain or 0 for one in larges)) for end in (min, max))
    about = f"Gains over packets alone at height {larges[0].n}, evaluations at {result.rows[0].n}"
    foot = (
        f"On {len(larges)} of {len(result.rows)} scenes one of {result.rows[0].tried - 1} settings with rods "
        f"keeps the error. The fastest gains {least}× to {most}×."
    )
    rows = [row for name in IN_LESSON for row in result.rows if row.scene == name and row.large]
    return part("rods_simd", f"{about}; {result.launches} interleaved launches", rows, LESSON, foot)


def system(run: Path) -> System | None:
    result = Throttle.load_if_there(run / THROTTLE)
    return System([], throttle_parts(result), lessons=lambda: lessons(result)) if result else None
