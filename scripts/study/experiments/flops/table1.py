"""Table 1 of the paper, and more: FLOPs of a picture per phase and scene, and which functions they are in."""

import fnmatch
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from study.core import registry
from study.core.registry import BASE
from study.counting import costs, paper_rule
from study.counting.schema import Declared, Measurement, Picture
from study.numbers import paper

# What a function of a phase with costs.def is for: its name, or with * how that begins. A whole name counts
# before any pattern.
TERMS = {
    "into the shape's frame": """
        apply_transform rotate_point approach* local_ray* turned* distance_to_shape coordinate vec_wrapped
        stay_in place_* vec_double_of vec_double_sub wide_*
    """,
    "groups of shapes": """
        group_along closest_group node_* mirrored modified to_frame twist* fold* smooth_minimum least_child
        sin_of
    """,
    "vector library": "vec_* new_vector",
    "distance functions": "sdf_* clamp power_at bulb_*",
    "normals": "normal_* bulb_normal *_gradient gradient_of difference scene_difference moved_* near_hit",
    "light and colour": "light_* power_of trace",
    "closed forms and Newton's steps": "newton",
    "marching": "ideal_* ray_march march soft_* hard_* shadow sdf leaving within",
    "rays of the camera": "get_direction phase_render render_tile store",
}
DISTANCE = "distance functions"
OTHER = "other functions"  # of a phase that is not the project's own
P = TypeVar("P", bound=Picture)


@dataclass(frozen=True)
class Row:
    """A picture. FLOPs in GFLOP, all lanes: by the paper's rule (None: it has none for the phase), by the
    paper's convention (iterations as entered) and the machine's; `measured_gflop`: the machine's, of a phase
    that declares no costs; `paper_gflop` the paper's own figure, at its size. What a phase saves of
    baseline's: `rule_cut` by the rule, `cut` of useful lanes, `measured_cut` by the machine's convention."""

    scene: str
    phase: str
    flags_from: str
    kernel: str | None
    width: int
    height: int
    paper_rule_gflop: float | None = None
    paper_convention_gflop: float | None = None
    machine_convention_gflop: float | None = None
    compare_gop: float | None = None
    useful_share: float | None = None
    flop_per_evaluation: float | None = None
    evaluations_million: float | None = None
    cut: float | None = None
    rule_cut: float | None = None
    paper_gflop: float | None = None
    difference: float | None = None
    paper_cut: float | None = None
    measured_gflop: float | None = None
    measured_cut: float | None = None

    @property
    def saved(self) -> float | None:
        return self.measured_cut if self.cut is None else self.cut

    @property
    def gflop(self) -> float | None:
        """GFLOP by the paper's convention, or what was measured of a phase that declares nothing."""
        return self.measured_gflop if self.paper_convention_gflop is None else self.paper_convention_gflop


@dataclass(frozen=True)
class Term:
    """FLOPs of some functions, paper's convention; `share` of the picture's."""

    scene: str
    phase: str
    width: int
    height: int
    term: str
    gflop: float
    share: float
    flop_per_evaluation: float | None


def term_of(function: str) -> str:
    for fits in (str.__eq__, fnmatch.fnmatchcase):
        for term, names in TERMS.items():
            if any(fits(function, name) for name in names.split()):
                return term
    return OTHER


def evaluations(one: Declared) -> int | None:
    """Evaluations of the scene's distance, rays times steps.

    None where `sdf` does not count the work: the phase has no such function, or evaluates shapes without it.
    One evaluation calls a distance function at most once per shape, and what is inside a Mandelbulb's once
    per iteration besides; a function that ran more often was called by others.
    """
    count = one.by_function["sdf"].lanes if "sdf" in one.by_function else 0
    lanes = [f.lanes for name, f in one.by_function.items() if term_of(name) == DISTANCE]
    return count if count and max(lanes, default=0) <= _most_calls(one.scene) * count else None


def _most_calls(scene: str) -> int:
    """Calls of one function in one evaluation of the scene, at most; an unknown scene is held to be large."""
    if scene not in registry.scenes():
        return 64
    shapes = registry.find_scene(scene).data["shapes"]
    return len(shapes) * max(shape.get("iterations", 1) for shape in shapes)


def by_scene(pictures: Iterable[P]) -> list[P]:
    pictures = list(pictures)
    order = list(dict.fromkeys(one.scene for one in pictures))
    return sorted(pictures, key=lambda one: order.index(one.scene))


def rows(declared: Iterable[Declared], measured: Iterable[Measurement] = ()) -> list[Row]:
    """One row per picture: of declared costs, and of what was measured of phases that declare none."""
    stated = [one for one in declared if one.flops]
    known = {(one.spec, one.scene) for one in stated}
    base = {(one.scene, one.size): one for one in stated if one.phase == BASE}
    pictures = by_scene([*stated, *(one for one in measured if (one.spec, one.scene) not in known)])
    order = list(registry.phases())
    if len(pictures) > len(stated):
        pictures.sort(key=lambda one: order.index(one.phase) if one.phase in order else len(order))
    return [_row(one, base.get((one.scene, one.size))) for one in by_scene(pictures)]


def _row(one: Declared | Measurement, first: Declared | None) -> Row:
    about = (one.scene, one.phase, one.flags_from, one.kernel, one.width, one.height)
    pixels = one.width * one.height
    if isinstance(one, Measurement):
        machine = one.total.machine
        cut = 1 - machine / first.flops.machine if first and first.flops else None
        return Row(*about, measured_gflop=machine / 1e9, measured_cut=cut)
    assert one.flops
    first = None if first is one else first
    stated = paper.read("performance").set_index(["metric", "scene", "phase"])["value"]
    count, rule = evaluations(one), paper_rule.flop(one)
    bases = paper_rule.flop(first) if first else None
    theirs = stated.get(("flop_count", one.scene, one.phase)) if pixels == paper.PIXELS else None
    return Row(
        *about,
        paper_rule_gflop=rule / 1e9 if rule is not None else None,
        paper_convention_gflop=one.flops.paper / 1e9,
        machine_convention_gflop=one.flops.machine / 1e9,
        compare_gop=one.by_class["compare"] / 1e9,
        useful_share=one.useful / one.executed if one.executed else float("nan"),
        flop_per_evaluation=one.useful_paper / count if count else None,
        evaluations_million=count / 1e6 if count else None,
        cut=1 - one.useful_paper / first.flops.paper if first and first.flops else None,
        rule_cut=1 - rule / bases if rule is not None and bases else None,
        paper_gflop=theirs / 1e9 if theirs else None,
        difference=rule / theirs - 1 if theirs and rule is not None else None,
        paper_cut=stated.get(("flop_cut", one.scene, one.phase), float("nan")) / 100,
    )


def terms(declared: Iterable[Declared]) -> list[Term]:
    made = []
    for one in by_scene(declared):
        if not one.flops or one.phase not in registry.phases() or not costs.declares(one.phase):
            continue
        sums: Counter[str] = Counter()
        for name, function in one.by_function.items():
            sums[term_of(name)] += function.paper
        sums["of which math.h calls"] = one.by_class["call"]
        sums["not counted: comparisons of the source"] = one.by_class["compare"]
        total, count = one.flops.paper, evaluations(one)
        about = one.scene, one.phase, one.width, one.height
        for term, flop in sums.items():
            share = flop / total if total else float("nan")
            made.append(Term(*about, term, flop / 1e9, share, flop / count if count else None))
    return made
