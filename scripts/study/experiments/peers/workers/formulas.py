"""The formulas of march.h for libraries that compile Python: `m` has a library's functions by Dr.Jit's names,
`func` and `static` (of Taichi; of Dr.Jit they do nothing). A scene's shapes come as march.h's expressions."""


def shapes(m):
    """The distances but the Mandelbulb's, whose loop is the library's, by name."""
    vec3 = m.vec3

    @m.func
    def sphere(p, radius):
        return m.norm(p) - radius

    @m.func
    def plane(p, normal, offset):
        return m.dot(p, normal) - offset

    @m.func
    def box(p, half, rounding):
        q = abs(p) - half
        return m.norm(m.maximum(q, 0)) + m.minimum(m.maximum(q.x, m.maximum(q.y, q.z)), 0) - rounding

    @m.func
    def torus(p, major, minor):
        return m.norm2(m.norm2(p.x, p.z) - major, p.y) - minor

    @m.func
    def cone(p, r1, r2, h):
        q, kx, ky = m.norm2(p.x, p.z), r2 - r1, 2 * h
        ax, ay = q - m.select(p.y < 0, m.minimum(q, r1), m.minimum(q, r2)), abs(p.y) - h
        along = m.clip(((r2 - q) * kx + (h - p.y) * ky) / (kx * kx + ky * ky), 0, 1)
        bx, by = q - r2 + kx * along, p.y - h + ky * along
        d = m.sqrt(m.minimum(ax * ax + ay * ay, bx * bx + by * by))
        return m.select((bx < 0) & (ay < 0), -d, d)

    @m.func
    def octahedron(p, r):
        a = abs(p)
        s = a.x + a.y + a.z - r
        first, second, third = 3 * a.x < s, 3 * a.y < s, 3 * a.z < s
        x = m.select(first, a.x, m.select(second, a.y, a.z))
        y = m.select(first, a.y, m.select(second, a.z, a.x))
        z = m.select(first, a.z, m.select(second, a.x, a.y))
        k = m.clip(0.5 * (z - y + r), 0, r)
        return m.select(first | second | third, m.norm(vec3(x, y - r + k, z - k)), s * 0.57735027)

    return {f.__name__: f for f in (sphere, plane, box, torus, cone, octahedron)}


def eighth(m):
    """The Mandelbulb's power. Without trigonometry: the azimuth's phasor is doubled by
    (c, s) -> (1 - 2 s s, 2 s c)."""
    vec3 = m.vec3

    @m.func
    def power(w):
        x2, y2, z2 = w.x * w.x, w.y * w.y, w.z * w.z
        k3 = x2 + z2
        k4, k1 = k3 - y2, k3 * k3 + y2 * (y2 - 6 * k3)
        per_k3 = m.select(k3 > 1e-30, m.rcp(k3), 0)
        cos2, sin2 = (x2 - z2) * per_k3, 2 * w.x * w.z * per_k3
        cos4, sin4 = 1 - 2 * sin2 * sin2, 2 * sin2 * cos2
        k2 = 8 * w.y * k4 * k1 * m.sqrt(k3)
        y = k1 * k1 - 16 * y2 * k3 * k4 * k4
        return vec3(k2 * 2 * sin4 * cos4, y, k2 * 2 * sin4 * sin4 - k2)

    return power


def shading(m, task, mandelbulb):
    """(distance to the scene, colour of what a ray hits at p)."""
    scene, vec3 = task.scene, m.vec3
    names = {**shapes(m), "mandelbulb": mandelbulb, "vec3": vec3, "dot": m.dot}
    codes = [compile(text, "shape", "eval") for text in task.distances]
    count, step, fog = len(codes), scene.march.normal_step, scene.fog
    colours = [vec3(*one.color) for one in task.materials]
    shine_of = [one.shininess for one in task.materials]
    light, emission = vec3(*scene.light.position), vec3(*scene.light.emission)

    def shape(i, p):
        return eval(codes[i], names, {"p": p})

    @m.func
    def to_scene(p):
        least = shape(0, p)
        for i in m.static(range(1, count)):
            least = m.minimum(least, shape(i, p))
        return least

    @m.func
    def shaded(p, direction):
        least = shape(0, p)
        colour, shininess = colours[0] + 0 * p, shine_of[0] + 0 * least
        for i in m.static(range(1, count)):
            d = shape(i, p)
            colour = m.select(d < least, colours[i], colour)
            shininess = m.select(d < least, shine_of[i], shininess)
            least = m.minimum(least, d)
        x, y, z = vec3(step, 0, 0), vec3(0, step, 0), vec3(0, 0, step)
        nx, ny = to_scene(p + x) - to_scene(p - x), to_scene(p + y) - to_scene(p - y)
        n = m.normalize(vec3(nx, ny, to_scene(p + z) - to_scene(p - z)))
        n = m.select(m.dot(direction, n) > 0, -n, n)
        to_light = light - p
        away = m.norm(to_light)
        to_light = to_light / away
        facing = m.dot(n, to_light)
        shine = m.maximum(-m.dot(2 * facing * n - to_light, direction), 0)
        specular = m.select(facing > 0, 0.2 * shine**shininess, 0)
        lit = 0.01 * colour + emission / away * (colour * m.maximum(facing, 0) + specular)
        far = m.norm(p)
        return lit * m.exp(-fog * far * far * far)

    return to_scene, shaded
