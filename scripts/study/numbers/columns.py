"""Columns of the ladder: speed and error, the paper beside, the first frame, how each phase was built."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from study.core import show
from study.core.show import NOTHING, Column, Row, cell, gone, interval, number, plain, whole, word
from study.numbers.analysis import GENERATED, SIMDE

TO_TRUTH = "to ground truth"  # in a head: this column is of accuracy.json
TO_BASE = "against baseline"  # of verify.json


def _phase(row: Row) -> str:
    """Its name; where it generates code for scenes, whether general code ran or was counted in its place."""
    kernel = cell(row, "kernel")
    general = isinstance(kernel, str) and kernel != GENERATED
    simde = " (SIMDe)" if SIMDE in str(cell(row, "isa")) else ""
    return word("phase")(row) + (" (general code)" if general else "") + simde


def _code(row: Row) -> str:
    kernel = cell(row, "kernel")
    return NOTHING if not isinstance(kernel, str) else "for the scene" if kernel == GENERATED else kernel


def _load(row: Row) -> str:
    """The clock under load in GHz; a scalar phase has none (0)."""
    return plain("core_hz_load", 4, 1e9)(row) if show.yes(cell(row, "core_hz_load")) else NOTHING


def _known(name: str, digits: int = 3, unit: str = "") -> Callable[[Row], str]:
    return lambda row: NOTHING if gone(cell(row, name)) else interval(row, name, digits, unit)


def _fractal_depth(row: Row) -> str:
    """Only where single samples are chaotic, so that depth is what can be judged."""
    averaged = cell(row, "antialiased_fraction_over_1_255")
    return NOTHING if gone(averaged) else show.share(cell(row, "depth_agree_fraction"))


def _psnr(name: str) -> Callable[[Row], str]:
    return lambda row: show.psnr(row, name)


def _part(name: str) -> Callable[[Row], str]:
    return lambda row: show.percent(cell(row, name))


def _times(name: str) -> Callable[[Row], str]:
    return lambda row: show.times(cell(row, name))


def _pictures() -> list[Column]:
    group = f"error {TO_BASE}"
    return [
        Column(group, "PSNR linear, dB", _psnr("psnr_db")),
        Column(group, "PSNR display, dB", _psnr("psnr_display_db")),
        Column(group, "pixels off > 1/255, linear", _part("fraction_over_1_255")),
        Column(group, "display", _part("fraction_over_1_255_display")),
        Column(group, "4×4 averaged PSNR, dB", _psnr("antialiased_psnr_db")),
    ]


def _truth_psnr(name: str) -> Callable[[Row], str]:
    """PSNR in dB. Of a fractal it is of averaged pictures, and to a march but for its exact surface."""
    of = "4×4" if name == "truth_surface_db" else "4×4, march"

    def text(row: Row) -> str:
        found = number(cell(row, name))
        return found if found == NOTHING or not cell(row, "truth_converged_only") else f"{found} ({of})"

    return text


def truth_height(rows: Sequence[Row]) -> str:
    """“ at n = 180”: how high the pictures held against truth were; "" where none was."""
    return _height(rows, "truth_height")


def _height(rows: Sequence[Row], key: str) -> str:
    heights = sorted({int(at) for row in rows if not gone(at := cell(row, key))})
    return f" at n = {' and '.join(map(str, heights))}" if heights else ""


def sized(shown: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    """The columns, with the height of the pictures in the heads (or their group's) of those to ground truth
    and against baseline: it may be another than that of the time beside them."""
    found: list[Column] = []
    for of, key in ((TO_TRUTH, "truth_height"), (TO_BASE, "error_height")):
        at = of + _height(rows, key)
        heads = [(one.group.replace(of, at), one.name.replace(of, at)) for one in found or shown]
        found = [replace(c, group=g, name=n) for c, (g, n) in zip(found or shown, heads, strict=True)]
    return found


def _frames(row: Row) -> str:
    """Timed ones; a long frame is timed alone and unwarmed, so that it is the process's first."""
    return whole("frames_a_launch")(row) + (" (no warm-up)" if cell(row, "unwarmed") else "")


def _over_one_thread(row: Row) -> str:
    return NOTHING if cell(row, "threads") == 1 else interval(row, "over_one_thread", 3, "×")


STEADY, TRUE, BELOW = "time of a steady frame", f"error {TO_TRUTH}", "error below the picture"
OVER_BASE, OVER_OPT2 = (
    show.speedup("speedup", "speedup_base"),
    show.speedup("speedup_same_flags", "same_flags_base"),
)
LADDER = [
    Column("", "phase", _phase),
    Column("", "precision", word("precision")),
    Column("", "threads", whole("threads")),
    Column(STEADY, "ms [95\u00a0%]", lambda r: interval(r, "ms")),
    Column(STEADY, "frames a launch", _frames),
    Column(STEADY, "ns/pixel", plain("ns_per_pixel", 4)),
    Column("speed-up over", "baseline [95\u00a0%]", OVER_BASE),
    Column("speed-up over", "opt2, same flags [95\u00a0%]", OVER_OPT2),
    Column(f"error {TO_BASE}", "tolerance", show.gate, show.gate_mark),
    *_pictures(),
    Column(TRUE, "PSNR linear, dB", _truth_psnr("truth_psnr_db")),
    Column(TRUE, "ideal shadow, dB", _truth_psnr("truth_psnr_ideal_db")),
    Column(TRUE, "exact surface, dB", _truth_psnr("truth_surface_db")),
    Column(TRUE, "wrong hits, ppm", plain("truth_wrong_ppm")),
    Column(TRUE, "|Δt| 99\u00a0%", plain("truth_dt_p99", 2)),
    Column(BELOW, "hit mask, ppm", plain("mask_mismatch_ppm")),
    Column(BELOW, "|Δt| 99\u00a0%, scene units", plain("dt_p99", 2)),
    Column(BELOW, "depth agrees", _fractal_depth),
]
BESIDE = [
    Column("", "phase", _phase),
    Column("here, over baseline", "speed-up [95\u00a0%]", OVER_BASE),
    Column("here, over baseline", "PSNR display, dB", _psnr("psnr_display_db")),
    Column("the paper, over its baseline", "by its tables", _times("implied")),
    Column("the paper, over its baseline", "by its text", _times("stated")),
    Column("the paper, over its baseline", "its program, run again (PSNR display)", show.rerun),
]
WHOLE = [
    Column("", "phase", _phase),
    Column("", "threads", whole("threads")),
    Column("", "launches", whole("launches")),
    Column("first frame, ms", "set-up", plain("setup_ms")),
    Column("first frame, ms", "compiling, once (0: found in the cache)", plain("compile_ms")),
    Column("first frame, ms", "set-up + first frame [95\u00a0%]", lambda r: interval(r, "setup_first_ms")),
    Column("steady frame, ms", "render [95\u00a0%]", lambda r: interval(r, "ms")),
    Column("steady frame, ms", "present", plain("present_ms")),
    Column("", "frames/s with present", plain("frames_per_s")),
    Column("cycles of a steady frame", "core cycles/pixel", plain("core_cycles_per_pixel", 4)),
    Column("cycles of a steady frame", "10⁶ timer cycles", plain("tsc_cycles", 4, 1e6)),
    Column("clocks, GHz", "timer", plain("tsc_hz", 4, 1e9)),
    Column("clocks, GHz", "core", plain("core_hz", 4, 1e9)),
    Column("clocks, GHz", "core under its vector load", _load),
]
BUILT = [
    Column("", "phase", _phase),
    Column("", "precision", word("precision")),
    Column("", "lanes", whole("lanes")),
    Column("", "ISA", word("isa")),
    Column("", "threads", whole("threads")),
    Column("", "algorithm", word("algorithm")),
    Column("", "code", _code),
    Column("", "flags", word("flags")),
    Column("", "compiler", word("compiler")),
    Column("", "libc", word("libc")),
]
BASES = {  # of the speed-ups, which a reader of the page can choose: name → column of a row, its text
    "baseline": ("speedup", OVER_BASE),
    "opt2, same flags": ("speedup_same_flags", OVER_OPT2),
    "the paper's baseline": ("over_paper", _known("over_paper", 3, "×")),
}
# What a reader looks for first.
MAIN = [
    Column("", "phase", _phase),
    Column("", "ms a frame [95\u00a0%]", lambda r: interval(r, "ms")),
    Column("", "× baseline [95\u00a0%]", OVER_BASE),
    Column(f"PSNR {TO_TRUTH}, dB", "paper's shadow", _truth_psnr("truth_psnr_db")),
    Column(f"PSNR {TO_TRUTH}, dB", "ideal shadow", _truth_psnr("truth_psnr_ideal_db")),
    Column(f"PSNR {TO_TRUTH}, dB", "exact surface", _truth_psnr("truth_surface_db")),
    Column("", "wrong hits, ppm", plain("truth_wrong_ppm")),
    Column(TO_BASE, "PSNR, dB", _psnr("psnr_db")),
    Column(TO_BASE, "tolerance", show.gate, show.gate_mark),
]
# What a scene's ladder consists of: columns and title of each table.
PARTS = (
    (LADDER, "Speed and error. “insufficient”: fewer than 3 launches, so no interval"),
    (BESIDE, "Beside the paper"),
    (WHOLE, "First frame, presenting, cycles"),
    (BUILT, "As built"),
)
RUNTIME = [
    Column("", "scene", word("scene")),
    Column("", "n", whole("height")),
    Column("", "width", whole("width")),
    Column("", "phase", _phase),
    Column("", "threads", whole("threads")),
    Column("", "launches", whole("launches")),
    Column("", "frames a launch", _frames),
    Column("", "ms [95\u00a0%]", lambda r: interval(r, "ms")),
    Column("", "least launch, ms", plain("ms_least", 4)),
    Column("", "ns/pixel [95\u00a0%]", lambda r: interval(r, "ns_per_pixel")),
    Column("", "core cycles/pixel", plain("core_cycles_per_pixel", 4)),
    Column("", "J/frame [95\u00a0%]", _known("joules")),
    Column("", "speed-up over baseline [95\u00a0%]", OVER_BASE),
    Column("", "over its one thread [95\u00a0%]", _over_one_thread),
    Column("", "PSNR linear, dB", _psnr("psnr_db")),
    Column("", "tolerance", show.gate_at, show.gate_mark),
]
THEIRS, AGAIN = "the paper, i7-7700 at 3.6 GHz", "its program, run again on Zen 5"
PAPER = [
    Column("", "scene", word("scene")),
    Column("", "phase", _phase),
    Column(THEIRS, "cycles/pixel by its tables", plain("cycles_per_pixel", 4)),
    Column(THEIRS, "speed-up by its tables", _times("implied")),
    Column(THEIRS, "speed-up by its text", _times("stated")),
    Column(AGAIN, "timer cycles/pixel", plain("rerun_tsc_cycles_per_pixel", 3)),
    Column(AGAIN, "speed-up (PSNR display)", show.rerun),
    Column(AGAIN, "pixels off > 1/255 (display)", _part("rerun_over_display")),
]
