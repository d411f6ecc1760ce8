"""Scenes of both classes, and phases of any tolerance, for the tests of the gate."""

from __future__ import annotations

import msgspec

from study.core import registry
from study.core.registry import ROOT, Phase, Scene

SMOOTH = Scene("trio", ROOT / "common/scenes/trio.json", {}, False)
FRACTAL = Scene("mandelbulb", ROOT / "common/scenes/mandelbulb.json", {}, True)


def phase(tolerance: dict, name: str = "opt9", isa: tuple[str, ...] = ()) -> Phase:
    return msgspec.structs.replace(registry.find_phase("opt1"), name=name, tolerance=tolerance, isa=list(isa))


def bound(reason: str = "measured", **bounds: object) -> dict:
    return {**bounds, "reason": reason}
