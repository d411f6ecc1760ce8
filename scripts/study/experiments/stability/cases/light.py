"""Hard cases of light: shadows, mirrors, fog, gloss."""

import functools
import math
from typing import Any

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import (
    AHEAD,
    ball,
    colours,
    depths,
    eye,
    floor,
    found,
    ids,
    rays,
    red,
    scene,
    section,
    shape,
    wall,
    worst,
)

AMBIENT = 0.01 * 0.6  # red of a plain shape in shadow
Size = tuple[int, int]


def material(color: list[float], reflectivity: float = 1, shininess: float = 15) -> dict:
    return {"color": color, "reflectivity": reflectivity, "shininess": shininess}


def lit_plane(whole: dict, size: Size) -> tuple[np.ndarray, np.ndarray]:
    """t of each ray to the scene's first shape, a plane, and that plane's colour there."""
    plane, (origin, directions) = whole["shapes"][0], rays(whole, size)
    n = np.array(plane["normal"])
    t = exact.plane(origin, directions, n, plane["offset"])
    points = origin + t[..., None] * directions
    return t, exact.light(points, n, directions, whole, plane["material"])


# 15: shadow and reflection of a convex shape on itself
GREY = [0.6, 0.5, 0.4]
CONVEX: dict[str, dict[str, Any]] = {
    "sphere": {"radius": 1},
    "box": {"half_size": [0.8, 0.6, 0.7], "rotation_degrees": [20, 30, 10]},
}


def convex(kind: str, offset: float, surface: str, shadows: str) -> dict:
    return scene(
        [shape(kind, **CONVEX[kind] | {"material": surface})],
        materials={"matte": material(GREY, 0), "mirror": material(GREY)},
        march={"surface_offset": offset},
        light={"shadows": shadows},
        camera=eye([0, 0, -5], [0, 0, 0], 26),
    )


def c15_self_shadow(phase: Phase, strength: float) -> Outcome:
    acne, hits, notes = 0, 0, []
    for kind in CONVEX:
        plain = phase.render(convex(kind, strength, "matte", "none"), (32, 32))
        full = phase.render(convex(kind, strength, "mirror", "hard"), (32, 32))
        hit = found(plain)
        off = np.zeros(hit.shape, bool)
        for name in "RGB":
            off |= ~(np.abs(full[name] - plain[name]) <= 1e-3 * np.abs(plain[name]))
        acne, hits = acne + int((off & hit).sum()), hits + int(hit.sum())
        notes.append(f"{kind} {share(off[hit]):.2f} %")
    return Outcome(100 * acne / hits, note=", ".join(notes))


# 16: bands in a soft shadow
ROOM, RADIUS, CENTRE, LIGHT = (64, 36), 0.5, [0.0, 2.0, 0.0], [1.0, 8.0, 0.5]


def room(strength: float, shadows: str) -> dict:
    """A ball over a floor, seen from the side."""
    return scene(
        [floor(), ball(RADIUS, *CENTRE)],
        light={"position": LIGHT, "shadows": shadows, "shadow_strength": strength},
        camera=eye([0, 4, -6], [-0.3, 0, 0], 26),
    )


def ideal(points: np.ndarray, strength: float) -> np.ndarray:
    """Clamp of the least strength·h(t)/t on the way to the light, h the distance to the ball.

    The floor's h/t is the light's height over its distance, which the ball's is below at the light itself.

    In closed form: h/t to the ball is stationary where r·|p + t·l − c| = |p − c|² − b·t, b = l·(c − p):
    squared, a quadratic in t.
    """
    p, c = points.astype(np.longdouble), np.asarray(CENTRE, np.longdouble)
    to_light = np.asarray(LIGHT, np.longdouble) - p
    reach = np.sqrt((to_light**2).sum(-1))
    unit = to_light / reach[..., None]
    b, far = ((c - p) * unit).sum(-1), ((c - p) ** 2).sum(-1)
    r = np.longdouble(RADIUS)
    qa, qb, qc = r * r - b * b, 2 * b * (far - r * r), far * (r * r - far)
    root = np.sqrt(np.maximum(qb * qb - 4 * qa * qc, 0))
    start = np.longdouble(section(room(strength, "soft"), "march").surface_offset)
    least = np.full(b.shape, np.inf, np.longdouble)
    with np.errstate(divide="ignore", invalid="ignore"):
        for t in ((-qb + root) / (2 * qa), (-qb - root) / (2 * qa), np.full(b.shape, start), reach):
            t = np.clip(np.where(np.isfinite(t), t, reach), start, reach)
            h = np.sqrt(np.maximum(t * t - 2 * b * t + far, 0)) - r
            least = np.minimum(least, h / t)
    return np.clip(strength * least, 0, 1).astype(float)


