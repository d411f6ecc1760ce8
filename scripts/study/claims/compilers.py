"""The paper's sentence on ICC and GCC, held against toolchains.json: icx stands for ICC."""

import math
from typing import Any

from study.claims.claim import Claim, known
from study.experiments import experiment
from study.numbers.analysis import Data
from study.numbers.verdicts import FAILS, HOLDS, NEVER, PART, UNSURE, Found, missing, sized

ICC = "icx"
Timed = dict[tuple[str, str, str], Any]  # (compiler, phase, flags) → the row


def _timed(data: Data, scene: str) -> tuple[Timed, int | None]:
    result = experiment.load(data.path, "toolchains.json")
    mine = [r for r in result.rows if r.scene == scene and math.isfinite(known(r.ms.value))] if result else []
    return {(r.compiler, r.phase, r.flags): r for r in mine}, min((r.n for r in mine if r.n), default=None)


def _fastest(timed: Timed, compiler: str) -> Any:
    mine = [row for (name, *_), row in timed.items() if name == compiler]
    return min(mine, key=lambda row: row.ms.value, default=None)


def _named(row: Any) -> str:
    return f"{row.ms.value:.3g} ms ({row.phase}, {row.flags})"


def _without(timed: Timed, n: int | None) -> Found:
    """No ICC: nothing of the sentence can be tested; what the others did stands beside that."""
    names = dict.fromkeys(name for name, *_ in timed)
    best = [(name, _fastest(timed, name)) for name in names]
    text = "; ".join(f"fastest by {name}: {_named(row)}" for name, row in best)
    text += f", at n = {n}" if n else ""
    why = f"there is no {ICC} on this machine: {' and '.join(names)} alone were timed"
    return Found(text, NEVER, why, n=n)


def slightly_better(data: Data, claim: Claim) -> Found:
    """ICC is faster than gcc: pairs of the same phase and flags."""
    timed, n = _timed(data, claim.scene)
    if not timed:
        return missing(f"toolchains.json with {claim.scene}")
    if not any(name == ICC for name, *_ in timed):
        return _without(timed, n)
    pairs = [(timed.get(("gcc", *what)), row) for (name, *what), row in timed.items() if name == ICC]
    gains = [gcc.ms.value / row.ms.value for gcc, row in pairs if gcc]
    if not gains:
        return missing(f"program by {ICC} with its like by gcc")
    faster = sum(gain > 1 for gain in gains)
    text = f"{min(gains):.2f} to {max(gains):.2f}× of gcc's speed"
    why = f"{ICC} is faster in {faster} of {len(gains)} pairs of the same phase and flags"
    verdict = HOLDS if faster == len(gains) else PART if faster else FAILS
    return sized(Found(text, verdict, why, min(gains), n=n), claim.n)


def best(data: Data, claim: Claim) -> Found:
    """The fastest program of all is gcc's: gcc's against ICC's, whatever their phases and flags."""
    timed, n = _timed(data, claim.scene)
    if not timed:
        return missing(f"toolchains.json with {claim.scene}")
    gcc, icc = _fastest(timed, "gcc"), _fastest(timed, ICC)
    if not icc:
        return _without(timed, n)
    if not gcc:
        return missing("program by gcc")
    gain = icc.ms.value / gcc.ms.value
    low, high, icc_low, icc_high = map(known, (gcc.ms.low, gcc.ms.high, icc.ms.low, icc.ms.high))
    text = f"fastest by gcc: {_named(gcc)}; by {ICC}: {_named(icc)}"
    if high < icc_low:
        verdict, why = HOLDS, "gcc's is the faster, the intervals are apart"
    elif icc_high < low:
        verdict, why = FAILS, f"{ICC}'s is the faster, the intervals are apart"
    else:
        verdict, why = UNSURE, "the intervals overlap, or there is none"
    return sized(Found(text, verdict, why, gain, n=n), claim.n)
