"""scripts/stepwise random and animation: what breaks is named and kept; frames are those of the phase."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import sys

import emitted
import numpy as np
import pytest
import started

from study.core import build, cli, registry, run
from study.core.registry import ROOT
from study.experiments.random import inputs as measure
from study.pictures import images

STEPWISE = ROOT / "scripts" / "stepwise"
FAILING = """
import json, os, pathlib
def test_no_phase_breaks():
    kept = pathlib.Path(os.environ["STEPWISE_KEPT"], "random_any.json")
    kept.write_text(json.dumps({"seen": int(os.environ["STEPWISE_RANDOM"])}))
    assert 2 + 2 == 5, "opt3: status -11"
"""
HARNESS = """
#include <stddef.h>
#include <stdint.h>
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size > 1 && data[0] == 'n' && data[1] == 'o') __builtin_trap();
    return 0;
}
"""


def stepwise(*words: object) -> subprocess.CompletedProcess[str]:
    return started.run([sys.executable, STEPWISE, *map(str, words)])


def test_a_scene_that_breaks_a_phase_is_named_and_kept(tmp_path, monkeypatch) -> None:
    (tmp_path / "hard").mkdir()
    (tmp_path / "hard" / "test_random_scenes.py").write_text(FAILING)
    monkeypatch.setattr(measure, "TESTS", tmp_path)
    row = measure.scenes("any", 3, 7)
    assert (row.kind, row.seed, row.tried) == ("any", 3, 7)
    assert row.found.startswith("AssertionError: opt3: status -11") and json.loads(row.input) == {"seen": 7}


@pytest.mark.skipif(not shutil.which("clang"), reason="fuzzing needs clang, which is not installed")
def test_bytes_that_break_a_reader_are_named_and_kept(tmp_path, monkeypatch) -> None:
    source, program = tmp_path / "harness.c", tmp_path / "harness"
    source.write_text(HARNESS)
    subprocess.run(["clang", "-fsanitize=fuzzer,address", source, "-o", program], check=True)
    monkeypatch.setattr(build, "build", lambda spec, target: program)
    row = measure.fuzzed("harness", 1, 200_000)
    assert (row.kind, row.seed, row.tried) == ("harness", 1, 200_000) and row.found.startswith("SUMMARY: ")
    assert base64.b64decode(row.input)[:2] == b"no"


def test_a_harness_without_clang_is_one_line(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(cli.StudyError, match="clang") as caught:
        emitted.told("random", "--kind", "cache", "--run", tmp_path / "run")
    assert caught.value.exit_status == cli.CANNOT_RUN


def test_frames_are_those_of_the_phase(tmp_path) -> None:
    words = ["--scene", "spheres40_animated", "--phase", "opt4", "--first-frame", 30, "--frames", 2, "-n", 18]
    done = stepwise("animation", *words, "--run", tmp_path, "--json")
    assert done.returncode == cli.OK, done.stderr
    rows = emitted.result(done.stdout)["rows"]
    assert [(row["frame"], row["seconds"]) for row in rows] == [(30, 0.5), (31, 31 / 60)]
    scene = registry.animated()["spheres40_animated"]
    for row in rows:
        out = tmp_path / "frame.exr"
        run.render("opt4", scene.path, 18, 32, out=out, animation=99, first_frame=row["frame"], timed=False)
        picture = images.read(out)
        assert row["sha256"] == images.sha256(picture)
        shown = images.to_display(images.rgb(picture))
        assert np.array_equal(images.read_png(tmp_path / row["picture"]), shown)
    assert rows[0]["sha256"] != rows[1]["sha256"]
    assert stepwise("animation", *words[:-4], "--frames", 1, "-n", 18, "--run", tmp_path).returncode == cli.OK
    (left,) = (tmp_path / "animation").iterdir()  # a film of this call has none of an earlier call's frames
    assert left == tmp_path / rows[0]["picture"]
