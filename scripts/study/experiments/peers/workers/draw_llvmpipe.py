"""llvmpipe's side of stepwise peers: a fragment shader draws one triangle over the whole picture.

Runs in the Python that has moderngl: TASK.json. One JSON object on standard output: ns of each frame after
the first, which compiles.
"""

import json
import sys
import time

import moderngl
import numpy as np

VERTEX = """#version 330
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
FRAGMENT = """
void main() {
    float x = 2.0 * gl_FragCoord.x / WIDTH - 1.0, y = 2.0 * gl_FragCoord.y / HEIGHT - 1.0;
    pixel = vec4(seen(origin, normalize(AHEAD + x * RIGHT + y * UP)), 1.0);
}
"""


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    context = moderngl.create_context(standalone=True, backend="egl")
    name = context.info["GL_RENDERER"]
    if "llvmpipe" not in name:
        sys.exit(f"OpenGL is not by llvmpipe but by {name}")
    head = "#version 330\nuniform vec3 origin;\nout vec4 pixel;\n"
    program = context.program(vertex_shader=VERTEX, fragment_shader=head + task["source"] + FRAGMENT)
    size = task["width"], task["height"]
    target = context.framebuffer([context.texture(size, 4, dtype="f4")])
    triangle = context.vertex_array(program, [])
    target.use()
    ns = []
    for number in range(-1, task["frames"]):
        program["origin"] = tuple(p + 1e-6 * (number + 1) for p in task["position"])
        begun = time.perf_counter_ns()
        triangle.render(moderngl.TRIANGLES, vertices=3)
        context.finish()
        ns.append(time.perf_counter_ns() - begun)
        if number < 0 and task["out"]:
            made = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
            np.save(task["out"], made.reshape(size[1], size[0], 4)[::-1, :, :3])
    version = f"{context.info['GL_VERSION'].partition('Mesa ')[2]}, {name}"
    print(json.dumps({"ns": ns[1:], "version": version}))


if __name__ == "__main__":
    main()
