"""Files of a run: whole or not at all, also after a kill and on a full disk."""

import gzip
import os
import subprocess
import sys

import complete
import pytest

from study.core import store
from study.core.cli import StudyError
from study.core.run_schema import Frame, Plan
from study.core.store import Run

FRAME = complete.filled(
    {"phase": "opt2", "flags_from": "opt4", "config": "c", "launch": 0, "frame": 0, "ns": 12}, Frame
)


@pytest.fixture
def run(tmp_path):
    made = Run.create(tmp_path / "results", "some-cpu-6-1")
    store.write_json(made.path / "plan.json", {"schema": 1})
    store.write_json(made.path / "context.json", {"cpu": {"model": "Some CPU"}})
    yield made
    made.close()


def test_context_plan_and_folders(run):
    assert run.plan == Plan()
    assert Run.open(run.path).context.cpu.model == "Some CPU"


def test_runs_of_one_second_are_two_folders(tmp_path):
    runs = [Run.create(tmp_path, "m") for _ in range(3)]
    assert len({made.path for made in runs}) == 3


def test_latest_is_the_newest_of_any_machine(tmp_path):
    for name in ("a-cpu/20250102-000000-x", "b-cpu/20250101-000000-x", "reference/20990101-000000-x"):
        store.write_json(tmp_path / name / "plan.json", {})
    (tmp_path / "a-cpu" / "20980101-000000-empty").mkdir()
    assert Run.latest(tmp_path).path.name == "20250102-000000-x"
    assert store.latest(tmp_path).path.name == "20250102-000000-x"


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(StudyError, match="scripts/stepwise sweep"):
        Run.latest(tmp_path)
    with pytest.raises(StudyError, match=r"plan\.json"):
        Run.open(tmp_path)


def test_write_is_all_or_nothing(tmp_path, monkeypatch):
    path = tmp_path / "new" / "plan.json"
    store.write_text(path, "old")

    def full(*_):
        raise OSError(28, "full")

    monkeypatch.setattr(store.os, "fsync", full)
    with pytest.raises(StudyError, match=r"plan\.json: .*full"):
        store.write_text(path, "new")
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]


def test_frames_are_a_table_with_the_spec(run):
    assert run.frames().empty
    run.append_frame(FRAME)
    run.append_frame(FRAME | {"flags_from": "opt2", "frame": 1})
    assert run.frames()["spec"].tolist() == ["opt2@opt4", "opt2"]
    assert run.frames()["ns"].tolist() == [12, 12]


@pytest.mark.parametrize("kept", [1, 10, -2, -1])
def test_a_torn_last_line_is_dropped_and_then_cut_off(run, kept, capsys):
    run.append_frame(FRAME)
    whole = run.frames_path.read_bytes()
    run.append_frame(FRAME | {"frame": 1})
    run.close()
    torn = run.frames_path.read_bytes()[len(whole) :][:kept]
    run.frames_path.write_bytes(whole + torn)

    assert run.frames()["frame"].tolist() == [0]
    assert f"({len(torn)} bytes dropped)" in capsys.readouterr().err
    assert run.frames_path.read_bytes() == whole + torn  # reading changes nothing

    run.append_frame(FRAME | {"frame": 2})
    assert run.frames()["frame"].tolist() == [0, 2]


@pytest.mark.parametrize("line", [b'{"phase": "opt', b'{"ns": 1}'])
def test_any_other_broken_line_is_named(run, line):
    run.append_frame(FRAME)
    whole = run.frames_path.read_bytes()
    run.frames_path.write_bytes(whole + line + b"\n" + whole)
    with pytest.raises(StudyError, match=r"frames\.jsonl:2: "):
        run.frames()


def test_published_frames_are_packed(run):
    run.append_frame(FRAME)
    run.append_frame(FRAME | {"frame": 2})
    expected = run.frames()
    packed = run.path / "frames.jsonl.gz"
    packed.write_bytes(gzip.compress(run.frames_path.read_bytes()))
    run.close()
    run.frames_path.unlink()
    assert run.frames().equals(expected)
    packed.write_bytes(packed.read_bytes()[:-20])
    with pytest.raises(StudyError, match=r"frames\.jsonl\.gz: "):
        run.frames()


def test_one_process_at_a_time_appends(run):
    run.append_frame(FRAME)
    code = "import sys; from study.core.store import Run; Run(sys.argv[1]).append_frame({'phase': 'x'})"
    command = [sys.executable, "-c", code, str(run.path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=store.ROOT / "scripts")
    assert "StudyError" in done.stderr
    assert len(run.frames()) == 1
    run.close()
    subprocess.run(command, check=True, cwd=store.ROOT / "scripts")


def test_a_write_that_fails_half_way_leaves_whole_lines(run, monkeypatch):
    run.append_frame(FRAME)
    pwrite = os.pwrite
    monkeypatch.setattr(store.os, "pwrite", lambda file, data, at: pwrite(file, data[:7], at))
    with pytest.raises(StudyError, match=r"frames\.jsonl: "):
        run.append_frame(FRAME)
    monkeypatch.undo()
    assert run.frames_path.read_bytes().count(b"\n") == 1
    run.append_frame(FRAME)
    assert len(run.frames()) == 2


def test_a_folder_is_tried_and_left_empty(tmp_path):
    folder = tmp_path / "new" / "run"
    assert store.writable(folder) == folder and not list(folder.iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="file"):
        store.writable(tmp_path / "file")
