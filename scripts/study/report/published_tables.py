"""The README's table of the ladder, and the published 1280×720 runs machine by machine, as Markdown."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.bounds import roof
from study.core import provenance, registry, show
from study.counting import flops
from study.numbers import beside, ladder, stats
from study.numbers.analysis import Data
from study.numbers.columns import truth_height
from study.report import facts

SCENES = ("scene0", "mandelbulb")  # the paper's own two
LEAST_CYCLES = 3.0  # a pixel: docs/limit.md works them out
KERNELS = ("opt10_scene", "opt11_ideal")  # whose general code docs/limit.md counts; opt12_fused has opt11's
LIMIT_PHASES = ("baseline", "opt4", "opt8_streams", "opt9_convex", *KERNELS, "opt12_fused")
STRONGEST = 2  # of those programs are shown
Row = Mapping[str, Any]


def by_phase(rows: pd.DataFrame, scenes: Sequence[str] = SCENES) -> dict[str, dict[str, Row]]:
    """Phase -> scene -> the ladder's row on one thread, of `scenes`; specs with other flags are left out."""
    found: dict[str, dict[str, Row]] = {}
    for scene, group in ladder.ladders(rows).items():
        for row in group.to_dict("records"):
            if scene in scenes and row["threads"] == 1 and "@" not in row["phase"]:
                found.setdefault(row["phase"], {})[scene] = row
    return found


def limits(data: Data) -> dict[str, str]:
    """Phase -> its lowest roof on scene0 and the share that it reaches: `L1 (45 %)`. Empty where the run has
    no counts or ceilings. A share above 1: a kernel ran that does less than the code that was counted."""
    counted, ceilings, _ = roof.read(data.path, strict=False)
    points = roof.headline(roof.points(data, counted, ceilings))
    return {
        one.phase: f"{one.least_bound} ({100 * one.share_of_least_roof:.0f} %)"
        for one in points
        if one.scene == SCENES[0] and one.least_bound and one.share_of_least_roof <= 1
    }


def _head(ratios: bool, scenes: Sequence[str] = SCENES) -> list[str]:
    columns = ["ms [95 %]", *["× baseline [95 %]"] * ratios, "dB"]
    return [f"{scene}, {name}" if name.startswith("ms") else name for scene in scenes for name in columns]


def _cells(of: Mapping[str, Row], ratios: bool, scenes: Sequence[str] = SCENES) -> list[str]:
    """Each scene's ms, × baseline (only with `ratios`) and dB to ground truth; – where there is no row."""
    made = []
    for row in map(of.get, scenes):
        if row is None:
            made += [show.NOTHING] * (2 + ratios)
            continue
        psnr = show.number(row.get("truth_own_db")) + " (ideal)" * show.yes(row.get("truth_draws_ideal"))
        psnr += " to a march" * (
            show.yes(row.get("truth_converged_only")) and show.gone(row.get("truth_surface_db"))
        )
        speedup = [show.speedup("speedup", "speedup_base")(row)] if ratios else []
        made += [show.interval(row, "ms"), *speedup, psnr]
    return made


def originals(folder: Path) -> list[list[str]]:
    """Rows of the paper's own program, from original.json: times, and ratios to our baseline of that run."""
    rows = {(row.phase, row.scene): row for row in beside.originals(folder)}
    made = []
    phases = list(dict.fromkeys(name for name, _ in rows))
    for phase in dict.fromkeys([*phases[:1], *phases[-1:]]):  # its first step and its last
        cells = [f"the paper's {phase}", "Its own program", show.NOTHING]
        for scene in SCENES:
            one, base = rows.get((phase, scene)), rows.get((ladder.BASE, scene))
            if not one or not base or one.n != base.n:
                cells += [show.NOTHING] * 3
                continue
            ours, theirs = base.ours_launches_ms, one.theirs_launches_ms
            time = stats.median_interval(theirs)
            ratio = stats.ratio_interval(ours, theirs, rounds=phase == ladder.BASE)
            psnr = one.psnr_display_db
            error = "as ours" if psnr is None else f"{psnr:.1f} to ours"
            cells += [show.spread(time, 4), show.spread(ratio, 3, "×"), error]
        made.append(cells)
    return made


def strongest(folder: Path, height: int, scenes: Sequence[str] = SCENES) -> list[list[str]]:
    """Rows of the fastest other programs that draw the scenes without shadows and mirrors, and draw them
    right: from peers.json, on one thread. Instead of a ratio to baseline: to our fastest phase there.
    A scene that none of them draws does not count."""
    found = beside.Peers.load_if_there(folder / beside.PEERS)
    if not found or found.n != height:
        return []
    least = {one.program: one.least_db for one in found.programs}
    plain = [f"{scene}_plain" for scene in scenes]
    made: dict[str, dict[str, beside.PeerRow]] = {}
    for row in found.rows:
        right = row.psnr_db is None or row.psnr_db >= least.get(row.program, {}).get(row.scene, 0)
        if row.kind == "peer" and row.threads == 1 and row.scene in plain and row.ratio and right:
            made.setdefault(row.program, {})[row.scene] = row
    drawn = set[str]().union(*made.values())
    whole = {name: of for name, of in made.items() if set(of) == drawn}
    slower = {name: math.prod(one.ratio.ends[0] for one in of.values()) for name, of in whole.items()}
    lines = []
    for name in sorted(slower, key=slower.__getitem__)[:STRONGEST]:
        cells = [name, "Another program, without shadows", show.NOTHING]
        for row in map(whole[name].get, plain):
            if row is None:
                cells += [show.NOTHING] * 3
                continue
            cells += [show.spread(row.ms, 4), f"{show.spread(row.ratio, 3, '×')} as long as {row.beside}"]
            march = " to a march" * bool(row.averaged and row.surface_db is None)
            shown = row.psnr_db if row.surface_db is None else row.surface_db
            cells.append("identical" if shown is None else show.number(shown) + march)
        lines.append(cells)
    return lines


