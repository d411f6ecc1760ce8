"""PoCL: OpenCL on the CPU."""

from study.experiments.peers.peer import FLOAT_DB, IN_FLOAT, Python

PEER = Python(
    name="pocl",
    title="PoCL",
    timed="the kernel and clFinish, without compiling",
    differs=IN_FLOAT,
    least_db=FLOAT_DB,
    packages=("pyopencl[pocl]==2026.1.4",),
    modules="pyopencl, numpy",
    environment={"POCL_MAX_PTHREAD_COUNT": "{threads}", "POCL_CPU_MAX_CU_COUNT": "{threads}"},
)
