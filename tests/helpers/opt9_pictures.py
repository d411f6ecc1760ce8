"""Pictures of opt9_convex and of those that it is held against, at 107 × 61."""

from __future__ import annotations

from pathlib import Path

import phase_pictures

from study.pictures import images

PHASE = "opt9_convex"
needs_opt9 = phase_pictures.needs(PHASE)


def picture(
    whole: str | dict, folder: Path, *options: str, lanes: str = "", phase: str = PHASE
) -> images.Picture:
    return phase_pictures.picture(phase, whole, folder, *options, STEPWISE_ISA_LIMIT=lanes)


def looks(position: list[float], at: list[float]) -> dict:
    return {"position": position, "look_at": at, "vertical_fov_degrees": 60}
