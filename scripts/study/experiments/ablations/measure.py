"""What single steps gain: ablations (core.patches) timed and judged against what they are compared with.

A row is an ablation on a scene. `gain` is always the gain of the *step*: the time without it over the time
with it, whichever of the two is the patched phase. Errors are against the baseline, as everywhere, but of
ablations of a phase that is held to no tolerance against baseline (gate.left_to_truth): those are against the
phase itself. `change_…`: how far the patched phase's picture is from that of what it is compared with.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core import cli, patches, registry, run
from study.core.build import build, build_together
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.experiments.ablations import ideas
from study.experiments.ablations.schema import Row
from study.measuring.launches import milliseconds
from study.numbers import stats, verdicts
from study.numbers.schema import Interval
from study.pictures import gate, images
from study.pictures.gallery import Gallery, Size

ERRORS = ("psnr_db", "fraction_over_1_255", "max_abs", "mask_mismatch_ppm", "non_finite", "identical")
Case = tuple[Spec, str]  # a program and the name of a scene


@dataclass(frozen=True)
class Ablation:
    """One patch, or (`beside`) the phase that one wants timed next to it. See core.patches for its head."""

    spec: Spec
    against: Spec
    added: bool  # the patched phase has the step; else it lacks it
    what: str
    paper: str
    error: str | None  # why its picture need not be within a tolerance
    scenes: tuple[str, ...]  # where the step can matter; none named: everywhere
    idea: str | None = None  # of the phase, that the patch takes out (study.experiments.ablations.ideas)

    @property
    def reference(self) -> Spec:
        own = registry.find_phase(self.spec.phase.partition("+")[0])
        return self.against if gate.left_to_truth(own) else Spec.parse(registry.BASE)

    @property
    def claim(self) -> float | None:
        return verdicts.stated(self.paper)

    def holds(self, gain: stats.Interval, failed: Iterable[str]) -> str:
        """The paper's claim held against what was found, in the words of verdicts; "" for no claim."""
        verdict, _ = verdicts.held(self.paper, gain, failed)
        if verdict != verdicts.UNSURE:
            return verdict
        return verdicts.WITHIN if gain.sufficient else verdicts.FEW


def said(row: Row) -> str:
    """A row's claim; of a step that the paper gave up also why that holds: too wrong, no faster, or both."""
    if row.claim != verdicts.HOLDS or row.paper_value is not None:
        return row.claim
    why = ["too wrong"] * bool(row.paper.startswith("not satisfying") and row.failed)
    why += ["no faster"] * (row.gain.high is not None and row.gain.high <= verdicts.NO_GAIN)
    return f"{row.claim}: {' and '.join(why)}"


def _read(name: str, root: Path) -> list[Ablation]:
    head = patches.chain(name, root)[-1].head
    for scene in (scenes := tuple(head.get("scenes", "").split())):
        ideas.check_scene(scene, root)
    against, added, about = Spec.parse(head["against"]), head["direction"] == "added", head["paper"]
    optional = head.get("error"), scenes, head.get("idea")
    found = [Ablation(Spec.parse(name), against, added, head["what"], about, *optional)]
    if "beside" in head:
        other = Spec.parse(head["beside"])
        title = registry.find_phase(other.phase).title
        words = f"beside {name}: {title[:1].lower()}{title[1:]}"
        found.append(Ablation(other, against, True, words, "no figure of its own", None, scenes))
    return found


def find(
    names: Iterable[str] | None = None, root: Path = ROOT
) -> tuple[list[Ablation], dict[str, Exception]]:
    """Ablations by name (opt2+horizontal) or of whole phases (opt2), None: all; and what cannot be read.
    Raises StudyError for a name that is neither, with the nearest ones."""
    wanted: list[str] = []
    for name in names if names is not None else registry.phases(root):
        phase, _, title = name.partition("+")
        registry.find_phase(phase, root)
        known = patches.titles(phase, root)
        if title and title not in known:
            registry.find_phase(name, root)  # says what is near
        wanted += [name] if title else [f"{phase}+{each}" for each in known]
    found: list[Ablation] = []
    broken: dict[str, Exception] = {}
    for name in dict.fromkeys(wanted):
        try:
            found += _read(name, root)
        except (StudyError, patches.PatchError) as error:
            broken[name] = error
    return found, broken


