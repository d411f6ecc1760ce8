"""Phases and scenes, found by their folders and files: there is no list to edit."""

from __future__ import annotations

import difflib
import functools
import os
import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from study.core import patches, scene_json
from study.core.cli import StudyError
from study.core.json_files import read_json
from study.core.run_schema import Variant
from study.core.scene_json import Content

BASE = "baseline"  # what speed-ups are over
ROOT = Path(__file__).resolve().parents[3]
NO_ARITHMETIC = {"-pthread"}  # flags
# Flags for copies of structs, gcc's alone; common/build/phase_info.py says which compiler gets them.
COPIES = ("-mmove-max=", "-mstore-max=", "-mmemcpy-strategy=", "-mmemset-strategy=")
TRUTH = "truth"  # family of what the others are held against: not timed, verified or counted
SYSTEMS = "systems"  # family of what other articles did: alternatives to the ladder, shown apart
SQUARE = {"two_spheres"}  # 800x800 in the paper it is from
# What arm64's vectors (asimd) do in place of these, by common/simd or by SIMDe (common/build/phase_info.py).
NEON_FOR = frozenset({"avx2", "fma"})
FRACTALS = frozenset({"mandelbulb", "mandelbox"})  # shapes whose distance is an estimate


class Phase(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A phase.json. `isa` are flag names of x86-64's /proc/cpuinfo; `path` is the folder."""

    name: str
    title: str
    family: str
    order: int | float
    parent: str | None
    idea: str
    paper: str | None
    isa: list[str]
    precision: str
    lanes: int
    threads: bool
    algorithm: str
    cflags: str
    tolerance: dict[str, dict[str, Any]]
    path: Path = ROOT
    planes: list[str] = []  # channels of its own, with --aov
    # Built for several numbers of lanes (driver/variant.h), widest first; `lanes` is the widest, `isa` what
    # all need. `each_variant`: the files that are built for each.
    variants: list[Variant] = []
    each_variant: list[str] = []
    # Solids and planes are hit where they are, not where a march ends: conformance holds a scene whose step
    # cap or hit distance shapes the marched picture against truth's picture instead of the reference's.
    exact_hits: bool = False
    # It makes the picture as it is displayed itself, where that alone is asked for (render --display).
    display: bool = False
    # It draws groups of shapes, modifiers and the shapes that are only in groups; others refuse such a scene.
    groups: bool = False
    # Its picture is meant to be near, not the same: conformance asks of its form alone, and `tolerance` says
    # how much further from truth than baseline it may be (scripts/stepwise accuracy).
    approximate: bool = False
    # Files of a source that the program has in it and compiles at run time (common/build/phase_info.py).
    embedded: list[str] = []
    # On scenes without a fractal its kernel is other code than the general one, which alone is counted.
    kernel_apart: bool = False
    # Its folder holds what differs from this phase's files; `without` names those left out (core.patches).
    derives: str | None = None
    without: list[str] = []

    @property
    def draws_ideal(self) -> bool:
        """Whether it draws the ideal soft shadow, not an estimate of it, and is judged by that."""
        return "ideal" in self.tolerance

    def file(self, name: str) -> Path:
        """Where the file `name` of the phase's tree stands: in its own folder or in the nearest ancestor's;
        in its own if there is none. Raises StudyError for a broken lineage."""
        own = self.path / name
        if own.exists() or not self.derives or "+" in self.name:
            return own
        root = self.path.parent if self.family == TRUTH else self.path.parents[1]
        try:
            return patches.files(self.name, root).get(name, self.path / name)
        except patches.PatchError as error:
            raise StudyError(str(error)) from None


@dataclass(frozen=True)
class Scene:
    """One common/scenes/NAME.json. `fractal`: it has one of FRACTALS, so single samples are chaotic."""

    name: str
    path: Path
    data: dict[str, Any]
    fractal: bool

    @property
    def content(self) -> Content:
        return scene_json.read(self.data)

    def size(self, height: int, width: int | None = None) -> tuple[int, int]:
        """(width, height) in pixels; without a width 16:9 as the driver has it, or square."""
        return width or (height if self.name in SQUARE else max(1, int(height * 16 / 9 + 0.5))), height


@dataclass(frozen=True, order=True)
class Spec:
    """The sources of `phase` built with the cflags of `flags_from`; written opt2 or opt2@opt4.

    A phase may be an ablation, opt2+title (study.core.patches)."""

    phase: str
    flags_from: str

    @classmethod
    def parse(cls, text: str) -> Spec:
        """Raises StudyError, with the nearest names, if a phase does not exist."""
        phase, _, flags_from = text.partition("@")
        find_phase(phase)
        if "@" in text:
            find_phase(flags_from)
        return cls(phase, flags_from or phase)

    def __str__(self) -> str:
        return self.phase if self.phase == self.flags_from else f"{self.phase}@{self.flags_from}"


def _unknown(kind: str, name: str, known: Iterable[str]) -> StudyError:
    known = list(known)
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known) or 'none'}"
    return StudyError(f"no {kind} '{name}'; {hint}")


