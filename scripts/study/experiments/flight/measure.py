"""Frames a second and error along a camera's path: rods, packets, the throttle of both, the ladder.

At each of some times the scene is a still picture from the camera's place. Rod marching, and the throttle
that follows the view: W. Edwards, "Rod Marching" (article, 6 July 2012).
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec.structs import asdict

from study.core import cli, registry, store
from study.core.cli import StudyError
from study.core.registry import Scene
from study.core.scene_json import Motion, Vector
from study.experiments.flight import throttle
from study.experiments.flight.schema import Article, Place, Row, Way
from study.measuring import hits, launches
from study.truth import truth

ARTICLE = Article(frames_a_second=1.2, of="the mandelbox by boxplorer, a laptop's integrated GPU")
FASTEST = "opt10_scene"
# A few settings in every direction: all of the throttle's would take an hour along a path.
SIZES, LEAST, STEPS, FINISH = (16, 32), (2, 4), (8, 0), (16, 64, 0)


@dataclass(frozen=True)
class Settings:
    """`places`: along the path; `psnr_db`, `wrong_ppm`: the error that the throttle may make."""

    n: int
    places: int
    launches: int
    seed: int
    psnr_db: float
    wrong_ppm: float
    fastest: str = FASTEST


def scenes() -> dict[str, Scene]:
    """The shipped scenes whose camera has a path."""
    return {name: one for name, one in registry.animated().items() if one.content.camera.path}


def find(name: str) -> Scene:
    """One of them, or of a file that was given. Raises StudyError for another."""
    scene = registry.find_animated(name)
    if not scene.content.camera.path:
        raise StudyError(f"{name}: is no scene whose camera has a path; there are {', '.join(scenes())}")
    return scene


def position(begin: Vector, path: Motion, seconds: float) -> np.ndarray:
    """Where the camera is, in scene units, shape (3,): common/scenes/README.md, Motion. A circle is turned by
    Rodrigues' formula."""
    start, angle = np.array(begin, float), 2 * math.pi * seconds / path.period
    if path.type == "line":
        return start + (path.to - start) * (1 - math.cos(angle)) / 2
    axis = np.array(path.axis, float) / np.linalg.norm(path.axis)
    arm = start - path.centre
    turned = arm * math.cos(angle) + np.cross(axis, arm) * math.sin(angle)
    return path.centre + turned + axis * (axis @ arm) * (1 - math.cos(angle))


def times(path: Motion, count: int) -> list[float]:
    """Seconds of `count` places: a line's from one end to the other, a circle's all round."""
    end = path.period / 2 if path.type == "line" else path.period * (count - 1) / count
    return [end * i / max(1, count - 1) for i in range(count)]


def still(scene: Scene, seconds: float, folder: Path) -> Scene:
    """The scene from the camera's place at that time, without its path, as a file in `folder`."""
    camera = scene.content.camera
    place = {"position": (position(camera.position, camera.path, seconds) + 0.0).tolist()}
    kept = {key: value for key, value in scene.data["camera"].items() if key != "path"}
    file = folder / f"{scene.name}-{seconds:g}.json"
    store.write_json(file, scene.data | {"camera": kept | place})
    return registry.scene_at(file)


def look(scene: Scene, settings: Settings) -> tuple[int, list[Way]]:
    """How many of the throttle's settings are within the error, and a way's errors and times each."""
    how = (settings.psnr_db, settings.wrong_ppm, settings.launches, settings.seed)
    found = throttle.choose(scene, settings.n, *how, throttle.settings(SIZES, LEAST, STEPS, FINISH))
    ways = {"rods": ("rods", "march=rods"), "packets": (throttle.PHASE, throttle.PLAIN)}
    ways |= {"throttle": (throttle.PHASE, found.chosen.settings)} if found.chosen else {}
    ways |= {"fastest": (settings.fastest, "")}
    size = scene.size(settings.n)
    exact = truth.picture(scene, size)
    cases = {name: throttle.timer(phase, words, scene, size, 2) for name, (phase, words) in ways.items()}
    timed = launches.interleaved(cases, settings.launches, settings.seed)
    rows = []
    for name, (phase, words) in ways.items():
        errors = hits.errors(exact, hits.picture(phase, scene, size, {throttle.SETTINGS: words}))
        made = asdict(errors) | asdict(launches.timed(timed[name]))
        rows.append(Way(name=name, phase=phase, settings=words, **made))
    return found.within, rows


def fly(scene: Scene, settings: Settings, folder: Path) -> Row:
    """A scene's row. Its camera has a path; `folder` is for the scenes of the places. Raises StudyError."""
    camera, places = scene.content.camera, []
    for seconds in times(camera.path, settings.places):
        cli.doing(f"{scene.name} at {seconds:.3g} s")
        within, ways = look(still(scene, seconds, folder), settings)
        where = position(camera.position, camera.path, seconds).tolist()
        places.append(Place(seconds=seconds, position=where, within=within, ways=ways))
    width, n = scene.size(settings.n)
    return Row(scene=scene.name, width=width, n=n, period=camera.path.period, places=places)
