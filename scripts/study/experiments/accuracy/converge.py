"""The Mandelbulb has no proof: how float, double and double-double agree on it, for each hit distance.

All three march to the same hit distance, so what they differ in is arithmetic alone; beside it, how far each
is from the finest march there is (double-double at the least hit distance): what the hit distance costs.
"quad" in the JSON is truth's double-double, 104 bits or about 31 digits (truth/number/dd.h).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from study.core import cli, registry, run
from study.core.registry import Spec
from study.core.run import DriverError
from study.numbers.accuracy import Agreement, Convergence, Precision
from study.numbers.schema import Skipped
from study.pictures import images
from study.pictures.images import Picture
from study.truth.judging import FACTOR

SCENE = "mandelbulb"
HIT_DISTANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
PHASES = {"float": "opt4", "double": "baseline", "quad": "truth"}  # who marches in which arithmetic
FINEST = "quad"
WORDS = {"quad": "double-double"}  # for people: the key is older than its arithmetic's right name


def agreement(reference: Picture, image: Picture) -> Agreement:
    """Depth, and colours of the averaged pictures: what compares where single samples are chaotic."""
    parts = [{name: picture[name] for name in images.AOVS} for picture in (reference, image)]
    mean, depth = images.antialiased(*parts, FACTOR), images.geometry(*parts)
    return Agreement(
        depth_agree_fraction=depth["depth_agree_fraction"],
        mask_mismatch_ppm=depth["mask_mismatch_ppm"],
        dt_p99=depth["dt_p99"],
        psnr_db=mean["psnr_db"],
        rmse=mean["rmse"],
    )


def table(pictures: dict[tuple[str, float], Picture]) -> list[Precision]:
    """One row per precision and hit distance; a comparison with what is not there is left out."""
    if not pictures:
        return []
    least = min(distance for _, distance in pictures)
    rows = []
    for (precision, distance), made in sorted(pictures.items(), key=lambda item: (-item[0][1], item[0][0])):
        against = {"quad": ("quad", distance), "double": ("double", distance), "finest": (FINEST, least)}
        found = {
            name: agreement(pictures[other], made)
            for name, other in against.items()
            if other in pictures and other != (precision, distance)
        }
        evaluations = float(np.mean(made["evals"], dtype=np.float64))
        bad = images.non_finite({name: made[name] for name in images.AOVS})
        row = Precision(precision=precision, phase=PHASES[precision], hit_distance=distance, **found)
        row.evals_per_ray, row.non_finite = evaluations, bad
        rows.append(row)
    return rows


def study(height: int, folder: Path, distances: Sequence[float] = HIT_DISTANCES) -> Convergence:
    """The table, its pictures rendered anew into `folder`; who could not render it, under `skipped`."""
    scene = registry.find_scene(SCENE)
    width, height = scene.size(height)
    pictures, skipped = {}, []
    folder.mkdir(parents=True, exist_ok=True)
    for precision, name in PHASES.items():
        spec = Spec.parse(name)
        if lacking := registry.missing_isa(spec):
            skipped.append(Skipped(phase=name, reason=f"this CPU lacks {' '.join(lacking)}"))
            continue
        threads = len(run.USABLE) if registry.find_phase(name).threads else 1
        for distance in distances:
            out = folder / f"{SCENE}-{name}-{distance:g}-{width}x{height}.exr"
            options = {"aov": True, "out": out, "hit_distance": distance, "threads": threads}
            try:
                run.render(spec, scene.path, height, width, timed=False, **options)
            except DriverError as error:
                skipped.append(Skipped(phase=name, reason=f"hit distance {distance:g}: {error.message}"))
                continue
            pictures[precision, distance] = images.read(out)
    for item in skipped:
        cli.say(f"convergence: skipped {item.phase}: {item.reason}")
    means = [size // FACTOR for size in (width, height)]
    rows = table(pictures)
    return Convergence(scene=SCENE, width=width, height=height, averaged=means, rows=rows, skipped=skipped)
