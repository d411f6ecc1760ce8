"""Where the time goes, and what bounds it."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from study.bounds.schema import SCHEMAS, Hotspots
from study.core.registry import Spec, cpu_supports, ladder
from study.core.show import cell
from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.hotspots import bounds_tables, command, tables
from study.experiments.section import Section, part
from study.pictures.draw import Drawing

SAMPLES, QUICK = "1500", "600"  # of a phase


def calls(study: Study) -> list[Call]:
    """Table 3 is about one step, structs to arrays, which the ladder's opt2 has among others."""
    scenes = study.scenes if study.depth == "full" else study.scenes[:1]
    samples = QUICK if study.quick else SAMPLES
    fast = [] if study.depth == "full" else ["--samples", samples]
    fast += ["-n", "120"] if study.quick else []
    arrays = ["opt1+arrays"] if "opt1" in ladder() else []
    names = [*ladder(), *arrays]
    if study.quick:
        first, *others = cuts.three()[:2]  # the last is compiled for minutes, twice
        names = [first, *(["opt1"] if arrays else []), *arrays, *others]
    names = [name for name in names if cpu_supports(Spec.parse(name))]
    words = ["--phase", *names, "--scene", *scenes, *fast, "--run", str(study.run)]
    return [Call("hotspots", words, judges=False, may_lack=True)]


HOTSPOTS = {
    "baseline": "Table 2a: where the time of baseline goes",
    "opt1": "Table 2b: where the time of opt1 goes",
    "opt2": "Table 4a: where the time of opt2 goes",
    "opt3": "Table 4b: where the time of opt3 goes",
}
# Shades of a phase's functions; the others are one piece.
SHADES = ("#0072B2", "#3D94C6", "#76B3D6", "#A9CFE5", "#D3E6F1")
OTHERS = "#e6e6e6"
NOTE = (
    "CPU time of one frame, sampled; inlined code is counted to the function of the source that it is from."
)


def hot(path: Path, microarchitecture: str | None = None) -> Section:
    """Tables 2 and 4 (functions) and 3 (what bounds them). `microarchitecture`: of the run's CPU."""
    file = path / "hotspots.json"
    record = Hotspots.load_if_there(file) or Hotspots()
    rows = tables.table_rows(record, widest=tables.core_width(microarchitecture))
    parts, drawn = [], {}
    for phase in dict.fromkeys(row.phase for row in rows):
        mine = [row for row in rows if row.phase == phase]
        title = HOTSPOTS.get(phase, f"Where the time of {phase} goes")
        parts += part(f"hotspots-{phase}", title, mine, tables.COLUMNS, tables.ABOUT)
    split = bounds_tables.rows(record) if record.bounds else []
    caption = "Table 3: what the cycles went to, structs against arrays"
    parts += part("table3", caption, split, bounds_tables.COLUMNS, bounds_tables.ABOUT)
    regions = bounds_tables.region_rows(record)
    parts += part("table3-regions", "The hot regions under the model", regions, bounds_tables.REGIONS)
    if rows:
        caption = "The functions that take most of a frame, phase by phase"
        drawn = {"hotspots": Drawing(caption, NOTE, lambda: draw(rows))}
    about = {"file": file, "script": "scripts/stepwise hotspots", "drawn": drawn}
    about |= {"details": tables.notes(record), "answer": _answer(rows) if rows else ""}
    return Section("hotspots", "Hotspots", "make hotspots", parts, **about)


def _answer(rows: list[tables.Row]) -> str:
    """The function that takes most of a frame, of the first phase and of the last."""
    names = list(dict.fromkeys(row.phase for row in rows))
    last = [name for name in names if "+" not in name or name == names[0]][-1]
    said = []
    for name in dict.fromkeys((names[0], last)):
        build, found = tables.top(rows, name, 1)
        if found:
            value, low, high = (cell(found[0], f"{build}_percent{end}") for end in ("", "_low", "_high"))
            said.append(f"{value:.1f} [{low:.1f}, {high:.1f}] % of {name}'s frame is in {found[0].function}")
    return f"On {rows[0].scene}, {'; '.join(said)}." if said else ""


def draw(rows: Sequence[tables.Row]) -> Figure:
    """A bar a phase: its functions of most time, named where the name has room, and the rest."""
    names = list(dict.fromkeys(row.phase for row in rows))
    figure = Figure(figsize=(11, 0.42 * len(names) + 1.3), layout="constrained")
    figure.suptitle("Where the time of a frame goes", x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    for place, name in enumerate(names):
        left = 0.0
        build, mine = tables.top(rows, name, len(SHADES))
        for shade, row in enumerate(mine):
            share, text = cell(row, f"{build}_percent"), row.function
            axes.barh(place, share, 0.8, left, color=SHADES[shade], edgecolor="white")
            if len(text) * 0.82 + 1 < share:
                ink = "white" if shade < 2 else "black"
                axes.text(left + share / 2, place, text, fontsize=7.5, color=ink, ha="center", va="center")
            left += share
        axes.barh(place, max(0.0, 100 - left), 0.8, left, color=OTHERS, edgecolor="white")
        axes.text(99, place, f"others {max(0.0, 100 - left):.0f} %", fontsize=7.5, ha="right", va="center")
    axes.set_yticks(range(len(names)), names, fontsize=9)
    axes.set(xlim=(0, 100), ylim=(len(names) - 0.5, -0.5), xlabel="% of the frame")
    axes.grid(False, axis="y")
    return figure


EXPERIMENT = Experiment(
    name="hotspots",
    what="hotspots, and a model of what bounds them",
    turn=40,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Baseline, opt1 with structs and with arrays and opt4, on one scene at height 120.",
    command=command,
    sections=[(230, lambda data: hot(data.path, data.context.cpu.microarchitecture))],
)