@functools.cache
def shadowed(strength: float) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels see the floor, and its ideal shadow, 1 elsewhere."""
    origin, directions = rays(room(strength, "soft"), ROOM)
    ground = exact.plane(origin, directions, [0, 1, 0], 0)
    seen = np.isfinite(ground) & (ground < exact.sphere(origin, directions, CENTRE, RADIUS))
    points = origin + np.where(seen, ground, 1)[..., None] * directions
    return seen, np.where(seen, ideal(points, strength), 1)


def c16_penumbra(phase: Phase, strength: float) -> Outcome:
    seen, known = shadowed(strength)
    soft, bare = (red(phase.render(room(strength, how), ROOM)) for how in ("soft", "none"))
    got = np.where(seen, (soft - AMBIENT) / (np.where(seen, bare, 1) - AMBIENT), 1)
    pairs = seen[:, 1:] & seen[:, :-1]
    jump = np.abs(np.diff(got - known, axis=1))[pairs]
    return Outcome(worst(jump), note=f"largest error {worst(np.abs(got - known)[seen]):.3f}")


# 18: facing mirrors, a light behind a wall, a camera inside a shape
FACING, HALF = (9, 9), 2.0
HIT = 1e-6  # hit distance of the scenes
SILVER = [0.3, 0.5, 0.7]
MIRROR = {"mirror": material(SILVER)}


def between(bounces: float) -> dict:
    """Two mirrors that face each other, the camera and the light between them."""
    return scene(
        [shape("plane", normal=[0, 0, -z], offset=-HALF, material="mirror") for z in (1, -1)],
        materials=MIRROR,
        march={"max_bounces": int(bounces)},
        light={"position": [0.5, 1, 0]},
        camera=eye([0, 0, 0], [0, 0, 1], 20),
    )


def series(whole: dict) -> np.ndarray:
    """Each bounce adds a tenth of the one before, and starts surface_offset off the mirror."""
    march, (p, d) = section(whole, "march"), rays(whole, FACING)
    p = np.broadcast_to(p, d.shape).astype(np.longdouble)
    total, weight = np.zeros(d.shape, np.longdouble), 1.0
    lost = np.zeros(d.shape[:-1], bool)
    for _ in range(march.max_bounces + 1):
        at = np.sign(d[..., 2:]) * HALF
        p = p + (at - p[..., 2:]) / d[..., 2:] * d
        lost |= (p**2).sum(-1) > march.bounds_radius**2
        n = np.concatenate([np.zeros_like(p[..., :2]), -np.sign(at)], -1)
        total += np.where(lost[..., None], 0, weight * exact.light(p, n, d, whole, "mirror"))
        p, d, weight = p + n * march.surface_offset, d * [1, 1, -1], weight * 0.1
    return total.astype(float)


def enclosed(bounces: float) -> list[tuple[dict, float]]:
    """Camera inside a mirroring box and a ball, and exactly on a mirror, with how deep inside it is.

    From the ball's camera the nearest of its surface is straight behind: the line of view meets it at −depth.
    """
    views: list[tuple[dict, list[float], float]] = [
        (shape("box", half_size=[1, 1, 1], material="mirror"), [0, -0.2, 1], 1.0),
        (ball(1, 0, 0.5, 0, material="mirror"), [0, 1, 0], 0.5),
        (floor(material="mirror"), [0, -0.2, 1], 0.0),
    ]
    march, light = {"max_bounces": int(bounces)}, {"position": [0.5, 0.4, 0.3], "shadows": "soft"}
    common = {"materials": MIRROR, "march": march, "light": light}
    return [
        (scene([one], camera=eye([0, 0, 0], look_at, up=[0, 1, 1]), **common), depth)
        for one, look_at, depth in views
    ]


def inside(phase: Phase, bounces: float) -> tuple[float, float]:
    """Brightest colour and largest |Δt| of the pictures from inside. A miss has Z = ∞, and so Δt."""
    brightest, dt = [], []
    for whole, depth in enclosed(bounces):
        picture = phase.render(whole, FACING)
        brightest.append(worst(colours(picture)))
        dt.append(worst(np.abs(depths(picture) + depth)))
    return worst(brightest), worst(dt)


def c18_mirrors_and_inside(phase: Phase, strength: float) -> Outcome:
    known = series(between(strength))
    got = colours(phase.render(between(strength), FACING))
    error = worst(np.abs(got - known) / known.max())
    # The light is on the far side of a wall: ambient only.
    dark = phase.render(scene([wall(1)], light={"position": [0, 0, 4], "shadows": "hard"}), FACING)
    error = 255 * worst([error, worst(np.abs(red(dark) - 0.006) / 0.006)])  # max() would drop a NaN
    brightest, dt = inside(phase, strength)
    # Diffuse and specular at a light as near as a hit can be, 1e-6 off, and the mirror's 1/0.9.
    bound = 5 * (0.7 + 0.2) / 1e-6 / 0.9
    note = f"inside a shape at most {brightest:.3g}, |Δt| {dt:.1e}"
    return Outcome(worst([error, dt / HIT]) if brightest <= bound else np.inf, note=note)


# 26: a light inside a shape
def lamp(depth: float) -> dict:
    """A ball over a floor, the light inside it, `depth` above its lowest point."""
    return scene(
        [floor(), ball(1, 0, 2, 0)],
        light={"position": [0, 1 + depth, 0], "emission": [5, 5, 5], "shadows": "hard"},
        camera=eye([0, 0.7, -5], [0, 0.2, 0], 40),
    )


def c26_light_inside(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(lamp(strength), (32, 18))
    lit = ~(np.abs(red(picture) / AMBIENT - 1) <= 1e-3)
    return Outcome(share(lit[ids(picture) == 0]))


# 29: a mirror seen at a grazing angle
REACH, SKY = 20.0, [0.5, 0.7, 0.9]


def skimming(degrees: float) -> dict:
    """A mirroring floor that the rays meet 20 units away, at this angle."""
    angle = math.radians(degrees)
    height = REACH * math.sin(angle)
    return scene(
        [floor(material="mirror")],
        camera=eye([0, height, 0], [0, height - math.sin(angle), math.cos(angle)], 1),
        materials={"mirror": material([0.2, 0.2, 0.2])},
        background=SKY,
        light={"position": [3, 40, 10], "emission": [5, 5, 5]},
        march={"max_steps": 1000000},
    )


def c29_grazing_mirror(phase: Phase, strength: float) -> Outcome:
    whole = skimming(strength)
    t, known = lit_plane(whole, (9, 1))
    known = known + 0.1 * np.array(SKY)
    picture = phase.render(whole, (9, 1))
    off = np.abs(colours(picture) / known.astype(float) - 1)
    note = f"{int((~found(picture)).sum())} misses, largest |Δt| {worst(np.abs(depths(picture) - t)):.1e}"
    return Outcome(worst(off), note=note)


# 30: fog over a great distance
def foggy(exponent: float, fog: float) -> dict:
    """A wall 10^exponent away, lit from the camera."""
    far = 10.0**exponent
    light = {"position": [0, 0, 0], "emission": [min(5 * far, 1e9)] * 3}
    return scene([wall(far)], camera=AHEAD, light=light, march={"bounds_radius": 1e9}, fog=fog)


def c30_deep_fog(phase: Phase, strength: float) -> Outcome:
    fog = 0.7 / 10.0 ** (3 * strength)  # fog·|p|³ is 0.7 in the middle
    whole = foggy(strength, fog)
    t, known = lit_plane(whole, (8, 8))
    known = known * np.exp(-np.longdouble(fog) * t**3)[..., None]
    off = np.abs(colours(phase.render(whole, (8, 8))) / known.astype(float) - 1)
    thick = worst(colours(phase.render(foggy(strength, 1e9), (8, 8))))
    return Outcome(max(worst(off), thick), note=f"in the thickest fog {thick:g}" if thick else "")


def in_the_middle(off: np.ndarray) -> float:
    """The largest value of the middle pixel."""
    return off[off.shape[0] // 2, off.shape[1] // 2].max()


# 32: a highlight of enormous shininess
def glossy(shininess: float) -> dict:
    """A tilted wall square to camera and light, which coincide: the highlight is in the middle."""
    return scene(
        [shape("plane", normal=[0.36, 0.48, -0.8], offset=-4, material="gloss")],
        camera=eye([0, 0, 0], [-0.36, -0.48, 0.8], 1),
        light={"position": [0, 0, 0], "emission": [5, 5, 5]},
        materials={"gloss": material([0.1, 0.1, 0.1], 0, shininess)},
    )


def c32_gloss(phase: Phase, strength: float) -> Outcome:
    whole, peak = glossy(strength), 0.2 * 5 / 4
    off = np.abs(colours(phase.render(whole, (17, 17))) - lit_plane(whole, (17, 17))[1].astype(float))
    return Outcome(worst(off) / peak, note=f"in the middle {in_the_middle(off) / peak:.1e}")


# 34: a light that touches a wall
def touching(height: float) -> dict:
    """A wall, and a light this high over the point in the middle of the picture."""
    return scene(
        [wall(1.7)],
        camera=eye([0.3, 0.2, -3], [0.3, 0.2, 0], 1),
        light={"position": [0.3, 0.2, 1.7 - height], "emission": [0.1, 0.1, 0.1], "shadows": "hard"},
    )


def c34_light_touching(phase: Phase, strength: float) -> Outcome:
    whole = touching(strength)
    known = lit_plane(whole, (9, 9))[1].astype(float)
    off = np.abs(colours(phase.render(whole, (9, 9))) / known - 1)
    return Outcome(worst(off), note=f"in the middle {in_the_middle(off):.1e}")
