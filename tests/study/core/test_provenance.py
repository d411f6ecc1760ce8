"""What a run's files say of themselves: commits and hours by hand, spread and steal by arithmetic."""

from __future__ import annotations

import json
from pathlib import Path

import complete
import pytest

from study.core import provenance
from study.core.run_schema import Context
from study.experiments.lattice import schema as lattice

FILES = ["rods.json", "fixed.json", lattice.FILE]
OLD, NEW = "694a2379e4" + "0" * 30, "da3dd80826" + "1" * 30


def context(commit: str, time: str, ticks: int = 0, dirty: bool = False) -> dict:
    cpu = {"model": "AMD EPYC", "microarchitecture": "Zen 3", "usable_cpus": 2}
    git = {"commit": commit, "dirty": dirty}
    return {"time": f"2026-11-22T{time}:00+00:00", "cpu": cpu, "compiler": "gcc 12.2.0", "git": git,
            "steal_ticks": ticks}  # fmt: skip


def write(path: Path, name: str, content: dict) -> None:
    complete.write(path / name, content)


@pytest.fixture
def mixed(tmp_path) -> Path:
    """The run and its rods of one commit, integers of another, an hour later."""
    write(tmp_path, "context.json", context(OLD, "19:34"))
    write(tmp_path, "accuracy.json", {"rows": []})  # says nothing of where it was made
    write(tmp_path, "rods.json", complete.published("rods.json") | {"context": context(OLD, "20:24", 1000)})
    integers = complete.published("fixed.json") | {"context": context(NEW, "21:24", 1000 + 7200)}
    write(tmp_path, "fixed.json", integers)
    return tmp_path


def test_each_file_s_own_commit_and_hour_are_said(mixed):
    found = provenance.contexts(mixed, FILES)
    assert list(found) == ["rods", "fixed"]
    where, rods, fixed = provenance.line(found).rsplit("; ", 2)
    assert where == "AMD EPYC (Zen 3); gcc 12.2.0"
    assert [rods, fixed] == [f"{OLD[:10]} (rods 2026-11-22T20:24)", f"{NEW[:10]} (fixed 2026-11-22T21:24)"]
    write(mixed, lattice.FILE, {"rows": [], "context": context(OLD, "20:54", dirty=True)})
    changed = provenance.line(provenance.contexts(mixed, FILES))
    assert "uncommitted" in changed and "(lattice 2026-11-22T20:54)" in changed
    assert provenance.commits(mixed)[NEW[:10]] == ["fixed"]
    assert provenance.commits(mixed)[OLD[:10]] == ["context", "rods"]
    elsewhere = Context.of(context(NEW, "22:00") | {"compiler": "clang 19"}, "")
    said = provenance.line(found | {"packets": elsewhere})
    assert said.split("; ")[-2:] == ["clang 19", f"{NEW[:10]} (packets 2026-11-22T22:00)"]


def test_how_quiet_the_machine_was_by_hand(mixed):
    """Rods: median launches 1, 1.5 and 4 times the least. 72 s of steal in an hour of two CPUs: 1 %."""
    launches = {"a": [[1, 1, 1], [2.0, 3.0, 9.0]], "b": {"c": [1, 4, 4]}}
    content = [{"ms": 1, "launches": one} for one in (*launches["a"], launches["b"]["c"])]
    assert provenance.spread({"rows": content}) == (1.5, 4.0)
    assert provenance.spread({"rows": [], "launches": 6}) is None, "a number"
    (mixed / "rows.json").write_text(json.dumps({"rows": content}))
    assert "rows 1.50 (at most 4.00)" in provenance.disturbed(mixed, ["rows.json"])
    assert " 1.0 %" in provenance.disturbed(mixed, FILES)
    again = json.loads((mixed / "fixed.json").read_text()) | {"context": context(NEW, "21:24", 5)}
    write(mixed, "fixed.json", again)
    assert "hypervisor" not in provenance.disturbed(mixed, FILES)
    assert provenance.disturbed(mixed / "none", FILES) == ""
