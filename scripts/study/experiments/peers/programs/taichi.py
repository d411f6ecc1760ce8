"""Taichi: kernels written in Python, compiled by LLVM."""

from study.experiments.peers.peer import FLOAT_DB, IN_FLOAT, Python

PEER = Python(
    name="taichi",
    title="Taichi",
    timed="the kernel and its end, without compiling",
    differs=IN_FLOAT,
    least_db=FLOAT_DB,
    packages=("taichi==1.7.4",),
    modules="taichi, numpy",
)
