"""The scene as a Taichi kernel, compiled by its LLVM back end for the CPU."""

import warnings
from types import SimpleNamespace

import formulas
import taichi as ti

UNTIMED = 1
vec3 = ti.math.vec3


@ti.func
def norm2(x, y):
    return ti.sqrt(x * x + y * y)


@ti.func
def rcp(x):
    return 1 / x


M = SimpleNamespace(
    **{name: getattr(ti, name) for name in ("select", "sqrt", "log", "exp", "func", "static")},
    **{"norm": ti.math.length, "dot": ti.math.dot, "normalize": ti.math.normalize, "clip": ti.math.clamp},
    **{"minimum": ti.min, "maximum": ti.max, "norm2": norm2, "rcp": rcp, "vec3": vec3},
)
power = formulas.eighth(M)


@ti.func
def mandelbulb(p, iterations, bailout):
    w, m, dz = p, p.dot(p), 1.5
    for _ in range(iterations):
        dz = 8 * m * m * m * ti.sqrt(m) * dz + 1
        w = p + power(w)
        m = w.dot(w)
        if m > bailout:
            break
    return ti.select(m > 0, 0.25 * ti.log(m) * ti.sqrt(m) / dz, 0)


def renderer(task):
    warnings.simplefilter("ignore")  # that a shape's expression is no function of Taichi's
    ti.init(arch=ti.cpu, cpu_max_num_threads=task.threads, offline_cache=False, log_level=ti.ERROR)
    width, height, march = task.width, task.height, task.scene.march
    steps, near, bounds = march.max_steps, march.hit_distance, march.bounds_radius**2
    to_scene, shaded = formulas.shading(M, task, mandelbulb)
    ahead, right, up = (vec3(one) for one in (task.ahead, task.right, task.up))
    background = vec3(task.scene.background)
    picture = ti.Vector.field(3, float, (height, width))

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
            made = shaded(p, direction)
        return made

    @ti.kernel
    def draw(origin: vec3):
        for row, column in picture:
            x, y = 2 * (column + 0.5) / width - 1, 1 - 2 * (row + 0.5) / height
            picture[row, column] = seen(origin, (ahead + x * right + y * up).normalized())

    def render(origin):
        draw(vec3(origin))
        ti.sync()

    return render, picture.to_numpy, ".".join(map(str, ti.__version__))