def build_all(specs: Sequence[Spec], jobs: int) -> dict[Spec, StudyError]:
    """Builds everything, `jobs` programs at a time. Returns what cannot be built."""
    build_together([(spec, "render") for spec in specs], jobs)
    failed = {}
    for spec in specs:
        try:
            build(spec)
        except StudyError as error:
            failed[spec] = error
    return failed


def timed(cases: Sequence[Case], height: int, launches: int, seed: int, cpu: int) -> dict[Case, list[float]]:
    """Milliseconds of one frame per process launch, every case once a round in random order."""

    def once(case: Case, padding: int) -> float:
        scene = ideas.find_scene(case[1])
        return milliseconds(case[0], scene, scene.size(height), 1, padding, cpu=cpu, warmup=0)

    return run.interleaved(cases, launches, seed, cpu, once)


def error_of(gallery: Gallery, reference: Spec, spec: Spec, scene: Scene, size: Size) -> dict[str, Any]:
    """Metrics of the picture against another's; a fractal's anti-aliased ones from the same picture."""
    a, b = (images.read(gallery.path(who, scene, size)) for who in (reference, spec))
    return images.compare(a, b, (a, b) if scene.fractal else None)


def judge(ablation: Ablation, scene: Scene, metrics: dict[str, Any]) -> tuple[str, dict[str, str]]:
    """identical, within, approximate or OUTSIDE; and the metrics outside the tolerance, with why. What
    declares an error may have one, but no sample that is not finite."""
    declared = gate.tolerance(registry.find_phase(ablation.spec.phase), scene)
    failed = gate.failures(metrics, declared)
    if failed and ablation.error and not {"non_finite", "antialiased.non_finite"} & failed.keys():
        return "approximate", failed
    if failed:
        return "OUTSIDE", failed
    return ("identical" if metrics["identical"] else "within"), {}


def row_of(
    ablation: Ablation,
    scene: Scene,
    size: Size,
    times: dict[Case, list[float]],
    metrics: dict[tuple[Spec, Case], dict[str, Any]],
) -> Row:
    mine, base = (ablation.spec, scene.name), (ablation.against, scene.name)
    without, with_it = (base, mine) if ablation.added else (mine, base)
    gain = stats.ratio_interval(times[without], times[with_it])
    cases = (ablation.reference, mine), (ablation.reference, base), (ablation.against, mine)
    error, unpatched, moved = ({name: cli.plain(metrics[case][name]) for name in ERRORS} for case in cases)
    verdict, failed = judge(ablation, scene, metrics[ablation.reference, mine])
    return Row(
        ablation=str(ablation.spec),
        against=str(ablation.against),
        scene=scene.name,
        width=size[0],
        height=size[1],
        step="added" if ablation.added else "removed",
        what=ablation.what,
        paper=ablation.paper,
        paper_value=ablation.claim,
        gain=Interval.of(gain),
        claim=ablation.holds(gain, failed),
        ms=Interval.of(stats.median_interval(times[mine])),
        against_ms=Interval.of(stats.median_interval(times[base])),
        reference=str(ablation.reference),
        **error,
        against_psnr_db=unpatched["psnr_db"],
        change_psnr_db=moved["psnr_db"],
        change_max_abs=moved["max_abs"],
        idea=ablation.idea,
        lines=ideas.code_lines(str(ablation.spec)) if ablation.idea else None,
        verdict=verdict,
        failed=[f"{name}: {why}" for name, why in failed.items()],
        error=ablation.error,
    )
