"""The packet ray tracer's rows of the table of all systems: from packets.json alone."""

from __future__ import annotations

from study.core import show
from study.experiments.functions.measure import VECTORS as ARTICLE_VECTORS
from study.experiments.packets.measure import Row
from study.experiments.packets.tables import OF_KIND, agreement, equal, over_fastest, rate, variant

LAST_MARCHED = ("opt8_streams",)  # of the ladder: behind it, closed forms are in it too
ARTICLES_ROOT = "rsqrtps + 1"  # the approximate root and one Newton step


def normalise_rows(result: Row) -> list[Row]:
    """The article's only figures, of normalising vectors: scalar, by SSE, and the one over the other."""
    rows = {(r["isa"], r["layout"], r["name"]): r for r in result.get("normalise", [])}
    scalar = rows.get(("scalar", "AoS", "1/sqrt"))
    if scalar is None:
        return []
    said, many = result["article"], f"normalising {scalar['vectors']:,} vectors"

    def error(row: Row) -> str:
        return f"≤ {show.number(row['max_ulp'], 2)} ulp"

    def timed(row: Row, how: str, key: str) -> Row:
        alike = scalar["vectors"] == ARTICLE_VECTORS
        return {
            "what": f"{many}, {how}, ms",
            "article": f"{said[key]} ({said['cpu']})" if alike else show.NOTHING,
            "ours": show.interval(row, "ms", 3),
            "ratio": show.number(said[key] / row["ms"]) + "× its speed" if alike else show.NOTHING,
            "error": error(row),
        }

    found = [timed(scalar, "scalar", "scalar_ms")]
    for isa in dict.fromkeys(isa for isa, _, name in rows if name == ARTICLES_ROOT):
        one = rows[isa, "SoA", ARTICLES_ROOT]
        found.append(timed(one, f"{isa}, approximate root and a Newton step", "sse_ms"))
        over = {
            "what": f"{many}, {isa} over scalar",
            "article": f"{said['speed_up']}×",
            "ours": show.interval(one, "gain", 3, "×"),
            "ratio": show.number(one["gain"] / said["speed_up"]) + "× of it",
            "error": error(one),
        }
        found.append(over)
    return [{"system": "packet ray tracer (P2)", **row} for row in found]


def system_rows(result: Row) -> list[Row]:
    """Rows of the table of all systems. The article times the normalising of vectors, and no rays."""
    found = normalise_rows(result)
    for row in result["rays"]:
        own = variant(row, "own")
        found.append(
            {
                "system": "packet ray tracer (P2)",
                "what": f"{row['scene']}, rays {OF_KIND[row['kind']]}, million a second",
                "article": "“millions of rays per second, per core”",
                "ours": rate(own),
                "ratio": over_fastest(row),
                "error": show.NOTHING if row["agreement"] is None else f"against Embree: {agreement(row)}",
            }
        )
    for drawn in result["drawn"]:
        rows = {row["phase"]: row for row in drawn["rows"]}
        own, marched = rows["packets"], [row for name, row in rows.items() if name in LAST_MARCHED]
        for other in marched:
            timed, said = other["threads"][0], equal(drawn, other)
            with_what = "at equal error" if said == "reached" else f"equal error {said}"
            found.append(
                {
                    "system": "packet ray tracer (P2)",
                    "what": f"{drawn['scene']} {drawn['width']}×{drawn['n']}, ms a frame, one thread",
                    "article": show.NOTHING,
                    "ours": show.interval(own["threads"][0], "ms", 3),
                    "ratio": f"{show.interval(timed, 'gain', 3, '×')} over {other['phase']}, {with_what}",
                    "error": f"{show.number(own['psnr_db'])} dB, {own['wrong_ppm']:,.0f} ppm wrong hits",
                }
            )
    return found
