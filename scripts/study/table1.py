"""Table 1 of the paper, and more: FLOPs of a picture per phase and scene, and which functions they are in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from study import costs, paper, registry

BASE = "baseline"
# What a function is for, by the beginning of its name; the first that fits counts.
TERMS = (
    ("distance functions", ("sdf_", "clamp")),
    ("vector library", ("vec_", "new_vector")),
    ("into the shape's frame", ("apply_transform", "rotate_point", "approach", "wrap", "distance_to_shape")),
    ("marching and shadow rays", ("ray_march", "soft_shadow", "hard_shadow", "shadow", "sdf", "place")),
    (
        "closed forms",
        ("first_hit", "next_hit", "hit_sphere", "blocked", "ask_", "meet_sphere", "meet_box", "meet_cone"),
    ),
    ("rays of the camera", ("get_direction", "get_rays", "phase_render", "store")),
)
REST = "normals and light"

Row = dict[str, Any]


def term_of(function: str) -> str:
    return next((term for term, heads in TERMS if function.startswith(heads)), REST)


def evaluations(one: Row) -> int | None:
    """Evaluations of the scene's distance, rays times steps; None for a phase without such a function."""
    found = one["by_function"].get("sdf")
    return found["lanes"] if found else None


def by_scene(declared: Iterable[Row]) -> list[Row]:
    """In the order in which the scenes appear, phases as they are."""
    declared = list(declared)
    order = list(dict.fromkeys(one["scene"] for one in declared))
    return sorted(declared, key=lambda one: order.index(one["scene"]))


def rows(declared: Iterable[Row]) -> list[Row]:
    """One row per picture. FLOPs of both conventions in GFLOP, all lanes; `paper_gflop` the paper's own, at
    its size, and `cut` what a phase saves of baseline's (paper's convention, useful lanes).
    """
    declared = by_scene(declared)
    stated = paper.read("performance").set_index(["metric", "scene", "phase"])["value"]
    base = {(one["scene"], one["width"], one["height"]): one for one in declared if one["phase"] == BASE}
    made = []
    for one in declared:
        same_size = one["width"] * one["height"] == paper.PIXELS
        first = base.get((one["scene"], one["width"], one["height"]))
        useful = one["useful"] / one["executed"] if one["executed"] else float("nan")
        count = evaluations(one)
        flops = one["flops"]["paper"]
        made.append(
            {
                "scene": one["scene"],
                "phase": one["phase"],
                "flags_from": one["flags_from"],
                "kernel": one.get("kernel"),
                "width": one["width"],
                "height": one["height"],
                "paper_convention_gflop": flops / 1e9,
                "machine_convention_gflop": one["flops"]["machine"] / 1e9,
                "compare_gop": one["by_class"]["compare"] / 1e9,
                "useful_share": useful,
                "flop_per_pixel": flops / (one["width"] * one["height"]),
                "flop_per_evaluation": one["useful_paper"] / count if count else None,
                "evaluations_million": count / 1e6 if count else None,
                "cut": 1 - one["useful_paper"] / first["flops"]["paper"]
                if first and first is not one
                else None,
                "paper_gflop": stated.get(("flop_count", one["scene"], one["phase"]), float("nan")) / 1e9
                if same_size
                else None,
                "paper_cut": stated.get(("flop_cut", one["scene"], one["phase"]), float("nan")) / 100,
            }
        )
    return made


def terms(declared: Iterable[Row]) -> list[Row]:
    """Where the FLOPs are: one row per picture and term, paper's convention, `share` of the picture's."""
    made = []
    for one in by_scene(declared):
        total = one["flops"]["paper"]
        sums: dict[str, int] = {}
        calls = one["by_class"]["call"]
        for name, function in one["by_function"].items():
            sums[term_of(name)] = sums.get(term_of(name), 0) + function["paper"]
        about = {key: one[key] for key in ("scene", "phase", "width", "height")}
        count = evaluations(one)
        for term, flop in sums.items():
            made.append(
                {
                    **about,
                    "term": term,
                    "gflop": flop / 1e9,
                    "share": flop / total if total else float("nan"),
                    "flop_per_evaluation": flop / count if count else None,
                }
            )
        for term, flop in (
            ("of which math.h calls", calls),
            ("not counted: comparisons of the source", one["by_class"]["compare"]),
        ):
            made.append(
                {
                    **about,
                    "term": term,
                    "gflop": flop / 1e9,
                    "share": flop / total if total else float("nan"),
                    "flop_per_evaluation": flop / count if count else None,
                }
            )
    return made


# Functions of baseline whose math.h calls are transcendental; the others' are fabs, fmin, fmax and floor.
TRANSCENDENTAL = ("rotate_point", "sdf_mandelbulb", "light_at", "trace")


def readings(declared: Iterable[Row]) -> list[Row]:
    """Baseline's FLOPs as they would be under other rules, beside the paper's own figure: what the
    difference is made of. The paper's spreadsheet is not public, so none of them is claimed to be its rule.
    """
    stated = paper.read("performance").set_index(["metric", "scene", "phase"])["value"]
    declared_costs = costs.read(registry.find_phase(BASE).path / "costs.def")
    made = []
    for one in declared:
        theirs = stated.get(("flop_count", one["scene"], BASE))
        if one["phase"] != BASE or theirs is None or one["width"] * one["height"] != paper.PIXELS:
            continue
        functions, total = one["by_function"], one["flops"]["paper"]
        simple = costs.calls_of(declared_costs, functions) - costs.calls_of(
            declared_costs, functions, TRANSCENDENTAL
        )
        radians = 3 * functions["rotate_point"]["calls"]
        found = [
            ("the paper's convention: one FLOP per math.h call", total),
            ("fabs, fmin, fmax and floor not counted", total - simple),
            ("degrees to radians not counted (three products a rotation)", total - radians),
            ("comparisons of the source counted too", total + one["by_class"]["compare"]),
        ]
        if steps := functions.get("sdf_mandelbulb", {}).get("parts", {}).get("step"):
            per_lane = {(c.function, c.part): c.per_lane for c in declared_costs}
            keys = [("sdf_mandelbulb", "step"), ("sdf_mandelbulb", "off_axis")]
            keys += [("vec_add", "call"), ("vec_dot", "call")]  # what a step calls
            step = sum(sum(per_lane[key].values()) - per_lane[key]["compare"] for key in keys)
            bulbs = functions["sdf_mandelbulb"]["calls"]
            shapes = registry.find_scene(one["scene"]).data["shapes"]
            most = max(shape.get("iterations", 0) for shape in shapes)
            found.append(
                (
                    f"every evaluation taken to run all {most} iterations",
                    total + (most * bulbs - steps) * step,
                )
            )
        for rule, flop in found:
            made.append(
                {
                    "scene": one["scene"],
                    "rule": rule,
                    "gflop": flop / 1e9,
                    "flop_per_evaluation": flop / evaluations(one),
                    "paper_gflop": theirs / 1e9,
                    "difference": flop / theirs - 1,
                }
            )
    return made
