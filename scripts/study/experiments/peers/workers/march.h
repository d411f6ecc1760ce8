// Sphere tracing in GLSL: the phases' formulas (phases/baseline), in float, without shadows or mirrors.
// shader.py puts the scene in the place of the line that begins with "@".

float norm2(float x, float y) {
    return sqrt(x * x + y * y);
}

float sphere(vec3 p, float radius) {
    return length(p) - radius;
}

float plane(vec3 p, vec3 normal, float offset) {
    return dot(p, normal) - offset;
}

float box(vec3 p, vec3 half_size, float rounding) {
    vec3 q = abs(p) - half_size;
    return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0) - rounding;
}

float torus(vec3 p, float major_radius, float minor_radius) {
    return norm2(norm2(p.x, p.z) - major_radius, p.y) - minor_radius;
}

float cone(vec3 p, float r1, float r2, float h) {
    float q = norm2(p.x, p.z), kx = r2 - r1, ky = 2.0 * h;
    float ax = q - min(q, p.y < 0.0 ? r1 : r2), ay = sqrt(p.y * p.y) - h;
    float along = clamp(((r2 - q) * kx + (h - p.y) * ky) / (kx * kx + ky * ky), 0.0, 1.0);
    float bx = q - r2 + kx * along, by = p.y - h + ky * along;
    float d = sqrt(min(ax * ax + ay * ay, bx * bx + by * by));
    return bx < 0.0 && ay < 0.0 ? -d : d;
}

float octahedron(vec3 p, float radius) {
    vec3 a = abs(p), q = a;
    float m = a.x + a.y + a.z - radius;
    if (3.0 * a.x < m)
        q = a;
    else if (3.0 * a.y < m)
        q = a.yzx;
    else if (3.0 * a.z < m)
        q = a.zxy;
    else
        return m * 0.57735027;
    float k = clamp(0.5 * (q.z - q.y + radius), 0.0, radius);
    return length(vec3(q.x, q.y - radius + k, q.z - k));
}

// Power 8, without trigonometry.
float mandelbulb(vec3 p, int iterations, float bailout) {
    vec3 w = p;
    float m = dot(p, p), dz = 1.5;
    for (int i = 0; i < iterations; i++) {
        dz = 8.0 * m * m * m * sqrt(m) * dz + 1.0;
        float x2 = w.x * w.x, y2 = w.y * w.y, z2 = w.z * w.z;
        float k3 = x2 + z2, k4 = k3 - y2, k1 = k3 * k3 + y2 * (y2 - 6.0 * k3);
        float per_k3 = k3 > 1e-30 ? 1.0 / k3 : 0.0;
        float cos2 = (x2 - z2) * per_k3, sin2 = 2.0 * w.x * w.z * per_k3;
        float cos4 = 1.0 - 2.0 * sin2 * sin2, sin4 = 2.0 * sin2 * cos2;
        float k2 = 8.0 * w.y * k4 * k1 * sqrt(k3);
        w = p + vec3(k2 * 2.0 * sin4 * cos4, k1 * k1 - 16.0 * y2 * k3 * k4 * k4,
                     k2 * (2.0 * sin4 * sin4 - 1.0));
        m = dot(w, w);
        if (m > bailout)
            break;
    }
    return m > 0.0 ? 0.25 * log(m) * sqrt(m) / dz : 0.0;
}

@SCENE

vec3 normal_at(vec3 p) {
    vec3 x = vec3(NORMAL_STEP, 0.0, 0.0), y = vec3(0.0, NORMAL_STEP, 0.0);
    vec3 z = vec3(0.0, 0.0, NORMAL_STEP);
    return normalize(vec3(to_scene(p + x) - to_scene(p - x), to_scene(p + y) - to_scene(p - y),
                          to_scene(p + z) - to_scene(p - z)));
}

// The colour that a ray sees; `direction` has unit length.
vec3 seen(vec3 origin, vec3 direction) {
    float t = 0.0;
    bool hit = false;
    vec3 p = origin;
    for (int i = 0; i < STEPS && !hit && dot(p, p) <= BOUNDS * BOUNDS; i++) {
        float d = to_scene(p);
        t += d;
        p = origin + t * direction;
        hit = d < HIT;
    }
    if (!hit)
        return BACKGROUND;
    int which = nearest_to(p);
    vec3 n = normal_at(p), colour = colour_of(which), to_light = LIGHT - p;
    if (dot(direction, n) > 0.0)
        n = -n;
    float away = length(to_light);
    to_light = to_light / away;
    float facing = dot(n, to_light);
    vec3 emission = EMISSION / away, made = 0.01 * colour;
    if (facing > 0.0) {
        vec3 mirrored = 2.0 * facing * n - to_light;
        float shine = max(-dot(mirrored, direction), 0.0);
        made += emission * colour * facing + emission * (0.2 * pow(shine, shininess_of(which)));
    }
    float far = length(p);
    return made * exp(-FOG * far * far * far);
}
