"""The studied paper's numbers (results/paper/*.csv) and what follows from them by arithmetic alone."""

import math
from pathlib import Path

import pandas as pd

from study.core.cli import StudyError
from study.core.registry import ROOT

FOLDER = ROOT / "results" / "paper"
PHASES = ("baseline", "opt1", "opt2", "opt3", "opt4")
PIXELS = 1280 * 720  # of Table 1


def read(name: str, folder: Path = FOLDER) -> pd.DataFrame:
    """One CSV of the paper's numbers, empty cells as NaN. Raises StudyError if it cannot be read."""
    try:
        return pd.read_csv(folder / f"{name}.csv")
    except (OSError, ValueError) as error:
        raise StudyError(f"{folder / name}.csv: {getattr(error, 'strerror', None) or error}") from None


def ladder(folder: Path = FOLDER) -> pd.DataFrame:
    """Per scene and phase of the paper: speed-ups over its baseline from three sources, and errors.

    Columns: scene, phase, cycles_per_pixel (FLOPs / (flops/cycle), i7-7700 at 3.6 GHz), implied (the
    ratio of those), stated (in the text), rerun (the authors' own program, run again), and that
    program's rerun_tsc_cycles_per_pixel (at 2.596 GHz), rerun_psnr_display_db (infinite: identical),
    rerun_psnr_db (of linear values, opt4's alone) and rerun_over_display (share of pixels).
    """
    table = read("performance", folder).set_index(["metric", "scene", "phase"]).value
    stated = read("speedups", folder).query("base == 'baseline' and step == 'whole ladder'")
    stated = stated.set_index(["scene", "phase"]).value
    rerun = read("rerun", folder).set_index(["metric", "scene", "phase"]).value
    rows = []
    for scene in dict.fromkeys(table.loc["flop_count"].index.get_level_values("scene")):
        for phase in PHASES:
            # The paper gives one cut, by opt1; later phases are taken to keep it.
            left = 1 - (0 if phase == "baseline" else table["flop_cut", scene, "opt1"] / 100)
            flops = table["flop_count", scene, "baseline"] * left
            cycles = flops / table["performance", scene, phase]
            base = table["flop_count", scene, "baseline"] / table["performance", scene, "baseline"]
            rows.append(
                {
                    "scene": scene,
                    "phase": phase,
                    "cycles_per_pixel": cycles / PIXELS,
                    "implied": base / cycles,
                    "stated": stated.get((scene, phase)),
                    "rerun": rerun.get(("speedup", scene, phase)),
                    "rerun_tsc_cycles_per_pixel": rerun["tsc_cycles", scene, phase] / PIXELS,
                    "rerun_psnr_display_db": math.inf
                    if ("identical", scene, phase) in rerun
                    else rerun.get(("psnr_display_db", scene, phase)),
                    "rerun_psnr_db": rerun.get(("psnr_db", scene, phase)),
                    "rerun_over_display": rerun.get(("fraction_over_1_255_display", scene, phase)),
                }
            )
    return pd.DataFrame(rows)
