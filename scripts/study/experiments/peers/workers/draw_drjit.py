"""Dr.Jit's side of stepwise peers: the scene's shapes sphere traced in one fused kernel, float, on LLVM.

Runs in the Python that has drjit: TASK.json. One JSON object on standard output: ns of each frame after the
first two, which compile and freeze. Formulas as in march.h.

W. Jakob, S. Speierer, N. Roussel, D. Vicini, "Dr.Jit: a just-in-time compiler for differentiable rendering",
ACM Transactions on Graphics 41 (2022); drjit.readthedocs.io.
"""

import json
import math
import sys
import time

import drjit as dr
import numpy as np
from drjit.llvm import Array3f, Bool, Float, UInt32


def triple(v):
    return Array3f(*(float(x) for x in v))


def norm2(x, y):
    return dr.sqrt(dr.fma(x, x, y * y))


def sphere(p, s):
    return dr.norm(p) - s["radius"]


def plane(p, s):
    n = np.array(s["normal"]) / np.linalg.norm(s["normal"])
    return dr.dot(p, triple(n)) - s["offset"] / float(np.linalg.norm(s["normal"]))


def box(p, s):
    q = abs(p) - Array3f(*s["half_size"])
    distance = dr.norm(dr.maximum(q, 0)) + dr.minimum(dr.maximum(q.x, dr.maximum(q.y, q.z)), 0)
    return distance - s["rounding"] if s.get("rounding") else distance


def torus(p, s):
    return norm2(norm2(p.x, p.z) - s["major_radius"], p.y) - s["minor_radius"]


def cone(p, s):
    r1, r2, h = s["bottom_radius"], s["top_radius"], s["half_height"]
    q = norm2(p.x, p.z)
    kx, ky = r2 - r1, 2 * h
    ax, ay = q - dr.minimum(q, dr.select(p.y < 0, Float(r1), Float(r2))), abs(p.y) - h
    along = dr.clip(((r2 - q) * kx + (h - p.y) * ky) / (kx * kx + ky * ky), 0, 1)
    bx, by = q - r2 + kx * along, p.y - h + ky * along
    sign = dr.select((bx < 0) & (ay < 0), Float(-1), Float(1))
    return sign * dr.sqrt(dr.minimum(ax * ax + ay * ay, bx * bx + by * by))


def octahedron(p, s):
    r, p = s["radius"], abs(p)
    m = p.x + p.y + p.z - r
    first, second = 3 * p.x < m, 3 * p.y < m
    q = dr.select(first, p, dr.select(second, Array3f(p.y, p.z, p.x), Array3f(p.z, p.x, p.y)))
    k = dr.clip(0.5 * (q.z - q.y + r), 0, r)
    return dr.select(first | second | (3 * p.z < m), dr.norm(Array3f(q.x, q.y - r + k, q.z - k)), m * 3**-0.5)


def mandelbulb(p, s):
    """Without trigonometry: the azimuth's phasor is doubled by (c, s) -> (1 - 2 s s, 2 s c)."""

    def one(x, y, z, m, dz, on, left):
        dz = dr.select(on, 8 * (m * m * m * dr.sqrt(m)) * dz + 1, dz)
        x2, y2, z2 = x * x, y * y, z * z
        k3 = x2 + z2
        k4, k1 = k3 - y2, k3 * k3 + y2 * (y2 - 6 * k3)
        per_k3 = dr.select(k3 > 1e-30, dr.rcp(k3), 0)
        cos2, sin2 = (x2 - z2) * per_k3, 2 * x * z * per_k3
        cos4, sin4 = 1 - 2 * sin2 * sin2, 2 * sin2 * cos2
        k2 = 8 * y * k4 * k1 * dr.sqrt(k3)
        x = p.x + k2 * 2 * sin4 * cos4
        z = p.z - k2 + k2 * 2 * sin4 * sin4
        y = p.y + k1 * k1 - 16 * y2 * k3 * k4 * k4
        m = x * x + y * y + z * z
        left -= 1
        on &= (m <= s["bailout"]) & (left > 0)
        return x, y, z, m, dz, on, left

    start = (p.x, p.y, p.z, dr.dot(p, p), Float(1.5), Bool(True), UInt32(s["iterations"]))
    _, _, _, m, dz, _, _ = dr.while_loop(start, lambda *state: state[5], one)
    return dr.select(m > 0, 0.25 * dr.log(m) * dr.sqrt(m) / dz, 0)


FORMULAS = {f.__name__: f for f in (sphere, plane, box, torus, cone, octahedron, mandelbulb)}