@functools.cache
def phases(root: Path = ROOT) -> dict[str, Phase]:
    """All phases by name, sorted by family and order. Raises StudyError with the file and the key."""
    found = []
    for folder in patches.folders(root).values():
        path = folder / "phase.json"
        try:
            phase = msgspec.convert(patches.about(folder.name, root) | {"path": folder}, Phase)
        except patches.PatchError as error:
            raise StudyError(str(error)) from None
        except msgspec.ValidationError as error:
            raise StudyError(f"{path}: {error}") from None
        if phase.name != folder.name:
            raise StudyError(f"{path}: name is '{phase.name}', must be the folder's '{folder.name}'")
        found.append(phase)
    found.sort(key=lambda phase: (phase.family, phase.order, phase.name))
    return {phase.name: phase for phase in found}


def ladder(root: Path = ROOT) -> dict[str, Phase]:
    """The phases that are timed, verified and counted: all but those of families truth and systems."""
    return {name: phase for name, phase in phases(root).items() if phase.family not in (TRUTH, SYSTEMS)}


@functools.cache
def scenes(root: Path = ROOT) -> dict[str, Scene]:
    """All scenes by name, sorted. Raises StudyError for a file that is not a JSON object."""
    return _scenes_in(root / "common" / "scenes")


@functools.cache
def animated(root: Path = ROOT) -> dict[str, Scene]:
    """The scenes that are made to move (render --frames), by name: no suite renders them as stills."""
    return _scenes_in(root / "common" / "scenes" / "animated")


@functools.cache
def large(root: Path = ROOT) -> dict[str, Scene]:
    """Scenes of hundreds of shapes, by name: drawn where they are asked for, for baseline takes long."""
    return _scenes_in(root / "common" / "scenes" / "large")


@functools.cache
def groups(root: Path = ROOT) -> dict[str, Scene]:
    """Scenes of groups, by name: drawn where they are asked for, by phases that draw groups."""
    return _scenes_in(root / "common" / "scenes" / "groups")


@functools.cache
def shipped(root: Path = ROOT) -> dict[str, Scene]:
    """Every scene of the project, by name."""
    return scenes(root) | animated(root) | large(root) | groups(root)


def _scenes_in(folder: Path) -> dict[str, Scene]:
    return {path.stem: scene_at(path) for path in sorted(folder.glob("*.json"))}


def scene_at(path: Path) -> Scene:
    """The scene of a file. Raises StudyError for one that is not a JSON object."""
    if not isinstance(data := read_json(path), dict):
        raise StudyError(f"{path}: must be a JSON object")
    shapes = data.get("shapes")
    shapes = shapes if isinstance(shapes, list) else []  # what is wrong, the driver says
    fractal = any(shape.get("type") in [*FRACTALS] for shape in shapes if isinstance(shape, dict))
    return Scene(path.stem, path, data, fractal)


def is_exact(spec: str) -> bool:
    """Whether a program of a run (opt9_convex, opt2@opt3) marches to no shape; False for what has gone."""
    phase = phases().get(re.split("[@+]", spec)[0])
    return phase is not None and phase.exact_hits


def find_phase(name: str, root: Path = ROOT) -> Phase:
    """The phase of that name, or a StudyError that names the nearest ones. NAME+TITLE is the ablation
    NAME/ablations/TITLE.patch; its `path` is there once it is built."""
    if "+" in name:
        return _ablation(name, root)
    if name not in phases(root):
        raise _unknown("phase", name, phases(root))
    return phases(root)[name]


@functools.cache
def _ablation(name: str, root: Path) -> Phase:
    base, _, title = name.partition("+")
    find_phase(base, root)
    if not patches.file(base, title, root).is_file():
        raise _unknown(f"ablation of {base}", title, patches.titles(base, root))
    try:
        return msgspec.convert(
            patches.described(name, root) | {"path": root / "build" / name / "source"}, Phase
        )
    except patches.PatchError as error:
        raise StudyError(str(error)) from None


def parent_of(name: str, root: Path = ROOT) -> str | None:
    """What NAME is a change of: a phase's parent, the phase of NAME+TITLE, the sources of NAME@FLAGS."""
    base = re.split("[@+]", name)[0]
    return base if base != name else find_phase(name, root).parent


def find_scene(name: str, root: Path = ROOT) -> Scene:
    """The scene of that name, or of a file that was `given`, or a StudyError that names the nearest ones."""
    if name in _given:
        return _given[name]
    if name in animated(root) and name not in scenes(root):
        raise StudyError(f"scene '{name}' stands in common/scenes/animated: it is for animation and flight")
    known = scenes(root) | large(root) | groups(root)
    if name not in known:
        raise _unknown("scene", name, known)
    return known[name]


