"""Taichi's side of stepwise peers: the scene as a Taichi kernel, compiled by its LLVM back end for the CPU.

Runs in the Python that has taichi: TASK.json. One JSON object on standard output: ns of each frame after
the first, which compiles. Formulas as in march.h.
"""

import json
import sys
import time

import numpy as np
import taichi as ti

vec3 = ti.math.vec3


@ti.func
def norm2(x, y):
    return ti.sqrt(x * x + y * y)


def sphere(s):
    radius = s["radius"]

    @ti.func
    def distance(p):
        return p.norm() - radius

    return distance


def plane(s):
    length = float(np.linalg.norm(s["normal"]))
    normal, offset = vec3(np.divide(s["normal"], length)), s["offset"] / length

    @ti.func
    def distance(p):
        return p.dot(normal) - offset

    return distance


def box(s):
    half, rounding = vec3(s["half_size"]), s.get("rounding", 0.0)

    @ti.func
    def distance(p):
        q = abs(p) - half
        return ti.max(q, 0.0).norm() + ti.min(q.max(), 0.0) - rounding

    return distance


def torus(s):
    major, minor = s["major_radius"], s["minor_radius"]

    @ti.func
    def distance(p):
        return norm2(norm2(p.x, p.z) - major, p.y) - minor

    return distance


def cone(s):
    r1, r2, h = s["bottom_radius"], s["top_radius"], s["half_height"]
    kx, ky = r2 - r1, 2.0 * h

    @ti.func
    def distance(p):
        q = norm2(p.x, p.z)
        ax, ay = q - ti.min(q, ti.select(p.y < 0, float(r1), float(r2))), abs(p.y) - h
        along = ti.math.clamp(((r2 - q) * kx + (h - p.y) * ky) / (kx * kx + ky * ky), 0.0, 1.0)
        bx, by = q - r2 + kx * along, p.y - h + ky * along
        sign = ti.select(bx < 0 and ay < 0, -1.0, 1.0)
        return sign * ti.sqrt(ti.min(ax * ax + ay * ay, bx * bx + by * by))

    return distance


def octahedron(s):
    r = s["radius"]

    @ti.func
    def distance(p):
        a = abs(p)
        m, q, flat = a.sum() - r, a, False
        if 3 * a.x >= m:
            if 3 * a.y < m:
                q = a.yzx
            elif 3 * a.z < m:
                q = a.zxy
            else:
                flat = True
        k = ti.math.clamp(0.5 * (q.z - q.y + r), 0.0, float(r))
        return ti.select(flat, m * 0.57735027, vec3(q.x, q.y - r + k, q.z - k).norm())

    return distance


def mandelbulb(s):
    iterations, bailout = s["iterations"], s["bailout"]

    @ti.func
    def distance(p):
        w, m, dz = p, p.dot(p), 1.5
        for _ in range(iterations):
            dz = 8.0 * m * m * m * ti.sqrt(m) * dz + 1.0
            x2, y2, z2 = w.x * w.x, w.y * w.y, w.z * w.z
            k3 = x2 + z2
            k4, k1 = k3 - y2, k3 * k3 + y2 * (y2 - 6.0 * k3)
            per_k3 = ti.select(k3 > 1e-30, 1.0 / k3, 0.0)
            cos2, sin2 = (x2 - z2) * per_k3, 2.0 * w.x * w.z * per_k3
            cos4, sin4 = 1.0 - 2.0 * sin2 * sin2, 2.0 * sin2 * cos2
            k2 = 8.0 * w.y * k4 * k1 * ti.sqrt(k3)
            x, y = k2 * 2.0 * sin4 * cos4, k1 * k1 - 16.0 * y2 * k3 * k4 * k4
            w = p + vec3(x, y, k2 * (2.0 * sin4 * sin4 - 1.0))
            m = w.dot(w)
            if m > bailout:
                break
        return ti.select(m > 0, 0.25 * ti.log(m) * ti.sqrt(m) / dz, 0.0)

    return distance