def ladder_block(data: Data, rows: pd.DataFrame, exact: pd.DataFrame | None = None) -> str:
    """The README's one table: a row a phase, then the paper's own program and the strongest others where the
    run has them.

    The ratio to baseline is shown where baseline was held beside the paper's program. `exact`: errors to
    exact surfaces (ladder.truth_errors, with `run`) for a run without: pictures do not hang on the clock.
    """
    found, bound, known = by_phase(rows), limits(data), registry.ladder()
    borrowed = ""
    for one in [] if exact is None else exact.to_dict("records"):
        row = found.get(one["phase"], {}).get(one["scene"])
        if row and show.gone(row.get("truth_surface_db")) and not show.gone(one["truth_surface_db"]):
            found[one["phase"]][one["scene"]] = {**row, **one}
            borrowed = f" Those of the mandelbulb are of the run {one['run']}."
    ratios = beside.held_beside(data.path)
    size = next(iter(next(iter(found.values())).values()))
    head = ["phase", "idea", "lowest roof", *_head(ratios)]
    lines = []
    for phase in sorted(found, key=lambda name: known[name].order if name in known else 99):
        title = known[phase].title if phase in known else ""
        cells = [f"[`{phase}`](phases/{phase}/NOTES.md)", title, bound.get(phase, show.NOTHING)]
        lines.append(cells + _cells(found[phase], ratios))
    others = strongest(data.path, size["height"]) if ratios else []
    table = markdown(head, [*lines, *(originals(data.path) if ratios else []), *others])
    said = registry.translated(data.by_simde, found)
    at = truth_height([row for several in found.values() for row in several.values()])
    note = (
        f"{size['width']}×{size['height']}, one thread, {show.inert(provenance.place(data.context))}. Times: "
        "medians over process launches, with 95 % intervals. dB: PSNR to the ground truth"
        f"{at or ', not measured'}; the mandelbulb's to its exact surface, means of 4×4 samples."
        + " “To a march”: in exact arithmetic, where the run lacks that."
        * ("to a march" in table)
        + " Above 50 dB a few pixels at edges decide, so levels differ with the size."
        f"{borrowed} Lowest roof: of the roofline model on scene0, and the share that the phase reaches. "
        "L1: traffic of the first-level cache; divider: quotients and roots; –: the kernel that ran does "
        "less than the code that was counted."
        + " “To ours”: between the displayed pictures of both." * ratios
        + " Without shadows: on both scenes without shadows and mirrors, beside our fastest phase there."
        * bool(others)
        + f" {said}" * bool(said)
    )
    return f"{table}\n{textwrap.fill(note, 100, break_on_hyphens=False)}\n"


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "".join(f"| {' | '.join(map(show.inert, cells))} |\n" for cells in rows)


def limit_block(data: Data, rows: pd.DataFrame) -> str:
    """Block of docs/limit.md: cycles of the phases on scene0, and what the general code of kernels does."""
    group = ladder.ladders(rows)[SCENES[0]]
    lines = []
    for row in group.to_dict("records"):
        if row["phase"] in LIMIT_PHASES and row["threads"] == 1:
            cycles = row["core_cycles_per_pixel"]
            cells = [show.interval(row, "core_cycles_per_pixel", 3), show.number(cycles / LEAST_CYCLES, 2)]
            lines.append([row["phase"], *cells])
    head = ["phase", "core cycles a pixel [95 %]", f"times the {LEAST_CYCLES} above"]
    counted = [
        [one.phase, *(show.number(count / (one.width * one.height)) for count in counts)]
        for one in flops.read(data.path / "counts.json").measured
        if (one.scene, one.variant) == (SCENES[0], "shipped") and one.phase in KERNELS
        for counts in [(one.total.machine, one.total.load_bytes, one.total.store_bytes)]
    ]
    general = markdown(["general code of", "FLOPs a pixel", "bytes loaded", "bytes stored"], counted)
    return f"{markdown(head, lines)}\n{general}"


def machines_block(runs: Sequence[Data]) -> str:
    """Tables of each machine, of its newest run: ms and error at 1280×720, the paper's scenes first.

    The ratio to baseline is shown where baseline was held beside the paper's program.
    """
    parts = []
    newest = {facts.short_name(data): data for data in sorted(runs, key=lambda data: data.context.time or "")}
    for here, data in sorted(newest.items()):
        rows = ladder.rows(data, 720)
        place = show.inert(provenance.place(data.context))
        title = f"## {show.inert(here)}\n\n{place}: run `{data.path.name}`.\n"
        ratios = beside.held_beside(data.path)
        for scenes in (SCENES, tuple(sorted(set(rows.get("scene", ())) - set(SCENES)))):
            if not (found := by_phase(rows, scenes)):
                continue
            lines = [[phase, *_cells(of, ratios, scenes)] for phase, of in found.items()]
            if ratios and scenes != SCENES:
                others = strongest(data.path, 720, scenes)
                lines += [[f"{name}, without shadows", *cells] for name, _, _, *cells in others]
            parts += [title, markdown(["phase", *_head(ratios, scenes)], lines)]
            title = "Other scenes of the run:\n"
            if said := registry.translated(data.by_simde, found):
                parts.append(f"{textwrap.fill(said, 100)}\n")
    return "\n".join(parts)
