"""Charts that answer the mouse (Vega-Lite): scenes and phases to choose, zoom, numbers under the pointer.

A page with one has Vega's scripts in it (`scripts`), so that it needs no network.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import altair
import pandas as pd
import vl_convert

from study.pictures.draw import look

HEIGHT = 380
ZOOM = (
    "Left is faster, up is nearer. Large marks: the scene's own parameters; faint ones were launched once. "
    "Point at a mark for its numbers; a click on the legend chooses phases, with shift several. "
    "Drag to move, shift and the wheel to zoom, a double click shows all."
)
SHAPES = {  # of Matplotlib's markers
    "o": "circle",
    "s": "square",
    "^": "triangle-up",
    "D": "diamond",
    "v": "triangle-down",
    "P": "cross",
    "X": "M-1,-.6L-.6,-1L0,-.4L.6,-1L1,-.6L.4,0L1,.6L.6,1L0,.4L-.6,1L-1,.6L-.4,0Z",
    "<": "triangle-left",
    ">": "triangle-right",
    "p": "M0,-1L.95,-.31L.59,.81L-.59,.81L-.95,-.31Z",
    "H": "M1,0L.5,.87L-.5,.87L-1,0L-.5,-.87L.5,-.87Z",
}
STAR = "M0,-1L.25,-.25L1,0L.25,.25L0,1L-.25,.25L-1,0L-.25,-.25Z"


@dataclass(frozen=True)
class Point:
    """A program's speed and error on a scene: `ns` a pixel, decibels to either ground truth (None: not
    measured); `text`: the interval and the parameters; `own`: by the scene's own parameters."""

    scene: str
    phase: str
    ns: float
    text: str
    paper: float | None
    ideal: float | None
    own: bool
    timed: bool


@dataclass(frozen=True)
class Ratio:
    """A phase's speed-up over `base` on a machine; `text`: with its interval; `label`: with its error."""

    machine: str
    scene: str
    base: str
    phase: str
    value: float
    low: float | None
    high: float | None
    text: str
    label: str


def scripts() -> str:
    """Vega, Vega-Lite and vegaEmbed, for a <script>; their names stay inside."""
    return f"(() => {{{vl_convert.javascript_bundle()}}})();"


def _place(chart: altair.LayerChart, hint: str) -> str:
    """HTML: the chart's specification, the place that it is drawn in, and how it is used."""
    shown = chart.properties(width="container", height=HEIGHT, background="white")
    shown = shown.configure_axis(labelFontSize=12, titleFontSize=12).configure_legend(labelFontSize=12)
    text = shown.to_json(indent=None).replace("<", "\\u003c")
    place = f'<div class="chart"><script type="application/json">{text}</script></div>'
    return f'{place}\n<p class="small">{hint}</p>'


def _looks(phases: Sequence[str]) -> tuple[altair.Scale, altair.Scale]:
    bases = [name.partition("+")[0] for name in phases]
    found = look(pd.DataFrame({"phase": bases, "threads": 1}))
    styles = [found[base, 1] for base in bases]
    colours = altair.Scale(domain=phases, range=[one["color"] for one in styles])
    return colours, altair.Scale(domain=phases, range=[SHAPES.get(one["marker"], STAR) for one in styles])


def _choice(name: str, label: str, options: Sequence[str]) -> altair.Parameter:
    return altair.param(name, value=options[0], bind=altair.binding_select(options=options, name=f"{label} "))


def _known(values: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(values))


def speed_and_error(points: Sequence[Point]) -> str:
    """Left is faster, up is nearer; the line is the front of the phases that are shown."""
    phases, scenes = _known([one.phase for one in points]), _known([one.scene for one in points])
    colours, shapes = _looks(phases)
    scene, truth = _choice("scene", "Scene", scenes), _choice("truth", "Shadow", ["the paper's", "ideal"])
    shown = altair.selection_point("shown", fields=["phase"], bind="legend", toggle="event.shiftKey")
    zoom = altair.selection_interval("zoom", bind="scales", zoom="wheel![event.shiftKey]")
    across = altair.X("ns:Q", title="time, ns per pixel").scale(type="log", nice=False, padding=12)
    up = altair.Y("psnr:Q", title="PSNR to ground truth, dB").scale(zero=False, padding=12)
    base = (
        altair.Chart(pd.DataFrame([asdict(one) for one in points]))
        .transform_filter("datum.scene == scene")
        .transform_calculate(psnr="truth == 'ideal' ? datum.ideal : datum.paper")
        .transform_filter("isValid(datum.psnr)")
        .transform_filter(shown)
    )
    front = (
        base.transform_filter("datum.timed")
        .transform_window(best="max(psnr)", frame=[None, 0], sort=[altair.SortField("ns")])
        .transform_filter("datum.psnr >= datum.best")
        .mark_line(color="#555555", interpolate="step-after", strokeWidth=1.3)
        .encode(x=across, y=up)
    )
    marks = (
        base.mark_point(filled=True, stroke="black", strokeWidth=0.4)
        .encode(
            x=across,
            y=up,
            color=altair.Color("phase:N", scale=colours).legend(orient="bottom", columns=3, title=None),
            shape=altair.Shape("phase:N", scale=shapes).legend(orient="bottom", columns=3, title=None),
            size=altair.condition("datum.own", altair.value(110), altair.value(22)),
            opacity=altair.condition("datum.own || datum.timed", altair.value(1), altair.value(0.35)),
            tooltip=[
                "phase",
                "scene",
                altair.Tooltip("text", title="ns/pixel"),
                altair.Tooltip("psnr:Q", title="dB"),
            ],
        )
        .add_params(zoom)
    )
    chart = (front + marks).add_params(scene, truth, shown)
    return _place(chart, ZOOM)


def speedups(ratios: Sequence[Ratio]) -> str:
    """The ladder of a machine and scene over a base, with the error of each phase beside it."""
    phases, scenes = _known([one.phase for one in ratios]), _known([one.scene for one in ratios])
    machines, bases = _known([one.machine for one in ratios]), _known([one.base for one in ratios])
    colours, shapes = _looks(phases)
    chosen = (
        _choice("machine", "Machine", machines),
        _choice("scene", "Scene", scenes),
        _choice("base", "Over", bases),
    )
    base = altair.Chart(pd.DataFrame([asdict(one) for one in ratios])).transform_filter(
        "datum.machine == machine && datum.scene == scene && datum.base == base"
    )
    rows = altair.Y("phase:N", sort=phases, title=None)
    across = altair.X("value:Q", title="speed-up, ×, or ms a frame").scale(type="log", nice=False, padding=60)
    texts = altair.Tooltip("text", title="interval"), altair.Tooltip("label", title="PSNR")
    bars = base.mark_rule(strokeWidth=2.5).encode(
        x="low:Q", x2="high:Q", y=rows, color=altair.Color("phase:N", scale=colours, legend=None)
    )
    marks = base.mark_point(filled=True, size=110, stroke="black", strokeWidth=0.4, opacity=1).encode(
        x=across,
        y=rows,
        color=altair.Color("phase:N", scale=colours, legend=None),
        shape=altair.Shape("phase:N", scale=shapes, legend=None),
        tooltip=["phase", "scene", *texts],
    )
    words = base.mark_text(align="left", dx=12, fontSize=10).encode(x=across, y=rows, text="label:N")
    chart = (bars + marks + words).add_params(*chosen)
    return _place(chart, "Point at a mark for its interval.")
