"""What a scene's file says (common/scenes/README.md), as far as scripts ask for it. The driver checks it."""

from typing import Any

import msgspec

Vector = tuple[float, float, float]
KEYS = ("camera", "light", "background", "fog", "march", "materials", "shapes")  # all are required
ZERO: Vector = (0.0, 0.0, 0.0)


class Motion(msgspec.Struct):
    type: str
    period: float
    to: Vector = ZERO
    axis: Vector = ZERO
    centre: Vector = ZERO


class Camera(msgspec.Struct):
    position: Vector
    look_at: Vector
    up: Vector
    vertical_fov_degrees: float = 0
    path: Motion | None = None


class Light(msgspec.Struct):
    position: Vector = ZERO
    emission: Vector = ZERO
    shadows: str = "soft"


class March(msgspec.Struct):
    max_steps: int = 0
    hit_distance: float = 0
    bounds_radius: float = 0
    normal_step: float = 0
    surface_offset: float = 0
    max_bounces: int = 0


class Material(msgspec.Struct):
    color: Vector
    shininess: float
    reflectivity: float = 0.0


class Shape(msgspec.Struct):
    """Sizes that its type does not have are zero."""

    type: str
    material: str = ""
    position: Vector = ZERO
    rotation_degrees: Vector = ZERO
    repeat: Vector = ZERO
    radius: float = 0.0
    half_size: Vector = ZERO
    rounding: float = 0.0
    major_radius: float = 0.0
    minor_radius: float = 0.0
    bottom_radius: float = 0.0
    top_radius: float = 0.0
    half_height: float = 0.0
    normal: Vector = ZERO
    offset: float = 0.0
    iterations: int = 0
    bailout: float = 0.0


class Content(msgspec.Struct):
    """What stands in a scene's file (common/scenes/README.md), as far as scripts ask for it."""

    camera: Camera
    light: Light = msgspec.field(default_factory=Light)
    background: Vector = ZERO
    fog: float = 0
    march: March = msgspec.field(default_factory=March)
    materials: dict[str, Material] = {}
    shapes: list[Shape] = []

    @property
    def of_shapes(self) -> list[Material]:
        """The material of each shape."""
        return [self.materials[shape.material] for shape in self.shapes]


def read(data: dict[str, Any]) -> Content:
    return msgspec.convert(data, Content)
