"""What a test needs of the machine, else it is left out by name."""

from __future__ import annotations

import pytest

from study.core import registry


def cpu_for(phase: str) -> None:
    """Leaves the test out where the CPU lacks what the phase needs."""
    if lacking := registry.missing_isa(registry.find_phase(phase)):
        pytest.skip(f"the CPU lacks {', '.join(lacking)}, which {phase} needs")
