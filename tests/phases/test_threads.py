"""opt5_threads: opt4's picture to the bit whoever draws it, pinned and sleeping workers, no data race.

Where each worker runs and whether it sleeps is asked of the kernel (/proc/PID/task), not of the phase. What
the system can refuse (a thread, a CPU, memory) is refused by a few lines of C before libc's own.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import needs
import numpy as np
import pytest
from emulated import made_in

from conformance.feature_scenes import DEEPEST, FEATURES, STANDING
from study.core import registry
from study.core.build import build
from study.core.registry import ROOT
from study.pictures import images

PHASE, PARENT = "opt5_threads", "opt4"
CPUS = sorted(os.sched_getaffinity(0))

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(registry.missing_isa(registry.phases()[PHASE])), reason="the CPU lacks what opt5_threads needs"
    ),
]


def scene(name: str, folder: Path) -> Path:
    """A scene of the study by its name, one of conformance's features, or one made here."""
    if name in registry.scenes():
        return registry.scenes()[name].path
    features = FEATURES | {"shapes_4096": coincident(), "mirrors_deepest": DEEPEST, "standing": STANDING}
    path = folder / f"{name}.json"
    path.write_text(json.dumps(features[name]))
    return path


def coincident() -> dict:
    """4,096 spheres in one place."""
    whole = FEATURES["shapes_same_place"]
    return whole | {"shapes": [whole["shapes"][0]] * 4096}


def call(program: Path, *arguments: object, preload: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | ({"LD_PRELOAD": str(preload)} if preload else {})
    return subprocess.run(
        [program, *map(str, arguments)], capture_output=True, text=True, env=environment, timeout=300
    )


def picture(program: Path, path: Path, folder: Path, *arguments: object, said: str = "", **how: Path):
    """Every plane, as bits; `said`: what standard error must hold, in one line."""
    out = folder / "picture.exr"
    done = call(program, path, "--aov", "-o", out, *arguments, **how)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") == bool(said) and said in done.stderr, done.stderr
    return {name: plane.view(np.uint32) for name, plane in images.read(out).items()}


def check_same(mine: dict, other: dict, where: object) -> None:
    assert mine.keys() == other.keys()
    for name in other:
        assert np.array_equal(mine[name], other[name]), f"{where}: channel {name}"


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
    path = scene(name, tmp_path)
    shape = ("-w", size[0], "-n", size[1])
    parents = picture(build(PARENT), path, tmp_path, *shape)
    for count in threads:
        mine = picture(build(PHASE), path, tmp_path, *shape, "--threads", count, "--reps", 2)
        check_same(mine, parents, f"{name} {size}, {count} threads")


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
    path, shape = scene("trio", tmp_path), ("-w", 97, "-n", 41)
    alone = picture(build(PARENT), path, tmp_path, *shape)
    arguments = (*shape, "--threads", 5, "--reps", 4)
    library = refusing(what, tmp_path)
    mine = picture(build(PHASE), path, tmp_path, *arguments, said=f"workers: {said}", preload=library)
    check_same(mine, alone, what)


def test_a_worker_without_memory_ends_it(tmp_path) -> None:
    arguments = (scene("trio", tmp_path), "-n", 9, "--threads", 3)
    done = call(build(PHASE), *arguments, preload=refusing("NO_MEMORY", tmp_path))
    assert (done.returncode, done.stdout) == (5, "")
    assert done.stderr.count("\n") == 1


# --- data races


SANITIZER = "ThreadSanitizer does not run here (libtsan): it would look for data races"


def sanitized(phase: str, folder: Path) -> Path:
    """Its driver under ThreadSanitizer; where that does not run the test is left out."""
    probe = folder / "probe"
    (folder / "probe.c").write_text("int main(void) { return 0; }\n")
    made = shutil.which("gcc") and call("gcc", "-fsanitize=thread", folder / "probe.c", "-o", probe)
    if not made or made.returncode or call(probe).returncode:
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
def test_no_data_race_in_a_picture_of(phase, name, compiler, tmp_path, monkeypatch) -> None:
    """ThreadSanitizer over a few frames of a tiny picture, to the bit one thread's of the plain build."""
    needs.cpu_for(phase)
    program, path, shape = sanitized(phase, tmp_path), scene(name, tmp_path), ("-w", 97, "-n", 41)
    monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path / "plain"))
    monkeypatch.setenv("STEPWISE_CC", compiler or "none")
    plain = picture(build(phase), path, tmp_path, *shape)
    if compiler == "gcc":
        monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path / "cache"))
        monkeypatch.setenv("STEPWISE_CC", str(sanitizing(tmp_path)))
    mine = picture(program, path, tmp_path, *shape, "--threads", 3, "--reps", 3)
    check_same(mine, plain, f"{phase}, {name}")
    assert (compiler == "gcc") == bool(list(tmp_path.glob("cache/*.so"))), "the kernel was generated"


def sanitizing(folder: Path) -> Path:
    """A compiler of kernels, under ThreadSanitizer, too."""
    script = folder / "cc"
    script.write_text('#!/bin/sh\nexec gcc "$@" -fsanitize=thread -g1 -O1\n')
    script.chmod(0o755)
    return script


POOL = """
#include <stdio.h>
#include <stdlib.h>
#include "workers/workers.h"
enum { MOST = 3000 };
static int drawn[MOST]; // plain: two workers at one tile are a data race
static void render_tile(const void *job, int tile, void *own) {
    (void)job;
    drawn[tile]++;
    ++*(int *)own;
}
int main(int argc, char **argv) {
    int frames = 20, tiles = atoi(argv[argc - 1]);
    struct workers *workers = workers_start(atoi(argv[1]), sizeof(int));
    for (int frame = 0; frame < frames; frame++)
        workers_run(workers, render_tile, NULL, tiles);
    workers_end(workers);
    for (int tile = 0; tile < MOST; tile++)
        if (drawn[tile] != (tile < tiles ? frames : 0))
            return printf("tile %d: %d times\\n", tile, drawn[tile]), 1;
    return 0;
}
"""


def test_each_tile_is_drawn_once_without_a_race(tmp_path) -> None:
    """The pool alone, under ThreadSanitizer, for any number of workers and tiles, fewer than them too."""
    source, program = tmp_path / "pool.c", tmp_path / "pool"
    source.write_text(POOL)
    made = call(
        *("gcc", "-std=c11", "-D_GNU_SOURCE", "-O1", "-g1", "-fsanitize=thread", "-pthread"),
        *("-I", ROOT / "common", source, *sorted(ROOT.glob("common/workers/*.c")), "-o", program),
    )
    if "tsan" in made.stderr:
        pytest.skip(SANITIZER)
    assert made.returncode == 0, made.stderr
    for workers in (1, 2, 3, 8):
        for tiles in (1, 7, 2999):
            done = call(program, workers, tiles)
            assert (done.returncode, done.stdout) == (0, ""), done.stderr
