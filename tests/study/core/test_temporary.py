"""Temporary files and folders go with the process, even when a signal comes while one is made."""

import signal
import subprocess
import sys

import pytest

from study.core.registry import ROOT

PROGRAM = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {scripts!r})
from study.core import cli, temporary

def ended_by(call):
    def wrapped(*arguments, **words):
        made = call(*arguments, **words)
        os.mkdir, os.open = plain
        os.kill(os.getpid(), signal.{number})  # the folder is there, and its maker has not returned
        return made
    return wrapped

plain = os.mkdir, os.open
os.mkdir, os.open = ended_by(os.mkdir), ended_by(os.open)

def main():
    with temporary.{kind}(Path({beside!r}), ".made."):
        print("was entered")

cli.main(main)
"""


@pytest.mark.parametrize("kind", ["folder", "file"])
@pytest.mark.parametrize("number", ["SIGTERM", "SIGINT"])
def test_a_signal_while_it_is_made_leaves_nothing(tmp_path, kind, number):
    program = PROGRAM.format(scripts=str(ROOT / "scripts"), number=number, kind=kind, beside=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 128 + getattr(signal, number) and done.stdout == "", done.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_was_moved_away_stays(tmp_path):
    from study.core import temporary

    with temporary.folder(tmp_path) as folder:
        folder.rename(tmp_path / "kept")
    with temporary.file(tmp_path, ".file.") as file:
        file.rename(tmp_path / "file")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "kept"]
