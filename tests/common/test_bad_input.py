"""What is wrong with what the driver is given: its status, one line that says so, and nothing left behind."""

from __future__ import annotations

import errno
import functools
import json
import os
import platform
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from conformance.feature_scenes import DEEPEST, scene, shape
from conformance.harness import REFERENCE, Run, binary, call, check_refusal
from study.core import registry
from study.core.build import build
from study.core.run import NO_ISA

SCENE0 = registry.scenes()["scene0"].path
SPHERE = json.dumps(scene([shape("sphere")]))


# What is wrong in it is tests/c/scene's to try; here how a program ends.
SCENES = {"not JSON": ("{", ":1:1: "), "a value": (SPHERE.replace('"fog": 0', '"fog": "0"'), ": $.fog: ")}


@pytest.mark.parametrize("name", SCENES)
def test_scene(name: str, tmp_path: Path) -> None:
    text, place = SCENES[name]
    path = tmp_path / "bad.json"
    path.write_text(text)
    run = call(REFERENCE, path, "-n", 4, "-o", tmp_path / "a.exr")
    check_refusal(run, 2)
    assert f"{path}{place}" in run.stderr, f"{run}"
    assert os.listdir(tmp_path) == ["bad.json"]


@pytest.mark.parametrize("name", ["nowhere.json", ".", "bad.json/x"])
def test_scene_that_cannot_be_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text("{}")
    run = call(REFERENCE, tmp_path / name, "-n", 4)
    check_refusal(run, 2)
    assert str(tmp_path / name) in run.stderr, f"{run}"


# Arguments that are refused, and the option that the line names.
ARGUMENTS = {
    **{f"-n {height}": "-n" for height in ("0", "100000", "-5", "1e3", "12px", "99999999999999999999")},
    **{f"-n 4 --hit-distance {value}": "--hit-distance" for value in ("0", "-1", "nan", "inf", "1e-3x")},
    **{f"-n 4 {words}": words.split()[0] for words in ("--threads 0", "--reps 0", "--warmup -1", "-w 0")},
    **{f"-n 4 {words}": words.split()[0] for words in ("--max-steps 2.5", "--frames 0", "--first-frame 1")},
    **{f"-n 4 {word}": word for word in ("--fast", "-x", "--help=1")},
    "-n 32768 -w 32768": "32768 x 32768",
    "-zn 4": "-z",
    "-n 4 --frames 2 --reps 2": "--reps",
    "-n 4 --frames 3 --first-frame 3": "--first-frame 3",
    "-n 4 --frames 3": "--frames",
    "-n 4 --json --jsonl": "--jsonl",
    "-n 4 --display --aov": "--aov",
    **{f"-n 4 -o {name}": f'"{name}"' for name in ("a.jpg", "-", ".exr", ".png")},
    "-n 4 --display -o a.exr": '"a.exr"',
    **{f"-n 4 --aov -o a.{ending}": f'"a.{ending}"' for ending in ("png", "ppm")},
    **{f"-n 4 --samples {words}": "--samples" for words in ("0", "65", "2x", "2 --aov")},
    "-n 4000 --samples 16": "113776 x 64000",
    "-n 4 another.json": "SCENE.json",
    "-n": "-n",
    "--json": "-n",
}


@pytest.mark.parametrize("arguments", ARGUMENTS)
def test_arguments(arguments: str) -> None:
    run = call(REFERENCE, SCENE0, *arguments.split())
    check_refusal(run, 2)
    assert ARGUMENTS[arguments] in run.stderr, f"{run}"


@pytest.mark.parametrize("limit", ["sse2", "AVX2", "avx512f"])
def test_a_limit_of_the_cpu_that_is_none(limit: str) -> None:
    """Left aside without a word, it would be another CPU's figure."""
    command = [binary("opt4"), SCENE0, "-n", "4"]
    environment = os.environ | {"STEPWISE_ISA_LIMIT": limit}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and f"STEPWISE_ISA_LIMIT is {limit}" in done.stderr


def on_a_stack(kib: int, phase: str, whole: dict, folder: Path) -> subprocess.CompletedProcess[str]:
    path = folder / "scene.json"
    path.write_text(json.dumps(whole))
    limited = ["bash", "-c", f'ulimit -s {kib}; exec "$@"', "bash"]
    return subprocess.run([*limited, binary(phase), path, "-n", "32"], capture_output=True, text=True)


@pytest.mark.parametrize("phase", ["opt6_wide", "opt7_tiles", "opt9_convex"])
def test_a_stack_that_is_too_small(phase: str, tmp_path: Path) -> None:
    """Packets are on it, of every bounce: with 256 KiB opt6_wide died by a signal, without a word. What is
    asked for is enough, and less is refused.
    """
    small = on_a_stack(1023, phase, DEEPEST, tmp_path)
    assert small.returncode == 2
    assert small.stderr.count("\n") == 1 and "ulimit -s 1024" in small.stderr
    enough = on_a_stack(1024, phase, DEEPEST, tmp_path)
    assert (enough.returncode, enough.stderr) == (0, "")


def test_no_scene() -> None:
    check_refusal(call(REFERENCE, "-n", 4), 2)
    check_refusal(call(REFERENCE), 2)


