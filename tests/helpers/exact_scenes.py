"""Scenes of the exact oracle, for its tests."""

import enclosures

from study.truth import exact


def one(kind: str, **more):
    """A scene of one shape of the given sizes."""
    data = enclosures.scene("sphere")
    data["shapes"] = [{"type": kind, **more}]
    return exact.Scene.of(data)


def several(*shapes):
    data = enclosures.scene("sphere")
    data["shapes"] = list(shapes)
    return exact.Scene.of(data)


BALL = {"type": "sphere", "radius": 1}
TORUS = {"kind": "torus", "major_radius": 1, "minor_radius": 0.25}
CONE = {"kind": "cone", "bottom_radius": 1, "top_radius": 2, "half_height": 2}
CUBE = {"kind": "box", "half_size": [1, 1, 1]}
STAR = {"kind": "octahedron", "radius": 1}
