"""The claims register: statements of the four papers that no sweep alone can check, held against what a run
has counted, profiled, compared with truth or timed on the side; of what other articles built too (CPU-RTRM,
integers, packets, rods). Statements about a sweep: claims.claims.

Each check takes (data, claim) and returns a verdicts.Found. A file that is not there is "not measured",
never a verdict.
"""

import math
import statistics
from collections.abc import Callable

from study.bounds import roof
from study.bounds.roof import Point
from study.claims import compilers
from study.claims.claim import Claim, known
from study.core import show
from study.counting import flops, paper_rule
from study.counting.schema import Declared
from study.experiments import experiment
from study.measuring import animations
from study.numbers import accuracy, stats, verdicts
from study.numbers.analysis import Data
from study.numbers.stats import Interval
from study.numbers.verdicts import FAILS, HOLDS, NEVER, PART, Found, figure, judged, missing, near, sized


def _declared(data: Data) -> dict[tuple[str, str], Declared]:
    """The largest picture of declared costs of each (scene, phase)."""
    best: dict[tuple[str, str], Declared] = {}
    for one in flops.read(data.path / "counts.json").declared:
        key = one.scene, one.phase
        if one.flops and one.flags_from == one.phase and one.height >= best.get(key, one).height:
            best[key] = one
    return best


def _entered(one: Declared) -> float:
    """FLOPs with iterations as they were entered."""
    return one.flops.paper if one.flops else math.nan


def _count(one: Declared) -> float:
    """FLOPs by the paper's rule; NaN for a phase that it says nothing of."""
    found = paper_rule.flop(one)
    return math.nan if found is None else found


def _flops(data: Data, claim: Claim) -> Found:
    one = _declared(data).get((claim.scene, claim.phase))
    if one is None or one.height != claim.n:
        return missing(f"count of {claim.phase} on {claim.scene} at n = {claim.n:.0f}")
    giga, entered = _count(one) / 1e9, _entered(one) / 1e9
    if math.isnan(giga):
        return Found(f"{entered:.2f} GFLOP as entered", NEVER, "the paper's rule says nothing of this phase")
    text = f"{giga:.2f} GFLOP by the paper's rule"
    text += f" ({entered:.2f} with iterations as entered)" if entered != giga else ""
    return Found(text, *near(giga, claim.value), value=giga, n=one.height)


def _pair(data: Data, one: tuple[str, str], base: tuple[str, str]) -> tuple[Declared, Declared] | None:
    """The counts of two (scene, phase), where they are of one height."""
    made = _declared(data)
    first, second = made.get(one), made.get(base)
    same = first and second and first.height == second.height
    return (
        (first, second)
        if first and second and same and not math.isnan(_count(first) + _count(second))
        else None
    )


def _flop_cut(data: Data, claim: Claim) -> Found:
    scene = claim.scene
    pair = _pair(data, (scene, claim.phase), (scene, claim.base))
    if not pair:
        return missing(f"counts of {claim.phase} and {claim.base} on {scene}")
    cut, n = 100 * (1 - _count(pair[0]) / _count(pair[1])), pair[0].height
    entered = 100 * (1 - _entered(pair[0]) / _entered(pair[1]))
    beside = f" ({entered:.1f} % with iterations as entered)" if entered != cut else ""
    verdict, why = near(cut, claim.value)
    if verdict == FAILS and cut > 0:
        verdict, why = PART, f"a cut, {why}"
    return sized(Found(f"{cut:.1f} % at n = {n}{beside}", verdict, why, cut, n=n), claim.n)


def _flop_ratio(data: Data, claim: Claim) -> Found:
    pair = _pair(data, (claim.scene, claim.phase), (claim.base, claim.phase))
    if not pair:
        return missing(f"counts of {claim.phase} on {claim.scene} and {claim.base}")
    ratio, stated, n = _count(pair[0]) / _count(pair[1]), claim.value, pair[0].height
    entered = _entered(pair[0]) / _entered(pair[1])
    beside = f" ({entered:.2f}× with iterations as entered)" if entered != ratio else ""
    if ratio > stated:
        verdict, why = HOLDS, f"more than {stated:g}"
    else:
        verdict, why = (PART, f"more, and not {stated:g}") if ratio > 1 else (FAILS, "no more")
    return sized(Found(f"{ratio:.2f}× as many at n = {n}{beside}", verdict, why, ratio, n=n), claim.n)


