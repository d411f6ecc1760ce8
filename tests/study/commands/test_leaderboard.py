"""Ranks from made-up times; entries built and drawn; a page without the names that are to be hidden."""

import contextlib
import json
import types

import emitted
import numpy as np
import pytest

from study.commands import try_
from study.commands.labs import leaderboard
from study.commands.labs.leaderboard import Entry
from study.core import cli, registry
from study.core.host import sandbox
from study.labs import memory


def times(middle: float, seed: int, spread: float = 0.01) -> list[float]:
    return list(middle * np.exp(spread * np.random.default_rng(seed).standard_normal(12)))


def test_ties_share_a_rank():
    """Two that noise alone tells apart are second; the next is fourth; what is out comes last."""
    entries = [Entry(name, "opt2", 1) for name in "dcba"] + [Entry("x", "opt2", 1, "too far")]
    ms = {"a": times(5, 1), "b": times(10, 2, 0.05), "c": times(10.05, 3, 0.05), "d": times(20, 4)}
    found = leaderboard.ranked(entries, ms)
    assert [one.rank for one in found] == [1, 2, 2, 4, 0]
    assert [found[0].name, found[3].name, found[4].name] == ["a", "d", "x"]
    assert found[0].ms.value == pytest.approx(np.median(ms["a"]))


def test_lines_added_and_taken():
    """By hand, of the patch's own lines."""
    patch = leaderboard.patches.chain("opt2+by_type")[0]
    own = [line for line in patch.diff if line[:1] in "+-" and line[:3] not in ("+++", "---")]
    assert leaderboard.changed("opt2+by_type", "opt2") == len(own) > 10
    assert leaderboard.changed("opt2", "opt2") == 0


def test_entries_are_put_in_and_taken_out(tmp_path, monkeypatch):
    root, folder = tmp_path / "root", tmp_path / "class"
    (root / "phases").mkdir(parents=True)
    fake = types.SimpleNamespace(ROOT=root, phases=registry.phases)
    monkeypatch.setattr(leaderboard, "registry", fake)
    for student in ("ada", "ben"):
        (folder / student / "core").mkdir(parents=True)
        (folder / student / "phase.json").write_text('{"name": "mine", "derives": "opt2"}')
        (folder / student / "core" / "sdf.h").write_text(f"// {student}\n")
    with pytest.raises(KeyError), leaderboard.placed(folder) as found:
        assert found == {"entry1": "ada", "entry2": "ben"}
        made = root / "phases" / "entry2"
        assert json.loads((made / "phase.json").read_text()) == {"name": "entry2", "derives": "opt2"}
        assert (made / "core" / "sdf.h").read_text() == "// ben\n"
        raise KeyError
    assert not list((root / "phases").iterdir()) and (folder / "ada" / "core").exists()
    with pytest.raises(cli.StudyError, match=r"phase\.json"), leaderboard.placed(tmp_path / "root"):
        pass


def test_a_phase_json_that_cannot_be_read_is_named_by_its_student_s_folder(tmp_path, monkeypatch):
    (tmp_path / "root" / "phases").mkdir(parents=True)
    (tmp_path / "class" / "ada").mkdir(parents=True)
    (tmp_path / "class" / "ada" / "phase.json").write_text("{}")

    def phases():
        raise cli.StudyError(f"{tmp_path}/root/phases/entry1/phase.json: no title")

    phases.cache_clear = registry.phases.cache_clear
    monkeypatch.setattr(leaderboard, "registry", types.SimpleNamespace(ROOT=tmp_path / "root", phases=phases))
    with (
        pytest.raises(cli.StudyError, match=f"^{tmp_path}/class/ada/phase.json"),
        leaderboard.placed(tmp_path / "class"),
    ):
        pass
    assert not list((tmp_path / "root" / "phases").iterdir())


def test_a_page_escapes_names():
    text = leaderboard.page([Entry("<b>x</b>", "opt2", 3, "out & away")], "about")
    assert "&lt;b&gt;" in text and "out &amp; away" in text and "<b>" not in text


def test_a_fault_of_memory_is_out(monkeypatch):
    """Before anything else is drawn; a file has the name that its student knows."""
    monkeypatch.setattr(leaderboard, "build", lambda spec: None)
    monkeypatch.setattr(
        memory, "looked", lambda *_: memory.Fault("plane", "poison, phases/opt2+by_type/render.c:7")
    )
    entry = leaderboard.verified("opt2+by_type", registry.find_scene("trio"), 36, 50)
    assert entry.out.endswith(" render.c:7") and entry.parent == "opt2"


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "  sdf.h:9:2: warning: odd\n  phases/{0}/sdf.h:10:31: error: nothing\n  make: *** 1",
            "sdf.h:10:31: error: nothing",
        ),
        (
            "  /usr/bin/ld: x.c:7: undefined reference to `f'\n  collect2: error: ld returned 1",
            "/usr/bin/ld: x.c:7: undefined reference to `f'",
        ),
        ("  sdf.h:10:31: Fehler: nichts\n  make: *** [x] Fehler 1", "make: *** [x] Fehler 1"),
    ],
)
def test_what_does_not_build_is_out_by_its_first_error(monkeypatch, said, shown):
    name = "opt2+by_type"

    def fails(spec):
        raise cli.StudyError(f"cannot build {name}:\n" + said.format(name))

    monkeypatch.setattr(leaderboard, "build", fails)
    assert leaderboard.verified(name, registry.find_scene("trio"), 36, 50).out == shown


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [False, True])
def test_a_class_is_ranked(tmp_path, monkeypatch, capsys, hidden):
    """One is right, one too far from the truth, one its parent as it was."""
    found = {"opt2+by_type": "ada", "opt4+rsqrt": "ben", "opt3+scalar_octahedron": "cem"}
    real = leaderboard.changed
    monkeypatch.setattr(leaderboard, "placed", lambda _: contextlib.nullcontext(found))
    monkeypatch.setattr(leaderboard, "changed", lambda n, p: 0 if n.startswith("opt3") else real(n, p))
    monkeypatch.setattr(try_, "timed_height", lambda *_: 36)
    monkeypatch.setattr(memory, "looked", lambda *_: None)  # test_memory.py
    inside = []

    def measured(specs, *_):
        inside.append(sandbox.active())
        return {spec: times(2, 1) for spec in specs}

    monkeypatch.setattr(try_, "times", measured)
    page = tmp_path / "page.html"
    words = ("leaderboard", tmp_path, "-n", 36, "-o", page, "--json", "--seed", 3, *["--hidden"] * hidden)
    assert emitted.told(*words) == cli.FAILED
    assert inside == [True] and not sandbox.active()
    said = capsys.readouterr().out
    one, *out = emitted.result(said)["entries"]
    assert one["rank"] == 1 and one["psnr_db"] > 50 and one["parent"] == "opt2" and one["evaluations"] > 1
    assert sorted(("50 dB" in each["out"], "as it was" in each["out"]) for each in out) == [
        (False, True),
        (True, False),
    ]
    for name in found.values():
        assert (name in page.read_text()) == (f'"{name}"' in said) == (not hidden)