@pytest.mark.parametrize(
    "name, reason",
    [
        ("missing/a.exr", os.strerror(errno.ENOENT)),
        ("file/a.exr", os.strerror(errno.ENOTDIR)),
        ("folder.exr", ""),
        ("x" * 300 + ".exr", os.strerror(errno.ENAMETOOLONG)),
    ],
)
def test_unwritable_output(name: str, reason: str, tmp_path: Path) -> None:
    """Refused before the picture is rendered, not after."""
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder.exr").mkdir()
    run = call(REFERENCE, SCENE0, "-n", 2000, "-o", tmp_path / name, timeout=20)  # rendering takes minutes
    check_refusal(run, 2)
    assert f": {reason}" in run.stderr, f"{run}"
    assert sorted(os.listdir(tmp_path)) == ["file", "folder.exr"]
    assert (tmp_path / "file").read_text() == "kept" and not os.listdir(tmp_path / "folder.exr")


@pytest.mark.parametrize("name", ["mine.exr", "./link.exr", "hard.exr"])
def test_a_picture_does_not_take_its_scenes_place(name: str, tmp_path: Path) -> None:
    (tmp_path / "mine.exr").write_text(SPHERE)
    (tmp_path / "link.exr").symlink_to("mine.exr")
    (tmp_path / "hard.exr").hardlink_to(tmp_path / "mine.exr")
    run = call(REFERENCE, tmp_path / "mine.exr", "-n", 4, "-o", tmp_path / name)
    check_refusal(run, 2)
    assert all((tmp_path / each).read_text() == SPHERE for each in ("mine.exr", "link.exr", "hard.exr"))


def size_of(path: Path) -> int:
    """0: it is not there, or empty."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize("ending", ["exr", "ppm"])
def test_what_ends_the_program_takes_the_half_picture_along(
    ending: str, number: signal.Signals, tmp_path: Path
) -> None:
    """And the picture that was there is kept; where the signal is ignored (nohup), it is finished."""
    out = tmp_path / f"a.{ending}"
    size = ["-n", "4000", "-w", "8000"] if ending == "ppm" else ["-n", "700"]
    option = "--display" if ending == "ppm" else "--aov"
    command = [binary("opt9_convex"), SCENE0, *size, "--threads", "2", option, "-o", out]
    for ignored in (False, True):
        out.write_text("earlier")
        # not as it was inherited: a shell's background job ignores SIGINT
        then = signal.SIG_IGN if ignored else signal.SIG_DFL
        begin = functools.partial(signal.signal, number, then)
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=registry.ROOT, preexec_fn=begin)
        temporary = tmp_path / f"a.{ending}.{process.pid}.tmp"
        while not size_of(temporary):  # the first, empty, asks whether it can be written
            assert process.poll() is None, "it was written unseen"
        process.send_signal(number)
        assert process.wait(60) == (0 if ignored else -number)
        assert os.listdir(tmp_path) == [out.name]
        assert (out.read_bytes() == b"earlier") == (not ignored)


@pytest.mark.parametrize("trap", ["", "trap '' XFSZ; "])
@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.ppm"])
def test_limited_file_size(name: str, trap: str, tmp_path: Path) -> None:
    """As on a full disk, and the picture that was there before is kept, signal ignored or not."""
    (tmp_path / name).write_text("earlier")
    script = f'ulimit -f 8; {trap}exec "$@"'
    command = ["sh", "-c", script, "sh", binary(REFERENCE), SCENE0, "-n", "100"]
    command += ["-o", tmp_path / name]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    check_refusal(Run([str(word) for word in command], done.returncode, done.stdout, done.stderr), 2)
    assert os.listdir(tmp_path) == [name] and (tmp_path / name).read_text() == "earlier"


@pytest.mark.parametrize("where", [">/dev/full", ">&-"])
@pytest.mark.parametrize("mode", ["--json", "--jsonl", "--list"])
def test_standard_output_that_takes_nothing(mode: str, where: str) -> None:
    """A record that was not written is no success."""
    command = f"exec '{binary(REFERENCE)}' '{SCENE0}' -n 2 {mode} {where}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=300)
    run = Run([command], done.returncode, done.stdout, done.stderr)
    check_refusal(run, 2)


def test_picture_does_not_land_in_a_closed_descriptor(tmp_path: Path) -> None:
    """With standard output closed, the next file opened gets its number: no line may go into the picture."""
    command = f"exec '{binary(REFERENCE)}' '{SCENE0}' -n 2 -o '{tmp_path / 'a.exr'}' >&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".tmp")]


# Programs that time something; those that only draw or count have no need of it.
TIMED = {
    "render": lambda: [binary(REFERENCE), SCENE0, "-n", "4"],
    "hits": lambda: [build("packets", "hits"), SCENE0],
    "ceilings": lambda: [build(".", "ceilings"), "--samples", "5"],
    "functions": lambda: [build("functions", "bench"), "times"],
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) if name != "render" else name
                                  for name in TIMED])  # fmt: skip
def test_a_cpu_without_a_timer_is_refused(name: str) -> None:
    """rdtscp, which a hypervisor may hide: a status and a line, and no illegal instruction."""
    if platform.machine() != "x86_64" or not shutil.which("qemu-x86_64"):
        pytest.skip("this machine is no x86-64, or qemu-x86_64 is missing")
    command = ["qemu-x86_64", "-cpu", "max,-rdtscp", *map(str, TIMED[name]())]
    done = subprocess.run(command, capture_output=True, text=True, input="")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (NO_ISA, "", 1)
    assert f"{name}: " in done.stderr and "rdtscp" in done.stderr
