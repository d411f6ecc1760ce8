"""Flights as tables and a figure, made from flight.json alone."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from study.core import machine, show
from study.core.show import Column
from study.experiments.flight.measure import FILE, Row
from study.experiments.flight.schema import Flight
from study.experiments.section import Found, Section, chapter, part
from study.pictures.draw import COLOURS, Drawing

NAMES = {
    "rods": "rods, as in the article",
    "packets": "packets alone",
    "throttle": "rods and packets, by the throttle",
    "fastest": "the ladder",
}


def ways(row: Row, name: str) -> list[tuple[float, Row]]:
    """Seconds and what was measured there, of one way."""
    found = [(place["seconds"], way) for place in row["places"] for way in place["ways"]]
    return [(seconds, way) for seconds, way in found if way["name"] == name]


def rates(row: Row, name: str) -> list[float]:
    """Frames a second along the path."""
    return [1e3 / way["ms"] for _, way in ways(row, name)]


def _summary(row: Row, name: str) -> Row:
    """One way along one path: the least, middle and most frames a second, the worst error."""
    made = [way for _, way in ways(row, name)]
    rate = sorted(rates(row, name))
    psnr = [way["psnr_db"] for way in made if way["psnr_db"] is not None]
    return {
        "scene": f"{row['scene']}, {row['width']}×{row['n']}",
        "way": f"{NAMES[name]} ({made[0]['phase']})",
        "places": f"{len(made)} of {len(row['places'])}",
        "least": rate[0],
        "middle": rate[len(rate) // 2],
        "most": rate[-1],
        "psnr": min(psnr) if psnr else None,
        "wrong": max(way["wrong_ppm"] for way in made),
        "evaluations": sum(way["evaluations"] for way in made) / len(made),
    }


SUMMARY = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "drawn by", lambda r: r["way"]),
    Column("", "places", lambda r: r["places"]),
    Column("frames a second", "least", show.plain("least")),
    Column("frames a second", "median", show.plain("middle")),
    Column("frames a second", "most", show.plain("most")),
    Column("worst place, to ground truth", "PSNR, dB", show.plain("psnr")),
    Column("worst place, to ground truth", "wrong hits, ppm", show.plain("wrong")),
    Column("", "evaluations a pixel", show.plain("evaluations")),
]


def _place(row: Row, place: Row) -> Row:
    """One place: a frame's time by each way, and what the throttle chose."""
    made = {way["name"]: way for way in place["ways"]}
    chosen = made.get("throttle")
    said = f"none of {place['within']}" if place["within"] else "none is within the error"
    if chosen:
        one = dict(word.split("=") for word in chosen["settings"].split())
        cap = "the scene's cap of" if one["steps"] == "0" else f"at most {one['steps']}"
        said = f"rods of {one['size']} to {one['least']} pixels, {cap} steps"
    times = {name: show.interval(made[name], "ms", 3) if name in made else show.NOTHING for name in NAMES}
    return {"scene": row["scene"], "seconds": place["seconds"], "chosen": said, **times}


PLACES = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "time, s", show.plain("seconds")),
    Column("", "the throttle's choice", lambda r: r["chosen"]),
    *(Column("ms a frame [95 %]", NAMES[name], lambda r, name=name: r[name]) for name in NAMES),
]


def _range(row: Row, name: str) -> str:
    """Frames a second and the worst error of one way, in words."""
    found = _summary(row, name)
    least, most = (show.number(found[key]) for key in ("least", "most"))
    near = "equal" if found["psnr"] is None else f"{show.number(found['psnr'])} dB or more"
    here = (
        ""
        if found["places"] == f"{len(row['places'])} of {len(row['places'])}"
        else (f" in {found['places']} places")
    )
    who = ways(row, name)[0][1]["phase"] if name == "fastest" else NAMES[name]
    return f"{who}: {least} to {most} frames a second{here}, {near} to ground truth"


def sentence(row: Row) -> str:
    """For a terminal, and the chapter's answer."""
    said = "; by ".join(_range(row, name) for name in NAMES if ways(row, name))
    if not ways(row, "throttle"):
        said += "; no setting of the throttle is within the error allowed"
    phase = ways(row, "fastest")[0][1]["phase"]
    times = " and ".join(f"{_times(row, name)} times as fast as {name}" for name in ("rods", "packets"))
    where = f"Along {row['scene']}, {row['width']}×{row['n']}, one thread"
    return f"{where}, {phase} is {times}. By {said}."


def _times(row: Row, name: str) -> str:
    """The ladder's frames a second over that way's, from the least to the most of the places."""
    slow, fast = dict(ways(row, name)), dict(ways(row, "fastest"))
    ratios = sorted(slow[at]["ms"] / fast[at]["ms"] for at in slow.keys() & fast.keys())
    return f"{show.number(ratios[0])} to {show.number(ratios[-1])}"


def _draw(row: Row, article: float) -> Figure:
    """Frames a second and error along the path, a line a way. `article`: its frames a second."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    title = f"A flight through {row['scene']}, {row['width']}×{row['n']} pixels, one thread"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    speed, error = figure.subplots(1, 2)
    for number, (name, words) in enumerate(NAMES.items()):
        made = ways(row, name)
        if not made:
            continue
        seconds = [at for at, _ in made]
        label = made[0][1]["phase"] if name == "fastest" else words
        style = {"color": COLOURS[number], "markersize": 4, "label": label}
        speed.plot(seconds, rates(row, name), "o-", **style)
        near = [math.nan if way["psnr_db"] is None else way["psnr_db"] for _, way in made]
        error.plot(seconds, near, "o-", **style)
    if "mandelbox" in row["scene"]:  # the article's own scene
        label = "the article's figure, of no stated size"
        speed.axhline(article, color="#888888", linestyle=":", label=label)
    speed.set(yscale="log", xlabel="time of the flight, s", ylabel="frames a second")
    speed.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    speed.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    speed.yaxis.set_minor_formatter(NullFormatter())
    error.set(xlabel="time of the flight, s", ylabel="PSNR to ground truth, dB", ylim=(0, None))
    handles, labels = speed.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9)
    return figure


def drawings(result: Row) -> dict[str, Drawing]:
    note = f"{machine.name(result.get('context'))}; {result['launches']} interleaved launches a place."
    article = result["article"]["frames_a_second"]
    return {
        f"flight-{row['scene']}": Drawing(
            f"Frames a second and error along {row['scene']}, {row['width']}×{row['n']}",
            note,
            lambda row=row: _draw(row, article),
        )
        for row in result["rows"]
    }


def _found(result: Row) -> Found:
    summary = [_summary(row, name) for row in result["rows"] for name in NAMES if ways(row, name)]
    places = [_place(row, place) for row in result["rows"] for place in row["places"]]
    said = result["article"]
    foot = (
        f"The article says {said['frames_a_second']} frames a second of {said['of']}, without a size or an "
        f"error. The throttle takes the fastest of its settings with {result['psnr_db']:g} dB or more and "
        f"{result['wrong_ppm']:g} ppm of wrong hits or fewer, or with what packets alone reach where that is "
        "worse."
    )
    tables = part("flight", "Frames a second along a camera's path", summary, SUMMARY, foot)
    tables += part("flight-places", "Each place, and what the throttle chose there", places, PLACES)
    return Found(tables, " ".join(map(sentence, result["rows"])), drawings(result))


def section(path: Path) -> Section:
    """The chapter: how fast a flight is drawn, and how near to ground truth."""
    return chapter("flight", "A flight through a scene", path / FILE, Flight.read_if_there, _found)
