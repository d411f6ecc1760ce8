"""The goals of rays a second."""

from __future__ import annotations

import math
from collections.abc import Iterable

from study.experiments import goal
from study.experiments.packets import measure as packets
from study.experiments.packets import tables as packets_page
from study.numbers import verdicts
from study.numbers.analysis import Data


def reached(data: Data) -> Iterable[goal.Goal]:
    """Against the fastest of Embree's ways that were asked, on the rays where that is least."""
    result = packets.read(data.path / packets.FILE)
    for kind, asked in result["goals"].items() if result.get("rays") else ():
        rows = [(r, packets_page.fastest(r)) for r in result["rays"] if r["kind"] == kind]
        ways = [(r, goal.interval(r, f"{way}_ratio", "")) for r, way in rows if way]
        if not ways:
            continue
        row, ratio = min(ways, key=lambda found: found[1].value)
        name = f"rays {packets_page.OF_KIND[kind]}: over Embree's fastest way, rays a second"
        known = [text for way, text in packets_page.WAYS.items() if any(r.get(way) for r, _ in ways)]
        error = f"asked by {', '.join(known)}; {row['embree']}"
        verdict = "" if asked is None else verdicts.goal(ratio, asked)
        least = math.nan if asked is None else asked
        yield goal.Goal(name, least, ratio, verdict, f"packets on {row['scene']}", beside=error)
