"""An OpenCL kernel with a work item for each pixel."""

import sys

import numpy as np
import pyopencl as cl

UNTIMED = 1
HEAD = """
typedef float3 vec3;
#define vec3(x, y, z) ((float3)(x, y, z))
#define abs fabs
"""
KERNEL = """
__kernel void draw(float4 origin, __global float4 *pixels) {
    int column = get_global_id(0), row = get_global_id(1);
    float x = 2.0 * (column + 0.5) / WIDTH - 1.0, y = 1.0 - 2.0 * (row + 0.5) / HEIGHT;
    vec3 made = seen(origin.xyz, normalize(AHEAD + x * RIGHT + y * UP));
    pixels[row * (int)WIDTH + column] = (float4)(made, 1.0);
}
"""


def renderer(task):
    platforms = [one for one in cl.get_platforms() if one.name == "Portable Computing Language"]
    if not platforms:
        sys.exit("there is no PoCL among OpenCL's platforms")
    context = cl.Context(platforms[0].get_devices()[:1])
    queue = cl.CommandQueue(context)
    program = cl.Program(context, HEAD + task.source + KERNEL)
    kernel = program.build(["-cl-single-precision-constant"]).draw
    pixels = np.empty((task.height, task.width, 4), np.float32)
    buffer = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, pixels.nbytes)

    def render(origin):
        kernel(queue, pixels.shape[1::-1], None, np.array([*origin, 0], np.float32), buffer)
        queue.finish()

    def picture():
        cl.enqueue_copy(queue, pixels, buffer)
        return pixels[..., :3]

    return render, picture, platforms[0].version.removeprefix("OpenCL ")