def _points(data: Data) -> dict[tuple[str, str], Point]:
    """Points of the roofline by scene and phase; kept with the run, for six claims ask for them."""
    if "points" not in data.kept:
        found, limits, _ = roof.read(data.path, strict=False)
        points = roof.headline(roof.points(data, found, limits))
        data.kept["points"] = {(one.scene, one.phase): one for one in points}
    return data.kept["points"]


UNKNOWN = "this CPU's theoretical peak is not known"


def _flops_gain(data: Data, claim: Claim) -> Found:
    """FLOPs per core cycle by the paper's rule, `phase` over `base`, at the largest size of both."""
    points = _points(data)
    one, base = (points.get((claim.scene, getattr(claim, key))) for key in ("phase", "base"))
    if not one or not base or one.height != base.height:
        return missing(f"count of {claim.phase} and {claim.base} beside their times")
    cells = [data.cell(claim.scene, r.phase, r.height, r.width) for r in (base, one)]
    ratio = stats.ratio_interval(*(cell.values["core_cycles"] for cell in cells if cell))
    more = one.paper_rule_flops / base.paper_rule_flops
    if not more > 0:
        return missing(f"count of {claim.phase} and {claim.base} by the paper's rule")
    ends = [more * x for x in (ratio.value, ratio.low, ratio.high)]
    gain = Interval(*ends, ratio.launches, ratio.sufficient)
    rates = [point.paper_rule_flops_per_core_cycle for point in (one, base)]
    text = f"{rates[0]:.3g} over {rates[1]:.3g} flop/core cycle at n = {one.height}: "
    text += f"{gain.text().replace(' ', '× ', 1)}, with {more:.3g}× the FLOPs"
    return sized(figure(gain, text, *judged(gain.value, claim.value), one.height), claim.n)


def _more_flops_per_cycle(data: Data, claim: Claim) -> Found:
    points = _points(data)
    both = [
        (phase, row, points[claim.base, phase])
        for (scene, phase), row in points.items()
        if scene == claim.scene and (claim.base, phase) in points
    ]
    speeds = [(phase, a.flops_per_core_cycle, b.flops_per_core_cycle, a.height) for phase, a, b in both]
    pairs = [one for one in speeds if one[1] > 0 and one[2] > 0]
    if not pairs:
        return missing("count of what was timed")
    text = "; ".join(f"{phase} {a:.3g} against {b:.3g}" for phase, a, b, _ in pairs)
    higher, least = sum(a > b for _, a, b, _ in pairs), min(a / b for _, a, b, _ in pairs)
    verdict = HOLDS if higher == len(pairs) else PART if higher else FAILS
    n = min(height for *_, height in pairs)
    why = f"more in {higher} of {len(pairs)} phases"
    return sized(Found(f"{text} flop/core cycle", verdict, why, least, n=n), claim.n)


def _peak(point: Point | None, theoretical: bool) -> float:
    """Percent of the AVX2 peak by the ports, or of the measured roof; NaN where that is not known."""
    if point is None:
        return math.nan
    of = point.paper_rule_share_of_avx2_peak if theoretical else point.paper_rule_share_of_avx2_roof
    return 100 * of


def _share_of_peak(data: Data, claim: Claim) -> Found:
    row = _points(data).get((claim.scene, claim.phase))
    known, measured = _peak(row, True), _peak(row, False)
    share = known if known > 0 else measured
    if row is None or not share > 0:
        return missing(f"ceilings, or count of {claim.phase} on {claim.scene}")
    verdict, why = judged(share, claim.value)
    text = f"{known:.1f} % of what its ports allow" if known > 0 else UNKNOWN
    text += f"; {measured:.1f} % of the measured roof" if measured > 0 else ""
    return sized(Found(f"{text} (the paper's rule)", verdict, why, share, n=row.height), claim.n)


def _share_falls(data: Data, claim: Claim) -> Found:
    points = _points(data)
    rows = [points.get((claim.scene, getattr(claim, key))) for key in ("base", "phase")]
    known, measured = ([_peak(row, theoretical) for row in rows] for theoretical in (True, False))
    shares = known if all(share > 0 for share in known) else measured
    if not all(share > 0 for share in shares):
        return missing(f"ceilings, or counts of {claim.phase} and {claim.base}")
    said = (
        f"from {known[0]:.1f} % to {known[1]:.1f} % of what its ports allow" if shares is known else UNKNOWN
    )
    if all(share > 0 for share in measured):
        said += f"; from {measured[0]:.1f} % to {measured[1]:.1f} % of the measured roof"
    text = f"{said}, of its own precision"
    verdict, why = (HOLDS, "it decreases") if shares[1] < shares[0] else (FAILS, "it does not decrease")
    n = min(row.height for row in rows if row)
    return sized(Found(text, verdict, why, shares[1] / shares[0], n=n), claim.n)


