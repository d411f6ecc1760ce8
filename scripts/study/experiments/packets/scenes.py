"""Scenes of rays and pictures. They are not in common/scenes: what is there goes through every suite."""

from pathlib import Path
from typing import Any

from study.core import generated_scenes, store
from study.core.registry import Scene, find_scene

MANY = 4096


def only(name: str, types: tuple[str, ...]) -> dict[str, Any]:
    data = find_scene(name).data
    return data | {"shapes": [shape for shape in data["shapes"] if shape["type"] in types]}


def balls() -> dict[str, Any]:
    """trio's spheres and planes, unturned, under hard shadows."""
    data = only("trio", ("sphere", "plane"))
    return data | {"light": data["light"] | {"shadows": "hard"}}


def many(count: int = MANY, seed: int = 1) -> dict[str, Any]:
    """`count` equal spheres, even over the picture and in depth, which cover generated.COVERAGE of it."""
    places = [(*place[:3], 1.0, "sphere") for place in generated_scenes.placed("scattered", count, seed)]
    rays = generated_scenes.rays(*generated_scenes.RAYS)
    radius = generated_scenes.quantile(generated_scenes.least_gauge(places, rays), generated_scenes.COVERAGE)
    data = generated_scenes.data("scattered", 1, seed)
    names = list(data["materials"])
    data["materials"][names[0]]["reflectivity"] = 0.5
    data["light"]["shadows"] = "hard"
    data["shapes"] = [
        {"type": "sphere", "radius": radius, "position": list(p[:3]), "material": names[i % len(names)]}
        for i, p in enumerate(places)
    ]
    return data


def kept(folder: Path, name: str, data: dict[str, Any]) -> Scene:
    path = folder / f"{name}.json"
    store.write_json(path, data)
    return Scene(name, path, data, False)


def traced(folder: Path) -> list[Scene]:
    """Those whose rays are timed; `folder` is for what is made here."""
    made = {"trio_balls": balls(), f"spheres{MANY}": many()}
    return [find_scene("spheres40"), *(kept(folder, name, data) for name, data in made.items())]


def drawn(folder: Path) -> list[Scene]:
    """Those that both ray tracing and sphere tracing render, shadows hard or none."""
    solids = only("scene0_plain", ("box", "sphere", "cone", "plane"))
    made = {"trio_balls": balls(), "scene0_solids": solids}
    shipped = [find_scene("spheres40"), find_scene("two_spheres")]
    return [*shipped, *(kept(folder, name, data) for name, data in made.items())]
