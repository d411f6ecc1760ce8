"""Where the cycles of a phase's pixels go: what a patch with `counts` in its head (core.patches) has counted.

`stepwise ablations --ideas` runs each such patch and writes the rows into ideas.json. The lesson of the phase
has them as a table, below a marker.
"""

import random
import re
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from study.core import patches, registry, run, show
from study.core.registry import Scene
from study.experiments.ablations.schema import IDEAS_FILE, Counted, Ideas
from study.numbers import stats
from study.numbers.schema import Interval

HEIGHT, FRAMES = 720, 20
BEGIN = "<!-- counts: stepwise lessons -->"  # stands in a lesson after the ideas, before its table
REST = "the rest"  # what the patch does not see


def launch(name: str, scene: Scene, cpu: int, padding: int) -> list[tuple[str, float, float]]:
    """Each line of the patched program's counts, and the rest: name, share of the pixels, and core
    cycles over all pixels of the picture. Nothing without counts. Raises DriverError."""
    width, height = scene.size(HEIGHT)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "counts"
        how = {"cpu": cpu, "env_bytes": padding, "reps": FRAMES, "warmup": 2}
        made = run.render(name, scene.path, height, width, told={"STEPWISE_COUNTS": str(path)}, **how)
        if not path.is_file():  # no kernel, or none of x86-64
            return []
        lines = [line.split(" ", 2) for line in path.read_text(encoding="utf-8").splitlines()]
    frames = [frame for frame in made["frames"] if not frame["warmup"]]
    core, ticks = (np.array([frame[of] for frame in frames]) for of in ("core_cycles", "tsc_cycles"))
    pixels = sum(int(line[0]) for line in lines)
    per_tick = float(core.sum() / ticks.sum()) / pixels
    found = [(title, int(count) / pixels, int(spent) * per_tick) for count, spent, title in lines]
    whole = float(np.median(core)) / (width * height)
    return [*found, (REST, 0.0, whole - sum(cycles for _, _, cycles in found))]


def measure(names: Iterable[str], launches: int, seed: int, cpu: int) -> list[Counted]:
    """The rows of the ablations that count, each on the first scene of its head. Raises DriverError."""
    rows, dice = [], random.Random(seed)
    for name in names:
        head = patches.chain(name)[-1].head
        scene = registry.find_scene(head["scenes"].split()[0])
        with run.off(cpu):
            found = [launch(name, scene, cpu, dice.randint(0, 4096)) for _ in range(launches)]
        for same in zip(*found, strict=True):
            cycles = Interval.of(stats.median_interval([one[2] for one in same]))
            title, share, _ = same[0]
            about = {"ablation": name, "scene": scene.name, "height": HEIGHT, "counts": head["counts"]}
            rows.append(Counted(**about, name=title, share=share, cycles=cycles))
    return rows


def of(phase: str) -> list[str]:
    """The phase's patches that count, by title."""
    folder = patches.folder(phase) / "ablations"
    found = [patches.read(folder / f"{title}.patch") for title in patches.titles(phase)]
    return [patch.name for patch in found if "counts" in patch.head]


def table(rows: Sequence[Counted]) -> list[str]:
    """The lines of a lesson's table: share of the pixels, cycles of one, and cycles over all pixels."""
    about = f"{rows[0].counts} on {rows[0].scene}, height {rows[0].height}"
    whole = sum(row.cycles.value or 0.0 for row in rows)
    lines = [[about, "share of pixels", "core cycles a pixel", f"of {whole:.1f} [95 %]"], ["---"] * 4]
    for row in rows:
        value = row.cycles.value or 0.0
        own = [f"{100 * row.share:.1f} %", f"{value / row.share:.3g}"] if row.share else ["–", "–"]
        lines.append([row.name, *own, show.spread(row.cycles, 2).replace("\u00a0", " ")])
    return [f"| {' | '.join(line)} |" for line in lines]


def lesson(phase: str, text: str, published: Path | None) -> str:
    """The text with the table of the phase's counts made anew, if the published run has it."""
    before, begin, rest = text.partition(f"{BEGIN}\n")
    if not published or not begin:
        return text
    result = Ideas.load(published / IDEAS_FILE)
    rows = [row for row in result.counted if row.ablation in of(phase)]
    if not rows:
        return text
    rest = re.sub(r"\A(\|.*\n)+", "", rest)
    return f"{before}{begin}{chr(10).join(table(rows))}\n{rest}"
