"""The chapter of the roofline: ceilings, Tables 5 and 6, the share of each roof."""

from collections.abc import Iterable

from study.bounds import roof
from study.bounds.ceilings import BANDWIDTH, COMPUTE, Ceilings, grid
from study.bounds.roof_shares import clocks
from study.core import show
from study.experiments.roofline import figures, tables
from study.experiments.section import Part, Section, part
from study.numbers.analysis import Data


def roofline(data: Data) -> Section:
    """Ceilings, Tables 5 and 6, the share of each roof."""
    counted, limits, notes = roof.read(data.path, strict=False)
    return made(data, roof.points(data, counted, limits), limits, notes)


def made(data: Data, points: list[roof.Point], limits: Ceilings | None, notes: Iterable[str] = ()) -> Section:
    parts: list[Part] = []
    answer = ""
    for name, title in (("table5", "performance of baseline"), ("table6", "of the optimised phases")):
        rows = [one for one in points if one.section == name]
        parts += part(name, f"Table {name[-1]}: {title}", rows, tables.PERFORMANCE)
    if points and limits:
        caption = "Share of each roof, at the largest size that was timed and counted"
        rows = roof.headline(points)
        foot = "\n".join([*clocks(rows), *limits.remarks()])
        parts += part("roofline", caption, rows, tables.POINTS, foot)
        answer = _answer(rows)
    if limits:
        caption = "What one core does at best: flop per core cycle, best sample and median"
        parts += part("ceilings", caption, grid(limits, "precision"), COMPUTE)
        caption = "Bandwidth as the core sees it: bytes per core cycle, best sample and median"
        parts += part("bandwidth", caption, grid(limits, "level"), BANDWIDTH)
    told = {"file": data.path / roof.COUNTS, "script": "scripts/stepwise roofline"}
    told |= {"answer": answer, "drawn": figures.drawings(data, points, limits)}
    remarks = [*roof.remarks(points), *notes] if parts else []
    return Section("roofline", "Roofline", "make roofline", parts, remarks, **told)


def _answer(points: list[roof.Point]) -> str:
    """What bounds the last phase on each scene; then the phase that is nearest to its own roof."""
    said = []
    for scene in dict.fromkeys(one.scene for one in points):
        mine = [one for one in points if one.scene == scene and 0 < one.share_of_least_roof <= 1]
        if mine:
            best = max(mine, key=lambda one: one.share_of_least_roof)
            rate = f"{show.interval(best, 'flops_per_core_cycle', 3)} flop per core cycle"
            share = show.percent(best.share_of_least_roof)
            said.append(
                f"on {scene} {best.phase} does {rate}, {share} of its lowest roof ({best.least_bound})"
            )
    last = {one.scene: one for one in points if one.phase == points[-1].phase}
    bound = [
        f"{one.least_bound} on {scene} ({show.percent(one.share_of_least_roof)} of that roof)"
        for scene, one in last.items()
    ]
    text = f"{points[-1].phase} is bound by {', by '.join(bound)}. " if bound else ""
    return f"{text}Of all phases the nearest to its own roof: {'; '.join(said)}." if said else ""
