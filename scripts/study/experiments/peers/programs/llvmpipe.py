"""Mesa's llvmpipe: OpenGL on the CPU, by a fragment shader that marches."""

from study.experiments.peers.peer import FLOAT_DB, IN_FLOAT, Python

PEER = Python(
    name="llvmpipe",
    title="Mesa llvmpipe",
    timed="draw and glFinish, without compiling",
    differs=IN_FLOAT,
    least_db=FLOAT_DB,
    packages=("moderngl==5.13.0",),
    modules="moderngl, numpy",
    environment={
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "GALLIUM_DRIVER": "llvmpipe",
        "LP_NUM_THREADS": "{threads}",
        "EGL_PLATFORM": "surfaceless",
        "MESA_SHADER_CACHE_DISABLE": "true",
    },
)
