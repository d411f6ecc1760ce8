"""Peak memory above the frame at 3840×2160: of scene0, the Mandelbulb and 4,096 scattered shapes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from study.core import generated_scenes, registry, run
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments.scaling.laws import CROWD, MANY, SCATTERED
from study.experiments.scaling.measure import above_frame, why
from study.experiments.scaling.schema import LeftOut, Memory, Row
from study.experiments.scaling.series import Picture

SIZE = 3840, 2160
SCENES = ("scene0", "mandelbulb", "scattered")


def pace(rows: Sequence[Row], phase: str, scene: str) -> float | None:
    """ns per pixel on one thread, of the largest picture; None where not measured."""
    some = [row for row in rows if (row.phase, row.threads, row.max_steps) == (phase, 1, None)]
    if scene == "scattered":
        some = [row for row in some if row.series in (CROWD, SCATTERED) and row.x == MANY]
    else:
        some = [row for row in some if row.scene == scene]
    best = max(some, key=lambda row: row.n, default=None)
    return best.ns_per_pixel.value if best and best.ns_per_pixel else None


def measure(
    specs: Sequence[Spec], rows: Sequence[Row], seconds: float, seed: int, folder: Path
) -> tuple[list[Memory], list[LeftOut]]:
    """One thread and all, cheapest first, and what was left out; the seconds are foreseen from `rows`."""
    wanted, made, left_out = [], [], []
    for spec in specs:
        counts = {1, len(run.USABLE)} if registry.find_phase(spec.phase).threads else {1}
        for scene in SCENES:
            known = pace(rows, str(spec), scene)
            for threads in sorted(counts):
                about = LeftOut(series="memory", x=threads, phase=str(spec), scene=scene, reason="")
                if known is None:
                    about.reason = f"{scene} was not timed, so what 4K would take is not known"
                    left_out.append(about)
                else:
                    about.foreseen_s = known * SIZE[0] * SIZE[1] * 1e-9 / threads
                    wanted.append((about.foreseen_s, spec, about))
    for foreseen, spec, about in sorted(wanted, key=lambda one: one[0]):
        if foreseen > seconds:
            about.reason = f"a frame would take about {foreseen:.3g} s, {max(seconds, 0):.3g} s are left"
            left_out.append(about)
            continue
        seconds -= foreseen
        try:
            made.append(at_4k(spec, about, scene_of(about.scene or "", seed, folder)))
        except DriverError as error:
            about.reason = why(error)
            left_out.append(about)
    return made, left_out


def scene_of(name: str, seed: int, folder: Path) -> Scene:
    if name == "scattered":
        return generated_scenes.of_shapes(name, MANY, seed, folder)
    return registry.find_scene(name)


def at_4k(spec: Spec, about: LeftOut, scene: Scene) -> Memory:
    """One frame: peak resident memory right after it, and what of it is above the 12 bytes a pixel."""
    width, height = SIZE
    threads = int(about.x)
    made = run.render(spec, scene.path, height, width, cpu=run.FASTEST, threads=threads)
    frame = made["frames"][0]
    return Memory(
        phase=about.phase,
        scene=about.scene or scene.name,
        shapes=len(scene.data["shapes"]),
        threads=threads,
        seconds=frame["ns"] * 1e-9,
        peak_rss_mib=frame["max_rss_kib"] / 1024,
        above_frame_mib=above_frame(frame["max_rss_kib"], Picture(scene, height, width)),
    )
