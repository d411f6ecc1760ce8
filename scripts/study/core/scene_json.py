"""What a scene's file says (common/scenes/README.md), as far as scripts ask for it. The driver checks it."""

from typing import Any

import msgspec

Vector = tuple[float, float, float]
KEYS = ("camera", "light", "background", "fog", "march", "materials", "shapes")  # all are required
ZERO: Vector = (0.0, 0.0, 0.0)
GROUP = "group"  # the type of a shape that is a tree of others


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


class Displacement(msgspec.Struct):
    amplitude: float
    frequency: Vector


class Shape(msgspec.Struct):
    """Sizes that its type does not have are zero."""

    type: str
    material: str = ""
    position: Vector = ZERO
    rotation_degrees: Vector = ZERO
    repeat: Vector = ZERO
    radius: Any = 0.0  # of an ellipsoid three numbers
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
    cell: float = 0.0
    thickness: float = 0.0
    operation: str = ""
    blend: float = 0.0
    shapes: list["Shape"] = []
    shell: float = 0.0
    mirror: str = ""
    displace: Displacement | None = None
    twist: float = 0.0

    @property
    def leaves(self) -> list["Shape"]:
        """The solids and planes of a group, in the file's order; itself, if it is none."""
        return [leaf for one in self.shapes for leaf in one.leaves] if self.type == GROUP else [self]

    @property
    def needs_tree(self) -> bool:
        """Whether only a phase that draws groups draws it: a group, a modifier, a shape of groups alone."""
        offset = self.offset if self.type != "plane" else 0
        changed = self.shell or self.mirror or self.displace or self.twist or offset
        return bool(changed) or self.type in (GROUP, "capsule", "ellipsoid", "gyroid")


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
        """The material of each shape; of a group its best mirror's."""
        materials = ([self.materials[leaf.material] for leaf in shape.leaves] for shape in self.shapes)
        return [max(each, key=lambda one: one.reflectivity) for each in materials]

    @property
    def has_groups(self) -> bool:
        return any(shape.needs_tree for shape in self.shapes)


def read(data: dict[str, Any]) -> Content:
    return msgspec.convert(data, Content)
