"""For all tests: opt10_scene compiles nothing unless a test says so.

A kernel takes seconds to compile, and the suites have hundreds of scenes. They run its general kernels, which
are the same sources; py/test_scene_kernel.py holds generated ones to these.
"""

from __future__ import annotations

import os

os.environ.setdefault("STEPWISE_CC", "none")
