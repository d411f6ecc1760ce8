"""The claims register: statements of the four papers that no sweep alone can check, held against what a run
has counted, profiled, compared with truth or timed on the side. Statements about a sweep: study.claims.

Each check takes (run folder, data, claim) and returns what was found here and a verdict. A file that is not
there is "not measured", never a verdict.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from study import ablations, flops, roof, show, store
from study.analysis import Data
from study.cli import StudyError
from study.verdicts import FAILS, HOLDS, NEVER, OPEN, PART

HEIGHT, VECTORS = 720, 20_000_000  # the papers' sizes: at a smaller one a statement holds in part at most
NEAR = 1.10  # a figure within 10 % of the stated one is taken to be it

Claim = dict[str, Any]
Found = tuple[str, str]  # what was found here, verdict


def read(path: Path) -> dict[str, Any]:
    """The JSON object in `path`, {} where there is no such file. Raises StudyError for what is none."""
    if not path.exists():
        return {}
    found = store.read_json(path)
    if not isinstance(found, dict):
        raise StudyError(f"{path}: must be a JSON object; make it again with the script that wrote it")
    return found


def known(value: Any) -> bool:
    """Whether it is a finite number: JSON's null is none."""
    return isinstance(value, (int, float)) and math.isfinite(value)


def sized(verdict: str, here: float, stated: float) -> str:
    """A statement that was not tried at the size it is about holds in part at most."""
    return PART if verdict == HOLDS and not here >= stated else verdict


def judged(here: float, stated: float) -> str:
    """Near the stated figure, or beyond it: holds. In part while it points the same way from 1."""
    if here >= stated / NEAR:
        return HOLDS
    return PART if here > 1 and stated > 1 else FAILS


def near(here: float, stated: float) -> str:
    """For figures that should be met and not beaten; NaN fails."""
    return HOLDS if stated / NEAR <= here <= stated * NEAR else FAILS


def _declared(data: Data) -> dict[tuple[str, str], dict[str, Any]]:
    """The largest counted picture of each (scene, phase)."""
    best: dict[tuple[str, str], dict[str, Any]] = {}
    for one in flops.read(data.path / "counts.json")[0]:
        key = one["scene"], one["phase"]
        if one["flags_from"] == one["phase"] and one["height"] >= best.get(key, one)["height"]:
            best[key] = one
    return best


def _count(one: dict[str, Any]) -> float:
    return one["flops"]["paper"]


def _flops(data: Data, claim: Claim) -> Found:
    one = _declared(data).get((claim["scene"], claim["phase"]))
    if one is None or one["height"] != 720:
        return "", OPEN
    giga = _count(one) / 1e9
    return f"{giga:.2f} GFLOP by the paper's convention", near(giga, claim["value"])


def _flop_cut(data: Data, claim: Claim) -> Found:
    made = _declared(data)
    one, base = (made.get((claim["scene"], claim[key])) for key in ("phase", "base"))
    if not one or not base or one["height"] != base["height"]:
        return "", OPEN
    cut = 100 * (1 - _count(one) / _count(base))
    verdict = near(cut, claim["value"])
    return f"{cut:.1f} % at n = {one['height']}", verdict if verdict == HOLDS else PART if cut > 0 else FAILS


def _flop_ratio(data: Data, claim: Claim) -> Found:
    made = _declared(data)
    one, base = (made.get((claim[key], claim["phase"])) for key in ("scene", "base"))
    if not one or not base or one["height"] != base["height"]:
        return "", OPEN
    ratio = _count(one) / _count(base)
    verdict = HOLDS if ratio > claim["value"] else PART if ratio > 1 else FAILS
    return f"{ratio:.2f}× as many at n = {one['height']}", verdict


def _points(data: Data) -> dict[tuple[str, str], dict[str, Any]]:
    found, limits, _ = roof.read(data.path, strict=False)
    table = roof.rows(data, found, limits)
    if table.empty:
        return {}
    rows = roof.headline(table).to_dict("records")
    return {(row["scene"], row["phase"]): row for row in rows}


def _more_flops_per_cycle(data: Data, claim: Claim) -> Found:
    points = _points(data)
    pairs = [
        (phase, row["flops_per_core_cycle"], points[claim["base"], phase]["flops_per_core_cycle"])
        for (scene, phase), row in points.items()
        if scene == claim["scene"] and (claim["base"], phase) in points
    ]
    if not pairs:
        return "", OPEN
    text = "; ".join(f"{phase} {a:.3g} against {b:.3g}" for phase, a, b in pairs)
    higher = sum(a > b for _, a, b in pairs)
    return text, HOLDS if higher == len(pairs) else PART if higher else FAILS


def _share_of_peak(data: Data, claim: Claim) -> Found:
    row = _points(data).get((claim["scene"], claim["phase"]), {})
    share = 100 * row.get("paper_convention_share_of_avx2_peak", math.nan)
    if not share > 0:
        return "", OPEN
    return f"{share:.1f} % (the paper's convention)", judged(share, claim["value"])


