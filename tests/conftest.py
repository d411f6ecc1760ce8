"""For all tests: opt10_scene compiles nothing and no driver measures its clocks unless a test says so.

A kernel takes seconds to compile, and the suites have hundreds of scenes. They run its general kernels, which
are the same sources; py/test_scene_kernel.py holds generated ones to these. Clocks are 25 ms of each of the
thousands of pictures; what the scripts time (study.core.run) has them all the same.
"""

from __future__ import annotations

import os

os.environ.setdefault("STEPWISE_CC", "none")
os.environ.setdefault("STEPWISE_UNTIMED", "1")
