"""The scene's shapes sphere traced in one fused kernel, float, on LLVM. The second call freezes it.

W. Jakob, S. Speierer, N. Roussel, D. Vicini, "Dr.Jit: a just-in-time compiler for differentiable rendering",
ACM Transactions on Graphics 41 (2022); drjit.readthedocs.io.
"""

from types import SimpleNamespace

import drjit as dr
import formulas
import numpy as np
from drjit.llvm import Array3f, Bool, Float, UInt32

UNTIMED = 2
NAMES = "norm dot normalize minimum maximum select clip sqrt rcp log exp"
M = SimpleNamespace(
    **{name: getattr(dr, name) for name in NAMES.split()},
    **{"vec3": Array3f, "norm2": lambda x, y: dr.sqrt(dr.fma(x, x, y * y))},
    **{"func": lambda f: f, "static": lambda x: x},
)
power = formulas.eighth(M)


def mandelbulb(p, iterations, bailout):
    def one(w, m, dz, on, left):
        dz = dr.select(on, 8 * (m * m * m * dr.sqrt(m)) * dz + 1, dz)
        w = p + power(w)
        m = dr.squared_norm(w)
        left -= 1
        on &= (m <= bailout) & (left > 0)
        return w, m, dz, on, left

    start = (Array3f(p), dr.squared_norm(p), Float(1.5), Bool(True), UInt32(iterations))
    _, m, dz, _, _ = dr.while_loop(start, lambda *state: state[3], one)
    return dr.select(m > 0, 0.25 * dr.log(m) * dr.sqrt(m) / dz, 0)


def renderer(task):
    limits, width, height = task.scene.march, task.width, task.height
    to_scene, shaded = formulas.shading(M, task, mandelbulb)
    ahead, right, up = (Array3f(*one) for one in (task.ahead, task.right, task.up))
    background = Array3f(*task.scene.background)
    pixel = dr.arange(UInt32, width * height)
    dr.set_thread_count(task.threads)
    dr.eval(pixel)
    last = None

    @dr.freeze
    def frame(origin, pixel):
        column, row = pixel % width, pixel // width
        x = 2 * (Float(column) + 0.5) / width - 1
        y = 1 - 2 * (Float(row) + 0.5) / height
        direction = dr.normalize(ahead + x * right + y * up)

        def one(t, on, hit, step):
            d = to_scene(dr.fma(direction, t, origin))
            t = t + d
            near = d < limits.hit_distance
            hit |= near
            step += 1
            inside = dr.squared_norm(dr.fma(direction, t, origin)) <= limits.bounds_radius**2
            on &= ~near & inside & (step < limits.max_steps)
            return t, on, hit, step

        size = dr.width(direction)
        start = (dr.zeros(Float, size), dr.full(Bool, True, size), dr.full(Bool, False, size), UInt32(0))
        t, _, hit, _ = dr.while_loop(start, lambda *state: state[1], one)
        return dr.select(hit, shaded(dr.fma(direction, t, origin), direction), background)

    def render(origin):
        nonlocal last
        origin = Array3f(*origin)
        dr.make_opaque(origin)
        last = frame(origin, pixel)
        dr.eval(last)
        dr.sync_thread()

    return render, lambda: np.array(last).T.reshape(height, width, 3), dr.__version__