def _ablation(data: Data, claim: Claim) -> Found:
    result = experiment.load(data.path, "ablations.json")
    for row in result.rows if result else ():
        if (row.ablation, row.scene) != (claim.phase, claim.scene):
            continue
        gain = Interval(*row.gain.ends, row.gain.launches, row.gain.sufficient)
        picture = "not finite" if row.non_finite else "identical picture"  # JSON's null is either
        picture = picture if row.psnr_db is None else f"{row.psnr_db:.1f} dB to baseline"
        text = f"{gain.text().replace(' ', '× ', 1)}, {picture}"
        verdict, why = verdicts.held(row.paper, gain, row.failed)
        if not verdict:
            return Found(text, NEVER, "the step's patch states no claim of the paper's")
        return sized(figure(gain, text, verdict, why, row.height), claim.n)
    return missing(f"ablation {claim.phase} on {claim.scene}")


def _hottest(data: Data, claim: Claim) -> Found:
    mine = set(claim.base.split("|"))
    result = experiment.load(data.path, "hotspots.json")
    for profile in result.profiles if result else ():
        if (profile.scene, profile.phase, profile.variant) != (claim.scene, "baseline", "calls"):
            continue
        shares = {one.function.split(" ")[0]: one.share for one in profile.functions}
        together = sum(share for name, share in shares.items() if name in mine)
        rest = max((share, name) for name, share in shares.items() if name not in mine)
        text = f"{100 * together:.0f} % of the time together; next: {rest[1]}, {100 * rest[0]:.0f} %"
        verdict = HOLDS if together > rest[0] else FAILS
        why = f"{'more' if verdict == HOLDS else 'no more'} than the next"
        return sized(Found(text, verdict, why, 100 * together, n=profile.height), claim.n)
    return missing(f"profile of baseline on {claim.scene}, without inlining")


def _never_misses(data: Data, claim: Claim) -> Found:
    for row in accuracy.rows(data.path):
        if (row.scene, row.phase) == (claim.scene, claim.phase):
            ppm, height = row.false_misses_ppm, row.height
            if not math.isfinite(ppm):
                return missing("pixel that truth proves")
            text = f"{ppm:.3g} ppm of the pixels missed at n = {height}, by proof"
            verdict, why = (HOLDS, "none is missed") if ppm == 0 else (FAILS, "one miss refutes at any size")
            return sized(Found(text, verdict, why, ppm, n=height), claim.n)
    return missing(f"accuracy of {claim.phase} on {claim.scene}")


def _normalize(data: Data, claim: Claim) -> Found:
    result = experiment.load(data.path, "functions.json")
    rows = result.normalise if result else []
    mine = [r for r in rows if r.isa == "SSE" and r.name.endswith("+ 1") and r.speedup.value is not None]
    if not mine:
        return missing("functions.json")
    row = max(mine, key=lambda row: row.vectors)
    gain = row.speedup
    text = f"{gain.value:.2f}× for {row.vectors:,} vectors"
    verdict, why = judged(gain.value, claim.value)
    ends = map(known, (gain.low, gain.high))
    found = verdicts.timed(Found(text, verdict, why, gain.value, *ends, row.vectors))
    return sized(found, claim.n, unit="vectors = ")


def _rtrm(data: Data, claim: Claim) -> Found:
    """Stands beside figures of another machine: that decides nothing. The figure is of the claim's phase;
    without a time of it the fastest one's stands in the words alone."""
    result = experiment.load(data.path, "lattice.json")
    fastest = result.best(2) if result else None
    if result is None or fastest is None:
        return missing("time of scene lattice on two threads")
    other = f"{fastest.phase} {fastest.program:.2f}×"
    named = [r for r in result.rows if (r.phase, r.threads) == (claim.phase, 2) and r.program]
    if not named:
        text = f"{other} its figure of another machine; no time of {claim.phase} on two threads"
        return Found(text, NEVER, claim.note, n=fastest.n)
    one = named[0]
    text = f"{one.program:.2f}× its figure of another machine; {other}"
    ends = map(known, (one.program_low, one.program_high))
    return Found(text, NEVER, claim.note, one.program, *ends, one.n)


