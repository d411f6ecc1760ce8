"""Embree: the program of stepwise packets asks it for the hits of the camera's rays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from study.core.cli import StudyError
from study.core.registry import Scene, find_scene
from study.experiments.peers import shader
from study.experiments.peers.peer import Drawn, Job, Peer
from study.measuring.rays import Rays, camera, hits, normals, places


def shaded(scene: Scene, rays: Rays, found: np.ndarray) -> np.ndarray:
    """Linear colours of camera rays by what they hit, (t, shape) each."""
    t, shape = found.T.astype(float)
    met, d = shape >= 0, rays[:, 3:6].astype(float)
    which = shape[met].astype(int)
    p = rays[met, :3] + t[met, None] * d[met]
    return shader.colours(scene.content, d, met, p, normals(scene.content.shapes, p, which), which)


@dataclass(frozen=True)
class Embree(Peer):
    def lacking(self) -> str | None:
        """It is asked for the hits of one ray."""
        lacking = "needs Debian's package libembree-dev when build/packets/hits is built"
        try:
            record, _ = hits(find_scene("spheres40").path, np.ones((1, 7), "<f4"), "primary", beside=True)
        except StudyError as error:
            return f"{lacking}: {error}"
        return None if record.embree16_ns else lacking  # packets of 16: its fastest for camera rays

    def draw(self, job: Job) -> Drawn:
        rays = camera(job.scene.data, *job.size)
        where: dict[str, Any] = {"cpu": min(job.cpus), "env_bytes": job.padding}
        record, found = hits(job.scene.path, rays, "primary", reps=job.frames, beside=True, **where)
        if not record.embree16_ns:
            raise StudyError(f"Embree: {record.embree}")
        rgb = None
        if job.picture:
            width, height = job.size
            rgb = np.empty((height, width, 3), np.float32)
            rgb[places(width, height)] = shaded(job.scene, rays, found[1])
        return Drawn(record.embree16_ns, record.embree.removeprefix("Embree "), rgb)


PEER = Embree(
    name="embree",
    title="Embree",
    timed="hits of the camera's rays alone: no rays are made, nothing is shaded",
    differs="closed form in float; shaded from its hits by NumPy",
    least_db={"spheres40_plain": 100},
    cores=False,
)
