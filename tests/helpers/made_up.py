"""Results of experiments whose numbers are easy, for tests of tables and figures."""

from __future__ import annotations

from study.experiments.fixed import measure as fixed
from study.experiments.packets import measure as packets
from study.experiments.rods import measure as rods
from study.measuring import rays as packets_rays


def fixed_result() -> dict:
    one = {"ms": 4.0, "ms_low": 3.0, "ms_high": 5.0, "psnr_db": 50.0, "wrong_ppm": 400.0, "dt_p50": 1e-4}
    one |= {"dt_p99": 0.002, "cleared": 0.25, "wrongly_cleared_ppm": 100.0, "non_finite": 0}
    about = {"width": 320, "n": 180, "settings": "bits=20"}
    ratio = {"gain": 2.0, "gain_low": 1.0, "gain_high": 3.0}
    ratio |= {"over_float": 0.5, "over_float_low": 0.4, "over_float_high": 0.6}
    rows = [one | about | ratio | {"case": case, "phase": fixed.CASES[case][0]} for case in fixed.CASES]
    for row in rows:
        if row["phase"] == "fixed_float":
            row |= {"ms": 2.0, "ms_low": 1.9, "ms_high": 2.1, "psnr_db": None, "wrong_ppm": 0.0}
    sweep = [one | {"bits": b, "roots": r, "settings": ""} for b in fixed.BITS for r in ("article", "2", "3")]
    sweep.append({"bits": 28, "roots": "article", "settings": "", "refused": "a radius of 5: does not fit"})
    frames = {"p5": 10.0, "p50": 450.0, "p95": 600.0, "most": 700.0, "mean": 14.29 * 35}  # on one core
    moving = {"program": "lanes", "shadows": True, "phase": "fixed_simd", "threads": 1, "frames": 2}
    moving |= {"width": 1920, "n": 1080, "ms": frames, "update_ms": 0.01, "all_ms": [400.0, 600.3]}
    moving |= {"resumed_at": [], "core_ns_per_pixel": 14.29e6 * 35 / (1920 * 1080)}
    twice = moving | {"threads": 2, "ms": frames | {"mean": 100.0}, "resumed_at": [1]}
    twice |= {"core_ns_per_pixel": 200e6 / (1920 * 1080)}
    article = twice | {
        "program": "article",
        "phase": "fixed",
        "core_ns_per_pixel": 4 * moving["core_ns_per_pixel"],
    }
    bare = article | {"shadows": False, "core_ns_per_pixel": moving["core_ns_per_pixel"]}
    clearing = [one | about | {"clear": clear} for clear in fixed.CLEARS]
    large = {"ms": 60.0, "ms_low": 50.0, "ms_high": 70.0, "cleared": 0.65, "wrongly_cleared_ppm": 7.2}
    large |= {"width": 1920, "n": 1080, "against": "never", "lost_pixels": 15, "non_finite": 0}
    clearing += [large | {"clear": clear} for clear in fixed.CLEARS]
    return {"schema": 1, "article": fixed.ARTICLE, "rows": rows, "sweep": sweep, "clearing": clearing,
            "animation": [article, moving, twice, bare]}  # fmt: skip


def packets_result(embree: bool = True) -> dict:
    """A packets.json of one scene whose numbers are easy."""
    rate = {"mrays": 40.0, "mrays_low": 39.0, "mrays_high": 41.0}
    variants = [{"name": name, "lanes": 16, **rate} for name in packets.VARIANTS]
    rays = []
    for kind in packets_rays.KINDS:
        row = {"scene": "spheres40", "kind": kind, "rays": 1000, "variants": variants, "newton_dt_max": 1e-6}
        row |= {"embree": "Embree 3.13.5" if embree else "not compared: built without Embree"}
        for key, (mrays, ratio) in {
            "embree16": (20, 2.0),
            "embree1": (65, 0.6),
            "embree_stream": (30, 1.3),
        }.items():
            row[key] = rate | {"mrays": mrays} if embree else None
            ends = {"": ratio, "_low": ratio - 0.05, "_high": ratio + 0.05}
            row |= {f"{key}_ratio{end}": value if embree else None for end, value in ends.items()}
        row["agreement"] = {"compared": 1000, "other_shape": 0, "dt_max": 2e-6} if embree else None
        rays.append(row)
    timed = {"threads": 1, "ms": 2.0, "ms_low": 1.9, "ms_high": 2.1, "launches": [2.0]}
    timed |= {"gain": 4.0, "gain_low": 3.0, "gain_high": 5.0}
    rows = [
        {"phase": phase, "hit_distance": None, "target_db": 80, "psnr_db": 90.0, "wrong_ppm": 0.0}
        | {"non_finite": 0, "threads": [timed]}
        for phase in ("packets", "opt4", "opt8_streams")
    ]
    drawn = [{"scene": "spheres40", "width": 160, "n": 90, "rows": rows}]
    return {"schema": 1, "article": packets.ARTICLE, "goals": packets.GOALS, "rays": rays, "drawn": drawn}


def rods_result() -> dict:
    error = {f"{k}_ppm": 100 for k in ("false_hits", "false_misses", "wrong_shape")}
    error |= {
        "wrong_ppm": 300,
        "dt_p50": 0.001,
        "dt_p99": 0.01,
        "dt_p100": 0.1,
        "psnr_db": 30.0,
        "non_finite": 0,
    }
    one = {"ms": 100.0, "ms_low": 90.0, "ms_high": 110.0, "evaluations": 12.0, **error}
    own = {"scene": "two_spheres", "width": 800, "n": 800, "pixels": one, "fewer": 12.0}
    own |= {"rods": one | {"ms": 20.0, "evaluations": 1.0}, "gain": 5.0, "gain_low": 4.0, "gain_high": 6.0}
    trade = [
        {"down": d, "max_steps": c, "least": 1, "step": "whole", "evaluations": 1.0, **one}
        for d in rods.DOWN
        for c in rods.CAPS
    ]
    coarse = {"down": 16, "max_steps": 20, "least": 4, "step": "whole", **one, "evaluations": 0.1}
    trade.append(coarse | {"ms": 25.0, "ms_low": 24.0, "ms_high": 26.0})
    return {"schema": 1, "article": rods.ARTICLE, "own": own, "rows": [own], "trade": trade}
