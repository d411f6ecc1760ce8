"""The paper's program beside ours: a toy repository in its place, whose times and picture are known."""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path

import complete
import numpy as np
import pytest

from study.core import cli, commands, registry
from study.core.cli import CANNOT_RUN, StudyError
from study.experiments.original import measure as original
from study.numbers.beside import ORIGINAL, Original, held_beside
from study.pictures import images

ORIGIN = {"x": 0, "y": 0, "z": 0}
THEIRS = {
    "camera": {"width": 64, "height": 36, "fov": 30, "position": ORIGIN, "rotation": ORIGIN},
    "pointlight": {"position": ORIGIN, "emission": ORIGIN},
    "transforms": [{"position": {"x": 0, "y": 0, "z": 9}, "rotation": ORIGIN}],
    "materials": [{"reflection": 0, "shininess": 1, "surface": ORIGIN}],
    "geometric_objects": [{"name": "sphere", "transform_idx": 0, "material_idx": 0, "params": [1]}],
}
CONFIG = (
    "#define REPETITIONS 4\n#define WARM_UP_REPETITIONS 0\n"
    "#define START_H_RESOLUTION 100 // width\n#define END_H_RESOLUTION 2000   // width\n#define AA 1\n"
)
# Written in the paper's form: n, cycles of the one run, their mean.
PROGRAM = """#!/bin/sh
folder=../output/render/$2
mkdir -p $folder && echo "n, Run 0, AVG" > $folder/measurements.csv
echo "36, 2500000, 2500000" >> $folder/measurements.csv && cp ../picture.png $folder/out_36_64.png
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository whose program "draws" a black picture in 2.5 million cycles."""
    made = tmp_path / "theirs"
    (made / "build").mkdir(parents=True)
    (made / "include").mkdir()
    (made / "include" / "config.h").write_text(CONFIG)
    (made / "build" / "makefile").write_text("raymarcher: ../program\n\tcp ../program raymarcher\n")
    (made / "program").write_text(PROGRAM)
    (made / "program").chmod(0o755)
    images.write_png(made / "picture.png", np.zeros((36, 64, 3), np.uint8))
    git = ["git", "-C", str(made), "-c", "user.name=t", "-c", "user.email=t@t"]
    for command in (["init", "-q"], ["add", "-f", "."], ["commit", "-q", "-m", "toy"]):
        subprocess.run([*git, *command], check=True)
    head = subprocess.check_output([*git, "rev-parse", "HEAD"], text=True).strip()
    monkeypatch.setattr(original, "COMMITS", {"opt4": head})
    return made


def test_toy_is_fetched_built_and_timed(toy: Path, tmp_path: Path) -> None:
    kept = tmp_path / "build" / "repository"
    original.fetch(str(toy), kept)
    program = original.build(kept, "opt4", 36)
    config = (program.parents[1] / "include" / "config.h").read_text()
    assert "START_H_RESOLUTION 36 //" in config and " REPETITIONS 1\n" in config
    cycles, picture = original.launch(program, "scene0", 0, 10)
    assert cycles == 2_500_000 and picture.shape == (36, 64, 3) and not picture.any()
    settings = argparse.Namespace(n=36, launches=2, seed=1)
    row = original.measure(program, registry.find_scene("scene0"), "opt4", settings)
    ours, theirs = map(np.median, (row.ours_launches_ms, row.theirs_launches_ms))
    assert row.ours_over_theirs.value == pytest.approx(ours / theirs) and row.largest > 200
    assert not row.ours_over_theirs.sufficient


def test_a_folder_of_this_machine_is_not_published(tmp_path: Path) -> None:
    assert original.called(original.REPOSITORY) == original.REPOSITORY
    said = original.called(str(tmp_path))
    assert str(tmp_path) not in said and said.endswith(f" {original.REPOSITORY}")


def test_settings_that_are_missing_are_named() -> None:
    with pytest.raises(StudyError, match="REPETITIONS"):
        original.configured(CONFIG.replace("REPETITIONS 4", "REPEAT 4"), 36)


def test_repository_that_cannot_be_had(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="none") as raised:
        original.fetch(str(tmp_path / "none"), tmp_path / "build" / "repository")
    assert raised.value.exit_status == CANNOT_RUN and not (tmp_path / "build" / "repository").exists()


def test_program_that_fails_is_named(toy: Path, tmp_path: Path) -> None:
    original.fetch(str(toy), tmp_path / "kept")
    program = original.build(tmp_path / "kept", "opt4", 36)
    program.write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(StudyError, match="scene0: status 3"):
        original.launch(program, "scene0", 0)


def test_difference_by_arithmetic() -> None:
    """One pixel of 4 is 51 steps off in one channel of 3: PSNR is 10 log10(255² · 12 / 51²) = 24.77 dB."""
    theirs, ours = np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.uint8)
    ours[0, 1, 2] = 51
    psnr, share, largest = original.difference(theirs, ours)
    assert psnr == pytest.approx(24.7712, abs=1e-3) and (share, largest) == (0.25, 51)
    assert original.difference(ours, ours)[0] is None
    with pytest.raises(StudyError):
        original.difference(theirs, ours[:1])


def test_rows_that_are_not_made_anew_are_kept(tmp_path: Path) -> None:
    path = tmp_path / ORIGINAL
    assert original.others(path, 720, ["opt1"], ["scene0"]) == []
    keys = [
        ("baseline", "scene0", 720),
        ("opt1", "scene0", 720),
        ("opt1", "trio", 720),
        ("opt2", "scene0", 90),
    ]
    rows = [{"phase": p, "scene": s, "n": n, "ours_over_theirs": {}} for p, s, n in keys]
    complete.write(path, {"rows": rows})
    kept = original.others(path, 720, ["opt1"], ["scene0"])
    assert [(row.phase, row.scene, row.n) for row in kept] == [keys[0], keys[2]]


def test_a_scene_file_of_the_papers_is_converted_for_ours(toy: Path, tmp_path: Path) -> None:
    original.fetch(str(toy), tmp_path / "kept")
    program = original.build(tmp_path / "kept", "opt4", 36)
    folder = program.parents[1] / "scenes"
    folder.mkdir()
    (folder / "ball.json").write_text(json.dumps(THEIRS))
    found = original.scene_of("ball", [program])
    assert found.path.is_file() and [shape["type"] for shape in found.data["shapes"]] == ["sphere"]
    assert not found.fractal
    with pytest.raises(StudyError, match="ball"):
        original.scene_of("bowl", [program])


def test_from_end_to_end(toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is measured again replaces its row; the others stay."""
    monkeypatch.setattr(original, "folder_of", lambda repository: tmp_path / "kept" / "repository")
    words = ["--repository", str(toy), "-n", "36", "--launches", "1", "--run", str(tmp_path / "run")]
    for scenes in (["scene0", "mandelbulb"], ["scene0"]):
        outcome, _ = commands.called("original", [*words, "--scene", *scenes])
        assert outcome.ended == cli.OK
        made = Original.load(tmp_path / "run" / ORIGINAL)
        assert sorted(row.scene for row in made.rows) == ["mandelbulb", "scene0"]
    assert cli.plain(outcome.result) == cli.plain(made) and str(tmp_path) not in (made.repository or "")
    assert not held_beside(tmp_path / "run")  # no baseline was measured
