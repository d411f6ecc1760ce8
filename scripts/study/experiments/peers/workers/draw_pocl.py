"""PoCL's side of stepwise peers: an OpenCL kernel with a work item for each pixel.

Runs in the Python that has pyopencl and PoCL: TASK.json. One JSON object on standard output: ns of each
frame after the first, which compiles.
"""

import json
import sys
import time

import numpy as np
import pyopencl as cl

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


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    platforms = [one for one in cl.get_platforms() if one.name == "Portable Computing Language"]
    if not platforms:
        sys.exit("there is no PoCL among OpenCL's platforms")
    device = platforms[0].get_devices()[0]
    context = cl.Context([device])
    queue = cl.CommandQueue(context)
    program = cl.Program(context, HEAD + task["source"] + KERNEL)
    kernel = program.build(["-cl-single-precision-constant"]).draw
    width, height = task["width"], task["height"]
    pixels = np.empty((height, width, 4), np.float32)
    buffer = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, pixels.nbytes)
    ns = []
    for number in range(-1, task["frames"]):
        origin = np.array([*(p + 1e-6 * (number + 1) for p in task["position"]), 0], np.float32)
        begun = time.perf_counter_ns()
        kernel(queue, (width, height), None, origin, buffer)
        queue.finish()
        ns.append(time.perf_counter_ns() - begun)
        if number < 0 and task["out"]:
            cl.enqueue_copy(queue, pixels, buffer)
            np.save(task["out"], pixels[..., :3])
    print(json.dumps({"ns": ns[1:], "version": platforms[0].version.removeprefix("OpenCL ")}))


if __name__ == "__main__":
    main()
