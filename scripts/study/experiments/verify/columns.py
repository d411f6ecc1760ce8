"""Columns of the verification: each picture against baseline's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from study.core.show import NOTHING, Column, Row, gate, gate_mark, plain, share, whole, word, yes
from study.numbers.analysis import flat
from study.numbers.columns import _phase, _pictures
from study.numbers.schema import Pair


def _reference(row: Row) -> str:
    return NOTHING if (name := row.get("reference")) == "baseline" else str(name)


def rows(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    return [{k: v for k, v in flat(pair).items() if k not in ("tolerance", "beside")} for pair in pairs]


VERIFICATION = [
    Column("", "scene", word("scene")),
    Column("", "phase", _phase),
    Column("", "tolerance", gate, gate_mark),
    Column("", "reference", _reference),
    Column("", "size", lambda r: f"{r.get('width')}×{r.get('height')}"),
    Column("", "not finite", whole("non_finite")),
    Column("", "bits", lambda r: "identical" if yes(r.get("identical")) else "differ"),
    *[Column("picture", c.name, c.text) for c in _pictures()],
    Column("picture", "FLIP mean", plain("flip_mean", 2)),
    Column("geometry", "hit mask, ppm", plain("mask_mismatch_ppm")),
    Column("geometry", "shape id, ppm", plain("id_mismatch_ppm")),
    Column("geometry", "|Δt| 99\u00a0%, scene units", plain("dt_p99", 2)),
    Column("geometry", "|Δt| max, scene units", plain("dt_max", 2)),
    Column("geometry", "normal 99\u00a0%, degrees", plain("normal_p99_degrees", 2)),
    Column("geometry", "depth agrees", lambda r: share(r.get("depth_agree_fraction"))),
]
