"""opt5_threads: opt4's picture to the bit whoever draws it, pinned and sleeping workers, no data race.

Where each worker runs and whether it sleeps is asked of the kernel (/proc/PID/task), not of the phase. What
the system can refuse (a thread, a CPU, memory) is refused by a few lines of C before libc's own.
"""

from __future__ import annotations

import functools
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import needs
import pytest
from phase_pictures import check_bits, picture, render
from phase_pictures import needs as needs_cpu
from programs import made_in

from conformance.feature_scenes import DEEPEST, FEATURES, STANDING
from study.core import registry
from study.core.build import build
from study.pictures import images

PHASE, PARENT = "opt5_threads", "opt4"
CPUS = sorted(os.sched_getaffinity(0))

pytestmark = [pytest.mark.slow, needs_cpu(PHASE)]

COINCIDENT = FEATURES["shapes_same_place"]
MORE = {
    "shapes_4096": COINCIDENT | {"shapes": [COINCIDENT["shapes"][0]] * 4096},  # in one place
    "mirrors_deepest": DEEPEST,
    "standing": STANDING,
}
call = functools.partial(subprocess.run, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize(
    ("name", "size", "threads"),
    [
        ("scene0", (160, 90), (1, 2, 3, 7, 64)),
        ("mandelbulb", (80, 45), (2, 5)),
        ("trio", (257, 65), (1, 2, 3)),  # tiles of one column and of one row at the edges
        ("everything", (1, 1), (1, 2, 64)),
        ("everything", (1, 300), (2, 9)),
        ("everything", (32, 8), (2, 64)),  # one tile
        ("standing", (65, 33), (2,)),
        ("nothing_to_see", (65, 33), (3,)),
        ("shapes_4096", (40, 10), (2,)),
        ("mirrors_deepest", (96, 40), (4,)),
    ],
)
def test_any_number_of_threads_draws_opt4s_bits(name, size, threads, tmp_path) -> None:
    scene = MORE.get(name, name)
    parents = picture(PARENT, scene, tmp_path, size=size)
    for count in threads:
        mine = picture(PHASE, scene, tmp_path, "--threads", count, "--reps", 2, size=size)
        check_bits(mine, parents, f"{name} {size}, {count} threads")


# --- where workers are, and what they do between frames


def tasks(pid: int) -> list[dict[str, str]]:
    """/proc/PID/task/*/status of all threads, the first started first, with their CPU time in ns as `ran`."""
    found = []
    for folder in sorted(Path(f"/proc/{pid}/task").iterdir(), key=lambda path: int(path.name)):
        lines = (folder / "status").read_text().splitlines()
        found.append(dict(line.split(":\t", 1) for line in lines))
        found[-1]["ran"] = (folder / "schedstat").read_text().split()[0]
    return found


class Running:
    """The driver at work on frames without end, on `cpus`; killed at the end of the with."""

    def __init__(self, threads: int, cpus: list[int]) -> None:
        command = [build(PHASE), registry.scenes()["scene0"].path, "-n", "8", "--reps", "1000000", "--jsonl"]
        self.child = subprocess.Popen(
            [*map(str, command), "--threads", str(threads)],
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: os.sched_setaffinity(0, cpus),
        )

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *_: object) -> None:
        self.child.kill()
        self.child.wait()
        self.child.stdout.close()

    def frames(self, count: int) -> list[dict]:
        return [json.loads(self.child.stdout.readline()) for _ in range(count)]


@pytest.mark.parametrize("cpus", [CPUS[:1], CPUS[-1:], CPUS], ids=["first", "last", "all"])
def test_each_worker_is_pinned_to_a_cpu_of_the_mask(cpus) -> None:
    """As many workers besides the caller as CPUs: each has one; the caller has its mask between frames."""
    with Running(len(cpus) + 1, cpus) as running:
        records = running.frames(3)
        pins = [task["Cpus_allowed_list"] for task in tasks(running.child.pid)[1:]]
    assert sorted(map(int, pins)) == cpus
    assert {record["cpu"] for record in records} == {cpus[0] if len(cpus) == 1 else -1}  # not pinned by us


def test_one_thread_starts_and_pins_nothing() -> None:
    with Running(1, CPUS) as running:
        running.frames(2)
        assert len(tasks(running.child.pid)) == 1


def test_workers_sleep_between_frames() -> None:
    """The driver stops between two frames as soon as nobody reads its lines: then nothing runs any more."""
    with Running(3, CPUS) as running:
        running.frames(40)
        seen = tasks(running.child.pid)
        assert len(seen) == 3 and all(int(task["voluntary_ctxt_switches"]) > 1 for task in seen[1:])
        caller, deadline = None, time.monotonic() + 60
        while caller != (caller := tasks(running.child.pid)[0]["ran"]):  # until the pipe is full
            assert time.monotonic() < deadline, "the caller never stopped"
            time.sleep(0.5)
        before = tasks(running.child.pid)
        time.sleep(0.5)
        after = tasks(running.child.pid)
    assert [task["State"][0] for task in after] == ["S"] * 3
    assert [task["ran"] for task in before] == [task["ran"] for task in after]


