"""One interleaved sweep on a node that nobody else uses, as a test of ReFrame (reframe-hpc 4.10).

    reframe -c extras/reframe/sweep.py -r --timestamp -S phases="opt4 opt9_convex" --distribute=idle

`--timestamp` keeps the runs of earlier sessions. `--distribute` makes a test for every node; without it there
is one, where ReFrame's scheduler puts it.
The sweep times its phases in turn, so a test is never less than a whole sweep. docs/scale.md says more.
"""

from __future__ import annotations

import json
import statistics
from pathlib import Path

import reframe as rfm
import reframe.utility.sanity as sn
from reframe.core.builtins import run_before, sanity_function, variable

ROOT = Path(__file__).resolve().parents[2]


@rfm.simple_test
class Sweep(rfm.RunOnlyRegressionTest):
    """The run's folder is results/MACHINE/RUN of the test's output; the figures are ms of a frame."""

    descr = "Stepwise: phases timed in turn on one node"
    valid_systems = ["*"]  # noqa: RUF012
    valid_prog_environs = ["*"]  # noqa: RUF012
    exclusive_access = True
    num_tasks = 1
    num_tasks_per_node = 1
    time_limit = "2h"
    sourcesdir = None
    keep_files = ["results"]  # noqa: RUF012
    phases = variable(str, value="opt4 opt9_convex")
    scenes = variable(str, value="scene0")
    height = variable(int, value=720)
    launches = variable(int, value=10)

    @run_before("run")
    def set_command(self) -> None:
        self.executable = str(ROOT / "scripts" / "stepwise")
        self.executable_opts = ["sweep", "--json", "--results", "results"]
        self.executable_opts += ["--phase", *self.phases.split(), "--scene", *self.scenes.split()]
        self.executable_opts += ["-n", str(self.height), "--launches", str(self.launches)]

    @sanity_function
    def is_whole(self) -> object:
        return sn.and_(
            # None: a scheduler's backend that tells no status, as `squeue`; the sweep's own line has it then.
            sn.assert_in(self.job.exitcode, (0, None), "the sweep ended with status {0}"),
            sn.assert_found(r'"command": "sweep", "status": "ok"', self.stdout),
        )

    @run_before("performance")
    def find_figures(self) -> None:
        """A figure for each phase and scene, from the frames that the sweep has written."""
        times: dict[str, list[float]] = {}
        for file in Path(self.stagedir).glob("results/*/*/frames.jsonl"):
            for frame in map(json.loads, file.read_text(encoding="utf-8").splitlines()):
                if not frame["warmup"]:
                    times.setdefault(f"{frame['phase']} {frame['scene']}", []).append(frame["ns"] * 1e-6)
        self.perf_variables = {
            name: sn.make_performance_function(sn.defer(statistics.median(ms)), "ms")
            for name, ms in times.items()
        }
