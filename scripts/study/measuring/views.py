"""Further views of a scene: the same shapes and light, seen from three other places by one rule for all.

The camera goes round a pivot by 40° to either side, about its own up, and to 0.6 of its distance from it. The
pivot lies ahead, as far away as the shapes are in the mean: in most scenes look_at is a direction and no
more. A camera that would be in a shape, or within a fiftieth of the way of one, takes the next lesser change.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from study.core import scene_json, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.host import child
from study.core.registry import Scene

OWN = "own"  # the view that the scene comes with
TUNED = frozenset({"scene0", "mandelbulb"})  # scenes whose own view constants may be tuned on
TURNS, NEARER = (40.0, 30.0, 20.0, 10.0), (0.6, 0.7, 0.8, 0.9)
CLEAR = 0.02  # of the way to the pivot
DIGITS = 9  # of a camera's numbers: libraries differ in a sine's last digit, and the file should not
JUDGE = "baseline"  # whose distances say where shapes are
Distance = Callable[[Path, np.ndarray], float]


@dataclass(frozen=True)
class View:
    """A scene from one place. `change`: what was done to its own camera, in words."""

    base: str
    name: str
    change: str
    scene: Scene = field(compare=False)

    @property
    def tuned(self) -> bool:
        return self.base in TUNED and self.name == OWN

    def size(self, height: int) -> tuple[int, int]:
        """(width, height) in pixels, in the shape of the scene's own picture."""
        return dataclasses.replace(self.scene, name=self.base).size(height)

    def __str__(self) -> str:
        return f"{self.base} {self.name}"


def pivot(data: dict[str, Any]) -> np.ndarray:
    """A point on the view axis: at the mean distance of the shapes that have a place and lie ahead, or
    look_at without any. Scene units, shape (3,)."""
    scene = scene_json.read(data)
    at, look_at = np.array(scene.camera.position), np.array(scene.camera.look_at)
    forward = (look_at - at) / np.linalg.norm(look_at - at)
    placed = [np.array(s.position) for s in scene.shapes if s.type != "plane"]
    ahead = [away for place in placed if (away := (place - at) @ forward) > 0]
    return at + np.mean(ahead) * forward if ahead else look_at


def turned(data: dict[str, Any], degrees: float, nearer: float = 1.0) -> dict[str, Any]:
    """The scene with its camera moved round the pivot, at which it looks then, about camera.up (Rodrigues's
    rotation), and to `nearer` of its distance."""
    camera, centre = scene_json.read(data).camera, pivot(data)
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(camera.up) / np.linalg.norm(camera.up))
    arm = turn.apply((camera.position - centre) * nearer)
    places = (np.round(place, DIGITS) + 0.0 for place in (centre + arm, centre))
    position, look_at = (place.tolist() for place in places)
    return data | {"camera": data["camera"] | {"position": position, "look_at": look_at}}


def probed(path: Path, point: np.ndarray) -> float:
    """The signed distance from a point to the scene, by the judge. Raises StudyError."""
    done = child.run(
        [build(JUDGE, "probe"), path], input=np.asarray(point, float).tobytes(), capture_output=True
    )
    if done.returncode or len(done.stdout) != 16:
        raise StudyError(f"{path}: no distance at the camera: {done.stderr.decode(errors='replace').strip()}")
    return float(np.frombuffer(done.stdout)[0])


def of(scene: Scene, folder: Path, distance: Distance = probed) -> list[View]:
    """The scene's own view and three further ones, whose files are made in `folder`. Raises StudyError."""
    tries = {
        "left": [(f"{turn:g}° to the left", (turn, 1.0)) for turn in TURNS],
        "right": [(f"{turn:g}° to the right", (-turn, 1.0)) for turn in TURNS],
        "near": [(f"at {share:g} of the distance", (0.0, share)) for share in NEARER],
    }
    views = [View(scene.name, OWN, "as it is", scene)]
    for name, some in tries.items():
        path = folder / f"{scene.name}-{name}.json"
        for change, how in some:
            data = turned(scene.data, *how)
            if not path.exists() or store.read_json(path) != data:
                store.write_json(path, data)
            camera = scene_json.read(data).camera
            at = np.array(camera.position)
            if distance(path, at) >= CLEAR * np.linalg.norm(at - camera.look_at):
                views.append(View(scene.name, name, change, Scene(path.stem, path, data, scene.fractal)))
                break
        else:
            path.unlink(missing_ok=True)
            raise StudyError(f"{scene.name}: every camera to the {name} would be in a shape or close to one")
    return views