# --- what the system may refuse

REFUSALS = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#ifdef NO_PINS
int pthread_setaffinity_np(pthread_t thread, size_t size, const cpu_set_t *cpus) {
    return EPERM;
}
#endif
#ifdef TWO_THREADS
int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*what)(void *), void *with) {
    static int calls;
    int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    *(void **)&real = dlsym(RTLD_NEXT, "pthread_create");
    return calls++ < 2 ? real(thread, how, what, with) : EAGAIN;
}
#endif
#ifdef NO_MEMORY
void *aligned_alloc(size_t alignment, size_t size) {
    void *(*real)(size_t, size_t);
    *(void **)&real = dlsym(RTLD_NEXT, "aligned_alloc");
    return gettid() == getpid() ? real(alignment, size) : NULL;
}
#endif
"""


def refusing(what: str, folder: Path) -> Path:
    library = folder / f"{what}.so"
    (folder / "refusals.c").write_text(REFUSALS)
    command = ["gcc", "-shared", "-fPIC", f"-D{what}", folder / "refusals.c", "-o", library, "-ldl"]
    subprocess.run(command, check=True)
    return library


@pytest.mark.parametrize(("what", "said"), [("NO_PINS", "4 of 5"), ("TWO_THREADS", "3 of 5")])
def test_what_is_refused_is_stated_once_and_drawn_without(what, said, tmp_path) -> None:
    alone, library = picture(PARENT, "trio", tmp_path), str(refusing(what, tmp_path))
    done = render(PHASE, "trio", tmp_path, "--threads", 5, "--reps", 4, LD_PRELOAD=library)
    assert done.returncode == 0 and done.stderr.count("\n") == 1
    assert f"workers: {said}" in done.stderr
    check_bits(images.read(tmp_path / "picture.exr"), alone, what)


def test_a_worker_without_memory_ends_it(tmp_path) -> None:
    library = str(refusing("NO_MEMORY", tmp_path))
    done = render(PHASE, "trio", tmp_path, "--threads", 3, LD_PRELOAD=library)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (5, "", 1)


# --- data races


SANITIZER = "ThreadSanitizer does not run here (libtsan): it would look for data races"


def sanitized(phase: str, folder: Path) -> Path:
    """Its driver under ThreadSanitizer; where that does not run the test is left out."""
    probe = folder / "probe"
    (folder / "probe.c").write_text("int main(void) { return 0; }\n")
    made = shutil.which("gcc") and call(["gcc", "-fsanitize=thread", folder / "probe.c", "-o", probe])
    if not made or made.returncode or call([probe]).returncode:
        pytest.skip(SANITIZER)
    return made_in("tsan", phase, "SANITIZE=thread")


@pytest.mark.parametrize(
    ("phase", "name", "compiler"),
    [
        pytest.param("opt8_streams", "everything", None, id="opt8_streams"),
        pytest.param("opt9_convex", "spheres40", None, id="opt9_convex"),
        pytest.param("opt10_scene", "scene0", "gcc", id="opt10_scene"),
        pytest.param("packets", "spheres40", None, id="packets"),
    ],
)
def test_no_data_race_in_a_picture_of(phase, name, compiler, tmp_path) -> None:
    """ThreadSanitizer over a few frames of a tiny picture, to the bit one thread's of the plain build."""
    needs.cpu_for(phase)
    program, scene = sanitized(phase, tmp_path), MORE.get(name, name)
    general = {"STEPWISE_CACHE": str(tmp_path / "plain"), "STEPWISE_CC": compiler or "none"}
    plain = picture(phase, scene, tmp_path, size=(97, 41), **general)
    kernels = tmp_path / "cc"  # a compiler of kernels, under ThreadSanitizer, too
    kernels.write_text('#!/bin/sh\nexec gcc "$@" -fsanitize=thread -g1 -O1\n')
    kernels.chmod(0o755)
    words = {"STEPWISE_CACHE": str(tmp_path / "cache"), "STEPWISE_CC": str(kernels)} if compiler else {}
    mine = picture(program, scene, tmp_path, "--threads", 3, "--reps", 3, size=(97, 41), **words)
    check_bits(mine, plain, f"{phase}, {name}")
    assert (compiler == "gcc") == bool(list(tmp_path.glob("cache/*.so"))), "the kernel was generated"
