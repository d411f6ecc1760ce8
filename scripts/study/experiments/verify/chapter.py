"""The chapter of the verification: each picture against baseline's, by the tolerance that it declares."""

from __future__ import annotations

from study.experiments.section import Section, part, reading
from study.experiments.verify import columns
from study.numbers import ladder
from study.numbers.analysis import Data
from study.pictures.ladder import drawings


def verification(data: Data) -> Section:
    """Which pairs are within their tolerance."""
    pairs = data.pairs
    failing = [pair for pair in pairs if pair.within_tolerance is False]
    parts, drawn, answer = [], {}, ""
    with reading(data.path / "verify.json", f"scripts/stepwise verify --run {data.path}"):
        caption = "Each phase against baseline (or the reference named), by its own tolerance"
        parts = part("verification", caption, columns.rows(pairs), columns.VERIFICATION)
        rows = ladder.rows(data)
        if pairs:
            within = [pair for pair in pairs if pair.within_tolerance]
            held = len(within) + len(failing)
            alone = len(pairs) - held
            answer = f"{len(within)} of {held} pictures are within their tolerance to baseline's"
            answer += f"; {len(failing)} are outside" if failing else ""
            answer += f"; {alone} are judged by ground truth alone (next chapter)" if alone else ""
            answer += "."
        able = {} if rows.empty else drawings(data, rows)
        drawn = {name: able[name] for name in ("speed-against-error",) if name in able}
    return Section(
        *("verification", "Verification against baseline", "scripts/stepwise verify --run RUN", parts),
        answer=answer,
        failing=[
            f"{p.phase} on {p.scene}: {'; '.join(p.why or p.failed or ['no reason recorded'])}"
            for p in failing
        ],
        file=data.path / "verify.json",
        script="scripts/stepwise verify",
        drawn=drawn,
        images={
            data.path / pair.heatmap: f"{pair.scene}: {pair.phase} is outside its tolerance"
            for pair in failing
            if pair.heatmap
        },
    )
