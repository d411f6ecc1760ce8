"""Where the time goes, and what bounds it."""

from __future__ import annotations

from study.bounds.schema import SCHEMAS
from study.core.registry import Spec, cpu_supports, ladder
from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.hotspots import chapter, command
from study.experiments.section import Section
from study.numbers.analysis import Data

SAMPLES, QUICK = "1500", "600"  # of a phase


def calls(study: Study) -> list[Call]:
    """Table 3 is about one step, structs to arrays, which the ladder's opt2 has among others."""
    scenes = study.scenes if study.depth == "full" else study.scenes[:1]
    samples = QUICK if study.quick else SAMPLES
    fast = [] if study.depth == "full" else ["--samples", samples]
    fast += ["-n", "120"] if study.quick else []
    arrays = ["opt1+arrays"] if "opt1" in ladder() else []
    names = [*ladder(), *arrays]
    if study.quick:
        first, *_, last = cuts.three()
        names = [first, *(["opt1"] if arrays else []), *arrays, last]
    names = [name for name in names if cpu_supports(Spec.parse(name))]
    words = ["--phase", *names, "--scene", *scenes, *fast, "--run", str(study.run)]
    return [Call("hotspots", words, judges=False, may_lack=True)]


def section(data: Data) -> Section:
    name = data.context.cpu.microarchitecture
    return chapter.hot(data.path, name)


EXPERIMENT = Experiment(
    name="hotspots",
    what="hotspots, and a model of what bounds them",
    turn=40,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Baseline, opt1 with structs and with arrays and the last phase, on one scene at height 120.",
    command=command,
    sections=[(230, section)],
)