def to_shape(p, s):
    if any(s.get("position", (0, 0, 0))):
        p = p - triple(s["position"])
    if any(s.get("rotation_degrees", (0, 0, 0))):
        p = Array3f(*[dr.dot(p, triple(row)) for row in s["turn"]])
    return FORMULAS[s["type"]](p, s)


def distance(p, shapes):
    least = Float(math.inf)
    for s in shapes:
        least = dr.minimum(least, to_shape(p, s))
    return least


def surface(p, scene):
    """(colour, shininess) of the nearest shape."""
    least, colour, shininess = Float(math.inf), Array3f(0), Float(1)
    for s in scene["shapes"]:
        d, one = to_shape(p, s), scene["materials"][s["material"]]
        colour = dr.select(d < least, triple(one["color"]), colour)
        shininess = dr.select(d < least, Float(one["shininess"]), shininess)
        least = dr.minimum(least, d)
    return colour, shininess


def march(origin, direction, scene):
    """(t, hit) of each ray."""
    limits = scene["march"]

    def one_step(t, on, hit, step):
        d = distance(dr.fma(direction, t, origin), scene["shapes"])
        t = t + d
        near = d < limits["hit_distance"]
        hit |= near
        step += 1
        inside = dr.squared_norm(dr.fma(direction, t, origin)) <= limits["bounds_radius"] ** 2
        on &= ~near & inside & (step < limits["max_steps"])
        return t, on, hit, step

    size = dr.width(direction)
    start = (dr.zeros(Float, size), dr.full(Bool, True, size), dr.full(Bool, False, size), UInt32(0))
    t, _, hit, _ = dr.while_loop(start, lambda *state: state[1], one_step)
    return t, hit


def shaded(origin, direction, scene):
    """The colour of each ray."""
    t, hit = march(origin, direction, scene)
    p = dr.fma(direction, t, origin)
    taps = []
    for axis in range(3):
        step = [scene["march"]["normal_step"] if i == axis else 0 for i in range(3)]
        ahead, behind = (distance(p + sign * Array3f(*step), scene["shapes"]) for sign in (1, -1))
        taps.append(ahead - behind)
    n = dr.normalize(Array3f(*taps))
    n = dr.select(dr.dot(direction, n) > 0, -n, n)
    color, shininess = surface(p, scene)
    to_light = Array3f(*scene["light"]["position"]) - p
    away = dr.norm(to_light)
    to_light /= away
    facing = dr.dot(n, to_light)
    emission = Array3f(*scene["light"]["emission"]) / away
    mirrored = 2 * facing * n - to_light
    shine = dr.maximum(-dr.dot(mirrored, direction), 0)
    specular = dr.select(facing > 0, 0.2 * dr.power(shine, shininess), 0)
    seen = 0.01 * color + emission * color * dr.maximum(facing, 0) + emission * specular
    if scene["fog"]:
        far = dr.norm(p)
        seen *= dr.exp(-scene["fog"] * far * far * far)
    return dr.select(hit, seen, Array3f(*scene["background"]))


def renderer(task):
    """A function of the frame's number that returns its evaluated colours, pixel by pixel."""
    scene, width, height = task["scene"], task["width"], task["height"]
    shapes = [shape | {"turn": turn} for shape, turn in zip(scene["shapes"], task["turns"], strict=True)]
    scene |= {"shapes": shapes}
    ahead, right, up = (triple(task[name]) for name in ("ahead", "right", "up"))

    @dr.freeze
    def frame(origin, pixel):
        column, row = pixel % width, pixel // width
        x = 2 * (Float(column) + 0.5) / width - 1
        y = 1 - 2 * (Float(row) + 0.5) / height
        return shaded(origin, dr.normalize(ahead + x * right + y * up), scene)

    pixel = dr.arange(UInt32, width * height)
    dr.eval(pixel)

    def render(number):
        origin = triple([p + 1e-6 * number for p in task["position"]])
        dr.make_opaque(origin)
        made = frame(origin, pixel)
        dr.eval(made)
        dr.sync_thread()
        return made

    return render


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    dr.set_thread_count(task["threads"])
    render = renderer(task)
    colour = render(0)
    if task["out"]:
        np.save(task["out"], np.array(colour).T.reshape(task["height"], task["width"], 3))
    render(-1)  # frozen at the second call
    ns = []
    for number in range(task["frames"]):
        begun = time.perf_counter_ns()
        render(number + 1)
        ns.append(time.perf_counter_ns() - begun)
    print(json.dumps({"ns": ns, "version": dr.__version__}))


if __name__ == "__main__":
    main()
