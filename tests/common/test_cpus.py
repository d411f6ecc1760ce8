"""CPUs with any number, holes between them, and CPUs that go away: C is asked by few lines before libc's own.

A kernel of 4,096 CPUs refuses smaller sets (EINVAL); a machine of that size is not at hand.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import needs
import numpy as np
import pytest

from study.core import registry, run
from study.core.build import build
from study.core.cli import CANNOT_RUN
from study.core.host import child
from study.core.run import DriverError
from study.pictures import images

CPUS = (7, 1030, 4095)
MACHINE = """
#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>

enum { BYTES = 512 };
static const int cpus[] = {CPUS};
int pthread_getaffinity_np(pthread_t thread, size_t size, cpu_set_t *set) {
    (void)thread;
    if (size < BYTES)
        return EINVAL;
    CPU_ZERO_S(size, set);
    for (unsigned i = 0; i < sizeof cpus / sizeof cpus[0]; i++)
        CPU_SET_S(cpus[i], size, set);
    return 0;
}
int sched_getaffinity(pid_t pid, size_t size, cpu_set_t *set) {
    (void)pid;
    if (pthread_getaffinity_np(pthread_self(), size, set) == 0)
        return 0;
    errno = EINVAL;
    return -1;
}
int pthread_setaffinity_np(pthread_t thread, size_t size, const cpu_set_t *set) {
    (void)thread;
    FILE *said = fopen(getenv("SAID"), "a");
    for (size_t cpu = 0; cpu < 8 * size; cpu++)
        if (CPU_ISSET_S(cpu, size, set))
            fprintf(said, "%zu ", cpu);
    fputc('\\n', said);
    fclose(said);
    return 0;
}
"""


def machine(folder: Path, cpus: tuple[int, ...]) -> Path:
    """A library that stands for the kernel of such a machine."""
    library = folder / "machine.so"
    (folder / "machine.c").write_text(MACHINE)
    listed = ",".join(map(str, cpus))
    command = ["gcc", "-shared", "-fPIC", f"-DCPUS={listed}", folder / "machine.c", "-o", library]
    subprocess.run(command, check=True)
    return library


def draw(phase: str, folder: Path, threads: int, more: dict[str, str]) -> tuple[dict, dict[str, np.ndarray]]:
    """What the driver says of a frame, and its picture."""
    out = folder / "out.exr"
    words = [build(phase), registry.scenes()["spheres40"].path, "-w", "97", "-n", "41", "-o", out, "--json"]
    done = subprocess.run(
        [*words, "--threads", str(threads)], capture_output=True, text=True, env=os.environ | more
    )
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout), images.read(out)


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["opt5_threads", "opt6_wide"])
def test_workers_are_pinned_to_cpus_beyond_1024(phase: str, tmp_path: Path) -> None:
    """The caller and three workers on three CPUs: each worker its own, the first CPU twice."""
    needs.cpu_for(phase)
    said = tmp_path / "said"
    preload = {"LD_PRELOAD": str(machine(tmp_path, CPUS)), "SAID": str(said)}
    frame, mine = draw(phase, tmp_path, 4, preload)
    lines = [tuple(map(int, line.split())) for line in said.read_text().splitlines()]
    alone = sorted(line[0] for line in lines if len(line) == 1)
    assert alone == [7, *CPUS]  # the first is the caller's: this machine's own CPU is none of them
    assert [line for line in lines if len(line) != 1] == [CPUS]  # the caller's, given back
    assert frame["cpu"] == -1
    for name, plane in draw(phase, tmp_path, 4, {})[1].items():
        assert np.array_equal(mine[name].view(np.uint32), plane.view(np.uint32)), name


# --- a cpuset that changes while a sweep runs

GONE = 4000  # allowed when the run began; the kernel refuses it as it does a CPU that left the cpuset


def test_a_launch_whose_cpu_is_gone_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "USABLE", [*run.USABLE, GONE])
    with pytest.raises(DriverError, match="render: ") as error:
        run.render("baseline", registry.scenes()["trio"].path, 2, cpu=GONE)
    assert error.value.exit_status == CANNOT_RUN and "\n" not in str(error.value)
    with pytest.raises(child.NotPinned, match="true: "):
        child.run(["true"], preexec_fn=lambda: os.sched_setaffinity(0, {GONE}))