def find_animated(name: str) -> Scene:
    """One of `animated`, or of a file that was `given`. Raises StudyError for another."""
    if name not in (known := animated() | _given):
        there = f"common/scenes/animated has {', '.join(animated())}; any other by its path"
        raise StudyError(f"{name}: is no animated scene; {there}")
    return known[name]


def given(text: str) -> str:
    """The argparse type of --scene: the name of a scene; a path (which has a slash, or ends in .json) makes
    its file known by its stem. Raises StudyError."""
    if "/" not in text and not text.endswith(".json"):
        return text
    scene = scene_at(Path(text).absolute())  # programs are started in other folders too
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,59}", scene.name):
        raise StudyError(f"{text}: its name goes into tables and files: a-z, 0-9, _, - and . are allowed")
    if lacking := [key for key in scene_json.KEYS if key not in scene.data]:
        raise StudyError(f"{text}: $.{lacking[0]}: is missing; common/scenes/README.md has the format")
    try:
        leaves = [leaf for one in scene.content.shapes for leaf in one.leaves]
        if unknown := {one.material for one in leaves} - {*scene.content.materials}:
            raise StudyError(f"{text}: material {unknown.pop()!r} is not defined in $.materials")
    except msgspec.ValidationError as error:
        raise StudyError(f"{text}: {error}") from None
    if (other := _given.get(scene.name, shipped().get(scene.name))) and other.data != scene.data:
        raise StudyError(f"{text}: {other.path} is another scene of that name; rename one of the files")
    _given[scene.name] = scene
    return scene.name


_given: dict[str, Scene] = {}  # by name: of the files on the command line, and of those that a run has


def own_scenes() -> dict[str, Scene]:
    """The scenes of given files that are not the project's."""
    return {name: scene for name, scene in _given.items() if name not in shipped()}


@functools.cache
def cpu_flags() -> frozenset[str]:
    match = re.search(
        r"^(?:flags|Features)\s*:(.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE
    )
    return frozenset(match[1].split() if match else ())


@functools.cache
def by_simde() -> list[str]:
    """Phases whose AVX2 intrinsics SIMDe makes NEON's on this machine: none on x86-64."""
    if "asimd" not in cpu_flags():
        return []
    return [name for name in phases() if "<immintrin.h>" in _source(name)]


def _source(name: str) -> str:
    sources = (path for path in patches.files(name, ROOT).values() if path.suffix in (".c", ".h"))
    return "".join(path.read_text() for path in sources)


def translated(programs: Sequence[str], among: Container[Any]) -> str:
    """What stands under every table that has some of these programs among its own; "" where it has none."""
    names = ", ".join(name for name in programs if name in among)
    return f"{names}: AVX2 code, translated to NEON by SIMDe; not written for this CPU." if names else ""


def _limited() -> frozenset[str]:
    limit = os.environ.get("STEPWISE_ISA_LIMIT")
    if limit not in (None, "", "avx2", "none"):
        raise StudyError(f"STEPWISE_ISA_LIMIT is {limit}: avx2 or none is required")
    if "asimd" in cpu_flags():
        return cpu_flags() | NEON_FOR
    if limit == "none":
        return frozenset()
    return frozenset(flag for flag in cpu_flags() if limit != "avx2" or not flag.startswith("avx512"))


def missing_isa(what: Phase | Spec) -> list[str]:
    """Flags that `what` needs and this CPU lacks; a Spec needs those of its flags' phase as well.
    STEPWISE_ISA_LIMIT stands for a smaller CPU, as it does for the driver (common/driver/variant.h)."""
    needy = [what] if isinstance(what, Phase) else [*map(find_phase, (what.phase, what.flags_from))]
    have = _limited()
    return [flag for flag in dict.fromkeys(flag for one in needy for flag in one.isa) if flag not in have]


def variant_here(phase: Phase) -> Variant:
    """The phase's variant that this CPU runs: the widest it has (driver/variant.h)."""
    have = _limited()
    alone = Variant(lanes=phase.lanes, flags="")
    return next((one for one in phase.variants if have.issuperset(one.isa)), alone)


def arithmetic_flags(flags: str, variants: Iterable[Variant] = ()) -> str:
    """Compiler flags without those that change no arithmetic, and without a variant's own: what it shares.

    Two builds of one source by equal ones are one program as far as its speed and its picture go, but for how
    a variant copies its lanes, which clang is not told (common/build/phase_info.py).
    """

    def kept(words: str) -> str:
        return " ".join(
            word for word in words.split() if word not in NO_ARITHMETIC and not word.startswith(COPIES)
        )

    flags = kept(flags)
    own = next((own for one in variants if (own := kept(one.flags)) and flags.endswith(own)), "")
    return flags.removesuffix(own).rstrip()


def short(flags: str) -> str:
    return re.sub(rf"({COPIES[0]}\S+)( ({'|'.join(COPIES[1:])})\S+)+", r"\1 …", flags)


def cpu_supports(what: Phase | Spec) -> bool:
    return not missing_isa(what)
