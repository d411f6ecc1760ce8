"""A fragment shader draws one triangle over the whole picture."""

import sys

import moderngl
import numpy as np

UNTIMED = 1
VERTEX = """#version 330
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
HEAD = "#version 330\nuniform vec3 origin;\nout vec4 pixel;\n"
FRAGMENT = """
void main() {
    float x = 2.0 * gl_FragCoord.x / WIDTH - 1.0, y = 2.0 * gl_FragCoord.y / HEIGHT - 1.0;
    pixel = vec4(seen(origin, normalize(AHEAD + x * RIGHT + y * UP)), 1.0);
}
"""


def renderer(task):
    context = moderngl.create_context(standalone=True, backend="egl")
    name = context.info["GL_RENDERER"]
    if "llvmpipe" not in name:
        sys.exit(f"OpenGL is not by llvmpipe but by {name}")
    program = context.program(vertex_shader=VERTEX, fragment_shader=HEAD + task.source + FRAGMENT)
    width, height = task.width, task.height
    target = context.framebuffer([context.texture((width, height), 4, dtype="f4")])
    triangle = context.vertex_array(program, [])
    target.use()

    def render(origin):
        program["origin"] = tuple(origin)
        triangle.render(moderngl.TRIANGLES, vertices=3)
        context.finish()

    def picture():
        made = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        return made.reshape(height, width, 4)[::-1, :, :3]

    return render, picture, f"{context.info['GL_VERSION'].partition('Mesa ')[2]}, {name}"
