"""The goals of frames a second."""

from __future__ import annotations

from collections.abc import Iterable

from study.core import show
from study.experiments import goal
from study.experiments.frames import measure as frames
from study.numbers.analysis import Data


def reached(data: Data) -> Iterable[goal.Goal]:
    result = frames.read(data.path / frames.FILE)
    rows, away = result["rows"], result.get("away", frames.AWAY_ONCE)
    for scene, hit in dict.fromkeys((r["scene"], r["hit"]) for r in rows):
        mine = [r for r in rows if (r["scene"], r["hit"]) == (scene, hit)]
        row = goal.best(mine, "phase", lambda r: goal.given(r["frames_per_s"]))
        found, by = (row["to_own"], " by the scene's own limits") if row["to_own"] else (row, "")
        error = f"{show.number(found['psnr_db'])} dB to {row['reference']}{by}" if found["psnr_db"] else ""
        yield goal.Goal(
            f"frames a second, {scene} {row['width']}×{row['n']}, all cores, hit distance {hit}"
            + (f", secondary rays {away} of it off" if hit == frames.HALF else ""),
            row["goal"], goal.given(row["frames_per_s"]), row["verdict"], row["phase"], "", error,
        )  # fmt: skip
