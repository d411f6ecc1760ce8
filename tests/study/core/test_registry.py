"""Phases and scenes found by folder; names, specs and instruction sets."""

import json
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.core import registry
from study.core.cli import StudyError
from study.core.registry import Spec

NAMES = sorted(registry.phases())


def tree(root, **phases):
    """A tree with phases/NAME/phase.json made of opt1's and the given changes; None removes a key."""
    model = json.loads((registry.ROOT / "phases/opt1/phase.json").read_text())
    for name, changes in phases.items():
        described = {k: v for k, v in (model | {"name": name} | changes).items() if v != "remove"}
        (root / "phases" / name).mkdir(parents=True)
        (root / "phases" / name / "phase.json").write_text(json.dumps(described))
    return root


def test_every_folder_is_a_phase_in_order_of_the_ladder():
    found = registry.phases()
    ladder = {path.parent.name for path in registry.ROOT.glob("phases/*/phase.json")}
    systems = {path.parent.name for path in registry.ROOT.glob("systems/*/phase.json")}
    assert set(found) == ladder | systems | {"truth"} and ladder == set(registry.ladder())
    ladder = ["baseline", "opt1", "opt2", "opt3", "opt4"]
    assert [name for name in found if name in ladder] == ladder
    assert found["baseline"].parent is None
    assert found["opt3"].isa == ["avx2", "fma"]
    assert all(phase.path.is_dir() for phase in found.values())


def test_order_is_family_then_number_then_name(tmp_path):
    tree(tmp_path, z={"order": 0}, b={"order": 1}, a={"order": 1}, c={"order": -1})
    (tmp_path / "systems").mkdir()
    (tmp_path / "phases" / "c").rename(tmp_path / "systems" / "c")
    assert list(registry.phases(tmp_path)) == ["z", "a", "b", "c"]
    assert registry.phases(tmp_path)["c"].family == "systems"


def test_a_phase_in_the_making_is_not_seen(tmp_path):
    tree(tmp_path, a={})
    (tmp_path / "phases" / "a").rename(tmp_path / "phases" / ".a")
    assert registry.phases(tmp_path) == {}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"isa": "remove"}, "`isa`"),
        ({"colour": "red"}, "`colour`"),
        ({"name": "b"}, "name is 'b'"),
        ({"order": "first"}, r"`\$\.order`"),
    ],
)
def test_a_wrong_phase_json_is_named(tmp_path, changes, words):
    with pytest.raises(StudyError, match=words):
        registry.phases(tree(tmp_path, a=changes, c={}))


def test_broken_json_has_line_and_column(tmp_path):
    tree(tmp_path, a={})
    (tmp_path / "phases/a/phase.json").write_text('{\n  "name": }')
    with pytest.raises(StudyError, match=r"phases/a/phase\.json:2:11: "):
        registry.phases(tmp_path)


def test_scenes_know_whether_they_are_fractal():
    found = registry.scenes()
    assert found["mandelbulb"].fractal and found["mandelbox"].fractal
    assert not found["scene0"].fractal
    assert set(found) == {path.stem for path in registry.ROOT.glob("common/scenes/*.json")}


@given(st.sampled_from(NAMES), st.sampled_from(NAMES))
def test_a_spec_is_what_it_was_parsed_from(phase, flags_from):
    spec = Spec.parse(f"{phase}@{flags_from}")
    assert spec == Spec(phase, flags_from)
    assert Spec.parse(str(spec)) == spec
    assert str(Spec.parse(phase)) == phase


@pytest.mark.parametrize("text", ["op4", "opt2@op4", "@opt4", "opt2@", "", "opt2@opt4@opt4"])
def test_an_unknown_phase_is_refused(text):
    with pytest.raises(StudyError, match="no phase"):
        Spec.parse(text)


def test_an_unknown_name_names_the_nearest():
    with pytest.raises(StudyError, match=r"'op4'.* opt4"):
        registry.find_phase("op4")
    with pytest.raises(StudyError, match=r"'mandlebulb'.* mandelbulb"):
        registry.find_scene("mandlebulb")
    with pytest.raises(StudyError, match=r"'xyz'.*cubes"):
        registry.find_scene("xyz")
    with pytest.raises(StudyError, match=r"'flythrough' .* common/scenes/animated"):
        registry.find_scene("flythrough")


def test_a_cpu_without_the_instruction_set(monkeypatch):
    monkeypatch.setattr(registry, "cpu_flags", lambda: frozenset({"sse2", "avx2"}))
    assert registry.missing_isa(registry.find_phase("opt3")) == ["fma"]
    assert registry.missing_isa(Spec("opt2", "opt3")) == ["fma"]
    assert registry.cpu_supports(Spec("opt2", "opt2"))
    assert not registry.cpu_supports(Spec("opt3", "opt2"))
    monkeypatch.setenv("STEPWISE_ISA_LIMIT", "none")
    assert registry.missing_isa(Spec("opt3", "opt4")) == ["avx2", "fma"]
    assert registry.cpu_supports(registry.find_phase("baseline"))


@pytest.mark.parametrize(
    ("scene", "height", "width", "size"),
    [
        ("scene0", 720, None, (1280, 720)),
        ("scene0", 100, None, (178, 100)),
        ("scene0", 1, None, (2, 1)),
        ("two_spheres", 800, None, (800, 800)),
        ("two_spheres", 800, 640, (640, 800)),
    ],
)
def test_width_is_16_9_unless_the_scene_is_square(scene, height, width, size):
    assert registry.find_scene(scene).size(height, width) == size


WIDE = [
    name for name, phase in registry.phases().items() if any("-mmove-max=" in v.flags for v in phase.variants)
]


ARITHMETIC = {"-O3", "-mavx2", "-mfma", "-ffp-contract=off"}
GCC = "gcc (Debian 12.2.0-14+deb12u1) 12.2.0"


@pytest.mark.parametrize(
    ("name", "compiler", "knows"),
    [
        *((name, GCC, True) for name in WIDE),
        (WIDE[0], "gcc-14 (Ubuntu 14.2.0-4ubuntu2~24.04) 14.2.0", True),
        (WIDE[0], "gcc-11 (Ubuntu 11.4.0-9ubuntu1) 11.4.0", False),
        (WIDE[0], "Debian clang version 14.0.6", False),
        (WIDE[0], "Ubuntu clang version 18.1.3 (1ubuntu1)", False),
        (WIDE[0], "Intel(R) oneAPI DPC++/C++ Compiler 2024.1.0 (2024.1.0.20240308)", False),
    ],
)
def test_lanes_are_copied_whole_by_gcc_and_others_are_not_told(name, compiler, knows, tmp_path):
    """Moves as wide as a variant's lanes; phases are compared by what their lanes share, either way."""
    words = [sys.executable, registry.ROOT / "common/build/phase_info.py", name, name, tmp_path, compiler, ""]
    subprocess.run(words, check=True)
    made = json.loads((tmp_path / "flags.json").read_text())
    phase = registry.phases()[name]
    for variant in phase.variants:
        own = made["flags"][f"lanes{variant.lanes}"]
        assert (f"-mmove-max={32 * variant.lanes} " in own) == knows
        assert ("-mavx512f " in own) == (variant.lanes == 16)
        words = [word for word in variant.flags.split() if knows or not word.startswith(registry.COPIES)]
        assert own.split(" -DLANES=")[0] == " ".join(words)
        told = f"{phase.cflags} {own.partition('-DLANES')[0]}"
        assert set(registry.arithmetic_flags(told, phase.variants).split()) == ARITHMETIC