def _share_falls(data: Data, claim: Claim) -> Found:
    points = _points(data)
    one, base = (points.get((claim["scene"], claim[key]), {}) for key in ("phase", "base"))
    shares = [100 * row.get("paper_convention_share_of_avx2_peak", math.nan) for row in (base, one)]
    if not all(share > 0 for share in shares):
        return "", OPEN
    text = f"from {shares[0]:.1f} % to {shares[1]:.1f} %, of the roof of its own precision"
    return text, HOLDS if shares[1] < shares[0] else FAILS


def _ablation(data: Data, claim: Claim) -> Found:
    rows = ablations.read(data.path / "ablations.json")["rows"]
    for row in rows:
        if (row["ablation"], row["scene"]) == (claim["phase"], claim["scene"]):
            gain = show.interval(
                {"g": row["gain"]["value"], "g_low": row["gain"]["low"], "g_high": row["gain"]["high"]},
                "g",
                3,
                "×",
            )
            psnr = row["psnr_db"]
            picture = "not finite" if row["non_finite"] else "identical picture"  # JSON's null is either
            picture = picture if psnr is None else f"{psnr:.1f} dB to baseline"
            return f"{gain}, {picture}", row["claim"] or OPEN
    return "", OPEN


def _hottest(data: Data, claim: Claim) -> Found:
    mine = set(claim["base"].split("|"))
    for profile in read(data.path / "hotspots.json").get("profiles", []):
        if (profile["scene"], profile["phase"], profile["variant"]) != (claim["scene"], "baseline", "calls"):
            continue
        shares = {one["function"].split(" ")[0]: one["share"] for one in profile["functions"]}
        together = sum(share for name, share in shares.items() if name in mine)
        rest = max((share, name) for name, share in shares.items() if name not in mine)
        text = f"{100 * together:.0f} % of the time together; next: {rest[1]}, {100 * rest[0]:.0f} %"
        return text, HOLDS if together > rest[0] else FAILS
    return "", OPEN


def _never_misses(data: Data, claim: Claim) -> Found:
    for row in read(data.path / "accuracy.json").get("rows", []):
        if (row["scene"], row["phase"]) == (claim["scene"], claim["phase"]):
            ppm, height = row["false_misses_ppm"], row["height"]
            if not known(ppm):
                return "no pixel of truth is proved", OPEN
            text = f"{ppm:.3g} ppm of the pixels missed at n = {height}, by proof"
            return text, sized(HOLDS, height, HEIGHT) if ppm == 0 else FAILS  # one miss refutes at any size
    return "", OPEN


def _compilers(data: Data, claim: Claim) -> Found:
    rows = read(data.path / "toolchains.json").get("rows", [])
    if not rows:
        return "", OPEN
    ms = {
        (row["compiler"], row["phase"], row["flags"]): row["ms"]["value"]
        for row in rows
        if row["scene"] == claim["scene"] and known((row["ms"] or {}).get("value"))
    }
    if not any(compiler == "icx" for compiler, _, _ in ms):
        return "no icx on this machine", NEVER
    pairs = [(ms.get(("gcc", *what)), t) for (compiler, *what), t in ms.items() if compiler == "icx"]
    gains = [gcc / icx for gcc, icx in pairs if gcc]
    if not gains:
        return "no program by icx has its like by gcc", OPEN
    faster = sum(gain > 1 for gain in gains)
    text = f"{min(gains):.2f} to {max(gains):.2f}× of gcc's speed; icx is faster in {faster} of {len(gains)}"
    text += " pairs of the same phase and flags"
    return text, HOLDS if faster == len(gains) else PART if faster else FAILS


def _normalize(data: Data, claim: Claim) -> Found:
    rows = read(data.path / "functions.json").get("normalise", [])
    mine = [row for row in rows if row["isa"] == "SSE" and row["name"].endswith("+ 1")]
    mine = [row for row in mine if known((row["speedup"] or {}).get("value"))]
    if not mine:
        return "", OPEN
    row = max(mine, key=lambda row: row["vectors"])
    here = row["speedup"]["value"]
    text = f"{here:.2f}× for {row['vectors']:,} vectors"
    return text, sized(judged(here, claim["value"]), row["vectors"], VECTORS)


def _later(data: Data, claim: Claim) -> Found:
    return "", NEVER


CHECKS: dict[str, Callable[[Data, Claim], Found]] = {
    "flops": _flops,
    "flop_cut": _flop_cut,
    "flop_ratio": _flop_ratio,
    "more_flops_per_cycle": _more_flops_per_cycle,
    "share_of_peak": _share_of_peak,
    "share_falls": _share_falls,
    "ablation": _ablation,
    "hottest": _hottest,
    "never_misses": _never_misses,
    "compilers": _compilers,
    "normalize": _normalize,
    "later": _later,
}
