"""No phase may write NaN, hang or crash on any hard case. How wrong it is: scripts/stepwise stability."""

import zlib

import pytest

from builds import BY_CLANG
from study.core import registry
from study.experiments.stability import cases as hard
from study.experiments.stability.cases import measure

pytestmark = pytest.mark.slow

PHASES = [name for name, phase in registry.phases().items() if phase.family == measure.FAMILY]
# The case that compares compilers builds its phase twice more: of each kind of phase one is asked.
PAIRS = [
    pytest.param(phase, case, id=f"{phase}-c{case.number:02}_{case.name}")
    for phase in PHASES
    for case in hard.cases()
    if case.name != "contraction" or phase in BY_CLANG
]


@pytest.mark.parametrize(("phase", "case"), PAIRS)
def test_no_phase_breaks(phase: str, case: hard.Case) -> None:
    """At the hardest strength, and at the easiest or the middle one."""
    if lacking := registry.missing_isa(registry.phases()[phase]):
        pytest.skip(f"this CPU lacks {', '.join(lacking)}, which {phase} needs")
    *others, hardest = case.few()
    strengths = [*others[zlib.crc32(f"{phase} {case.name}".encode()) % 2 :][:1], hardest]
    points = [measure.measure_point(hard.Phase(phase), case, strength) for strength in strengths]
    row = measure.row(phase, case, points)
    again = f"scripts/stepwise stability --phase {phase} --case {case.number}"
    assert not measure.breaks([row]), "\n".join([*measure.breaks([row]), again])
    assert len(row.errors) == len(strengths)