def _integers(data: Data, claim: Claim) -> Found:
    """Stands beside figures of 35 cores of another CPU: that decides nothing. Fewer frames than the article's
    are another stretch of the animation, whose frames drift: no ratio then."""
    result = experiment.load(data.path, "fixed.json")
    mine = [r for r in result.animation if (r.phase, r.n) == (claim.phase, claim.n)] if result else []
    mine = [r for r in mine if r.shadows]
    if not result or not mine:
        return missing(f"frames of {claim.scene} at n = {claim.n:.0f}")
    said = result.article
    one = max(mine, key=lambda row: (row.frames == said.frames, row.threads))
    cores = f"{one.threads} thread{'s' * (one.threads > 1)}"
    ratio = animations.per_article(one, said)
    if ratio is not None:
        beside = f"{show.number(ratio)}× its pixels per core and second"
    else:
        beside = f"{one.frames} frames of {one.width}×{one.n}, no ratio"
    text = f"{one.ms.mean:.1f} ms on {cores}: {beside}"
    text += f" (5 to 95 % of its frames: {one.ms.p5:.1f} to {one.ms.p95:.1f} ms)"
    return Found(text, NEVER, claim.note, one.ms.mean, n=one.n)  # of one process: no interval


def _linear(data: Data, claim: Claim) -> Found:
    """The gain of the most threads over one, per thread, of the longest frame: waking is no work."""
    made: list[tuple[float, Interval, str, int]] = []
    result = experiment.load(data.path, "packets.json")
    for drawn in result.drawn if result else ():
        by = {t.threads: t.launches or [] for r in drawn.rows if r.phase == claim.phase for t in r.threads}
        if len(by) > 1 and 1 in by:
            most = max(by)
            gain = stats.ratio_interval(by[1], by[most])
            share = Interval(
                gain.value / most, gain.low / most, gain.high / most, gain.launches, gain.sufficient
            )
            longest = statistics.median(by[1])
            what = f"{drawn.scene} at n = {drawn.n} ({longest:.2g} ms)"
            text = f"{gain.value:.2f}× on {most} threads, {what}"
            made.append((longest, share, text, drawn.n))
    if not made:
        return missing(f"time of {claim.phase} on several threads")
    _, share, text, n = max(made, key=lambda one: one[0])
    verdict, why = verdicts.reached(share, claim.value / verdicts.NEAR)
    if verdict == FAILS and share.low > 0.5 * claim.value:
        verdict, why = PART, f"more than half of linear; {why}"
    return figure(share, text, verdict, why, n)


def _rods_fewer(data: Data, claim: Claim) -> Found:
    if not (result := experiment.load(data.path, "rods.json")):
        return missing("rods.json")
    own = result.own
    counts = [one.evaluations for one in (own.pixels, own.rods)]
    text = f"{counts[0]:.3g} evaluations a pixel against {counts[1]:.3g}: {own.fewer:.3g}×"
    verdict, why = judged(own.fewer, claim.value)
    return sized(Found(text, verdict, why, own.fewer, n=own.n), claim.n)


def _rods_gain(data: Data, claim: Claim) -> Found:
    if not (result := experiment.load(data.path, "rods.json")):
        return missing("rods.json")
    own = result.own
    text = f"{own.gain:.2f}×: {own.pixels.ms:.3g} ms per pixel, {own.rods.ms:.3g} ms by rods"
    verdict, why = judged(own.gain, claim.value)
    ends = map(known, (own.gain_low, own.gain_high))
    return sized(verdicts.timed(Found(text, verdict, why, own.gain, *ends, own.n)), claim.n)


_PLAIN = (
    *(_flops, _flop_cut, _flop_ratio, _flops_gain, _more_flops_per_cycle, _share_of_peak, _share_falls),
    *(_ablation, _hottest, _never_misses, _normalize, _rtrm, _integers, _linear, _rods_fewer, _rods_gain),
)
CHECKS: dict[str, Callable[[Data, Claim], Found]] = {
    "compilers": compilers.slightly_better,
    "best_compiler": compilers.best,
    **{check.__name__.lstrip("_"): check for check in _PLAIN},
}