FORMULAS = {f.__name__: f for f in (sphere, plane, box, torus, cone, octahedron, mandelbulb)}


def placed(shape, turn):
    """The distance of a point of the scene to the shape."""
    own, at, turned = FORMULAS[shape["type"]](shape), vec3(shape.get("position", 0.0)), ti.Matrix(turn)
    turns = any(shape.get("rotation_degrees", ()))

    @ti.func
    def distance(p):
        q = p - at
        if ti.static(turns):
            q = turned @ q
        return own(q)

    return distance


def renderer(task):
    """A kernel that draws a picture for the origin that it is given, into the field."""
    data, size = task["scene"], (task["height"], task["width"])
    shapes, march = data["shapes"], data["march"]
    count, parts = len(shapes), [placed(*pair) for pair in zip(shapes, task["turns"], strict=True)]
    materials = [data["materials"][s["material"]] for s in shapes]
    colours, shine_of = [vec3(m["color"]) for m in materials], [float(m["shininess"]) for m in materials]
    light, emission = vec3(data["light"]["position"]), vec3(data["light"]["emission"])
    ahead, right, up = (vec3(task[name]) for name in ("ahead", "right", "up"))
    step, fog, background = march["normal_step"], data["fog"], vec3(data["background"])
    steps, near, bounds = march["max_steps"], march["hit_distance"], march["bounds_radius"] ** 2
    picture = ti.Vector.field(3, float, size)

    @ti.func
    def to_scene(p):
        least = 1e30
        for i in ti.static(range(count)):
            least = ti.min(least, parts[i](p))
        return least

    @ti.func
    def seen(origin, direction):
        t, hit, p, made = 0.0, False, origin, background
        for _ in range(steps):
            d = to_scene(p)
            t += d
            p = origin + t * direction
            hit = d < near
            if hit or p.dot(p) > bounds:
                break
        if hit:
            least, colour, shininess = 1e30, vec3(0.0), 1.0
            for i in ti.static(range(count)):
                d = parts[i](p)
                if d < least:
                    least, colour, shininess = d, colours[i], shine_of[i]
            n = vec3(0.0)
            for axis in ti.static(range(3)):
                tap = vec3(0.0)
                tap[axis] = step
                n[axis] = to_scene(p + tap) - to_scene(p - tap)
            n = n.normalized()
            if direction.dot(n) > 0:
                n = -n
            to_light = light - p
            away = to_light.norm()
            to_light /= away
            facing = n.dot(to_light)
            made = 0.01 * colour
            if facing > 0:
                shine = ti.max(-(2.0 * facing * n - to_light).dot(direction), 0.0)
                made += emission / away * (colour * facing + 0.2 * shine**shininess)
            far = p.norm()
            made *= ti.exp(-fog * far * far * far)
        return made

    @ti.kernel
    def draw(origin: vec3):
        for row, column in picture:
            x = 2.0 * (column + 0.5) / size[1] - 1.0
            y = 1.0 - 2.0 * (row + 0.5) / size[0]
            picture[row, column] = seen(origin, (ahead + x * right + y * up).normalized())

    return draw, picture


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    ti.init(arch=ti.cpu, cpu_max_num_threads=task["threads"], offline_cache=False, log_level=ti.ERROR)
    draw, picture = renderer(task)
    ns = []
    for number in range(-1, task["frames"]):
        origin = vec3([p + 1e-6 * (number + 1) for p in task["position"]])
        begun = time.perf_counter_ns()
        draw(origin)
        ti.sync()
        ns.append(time.perf_counter_ns() - begun)
        if number < 0 and task["out"]:
            np.save(task["out"], picture.to_numpy())
    version = ".".join(map(str, ti.__version__))
    sys.__stdout__.write(json.dumps({"ns": ns[1:], "version": version}) + "\n")


if __name__ == "__main__":
    main()
