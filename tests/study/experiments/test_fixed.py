"""stepwise fixed: what may be timed here, its tables of a published run, which blocks are wrong."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

import complete
import msgspec
import pytest

from study.core import cli, commands, registry, run, show
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import tables
from study.experiments.fixed.schema import FILE, Fixed, Picture

IN_LANES = {  # what may be timed on a CPU of so many
    1: ["article, 1 lane", "1 lane"],
    8: ["article, 1 lane", "1 lane", "8 lanes", "float, 8 lanes"],
    16: list(fixed.CASES),
}


def published(**more: Any) -> Fixed:
    return msgspec.convert(complete.published(FILE) | more, Fixed)


@pytest.mark.parametrize(
    ("isa", "lanes"), [({"avx512f", "avx512dq"}, 16), (set(), 8), (None, 1)], ids=["16", "8", "1"]
)
def test_no_case_is_timed_in_lanes_that_the_cpu_lacks(
    monkeypatch: pytest.MonkeyPatch, isa: set[str] | None, lanes: int
) -> None:
    """16 lanes on a CPU of 8 would be 8 by another name; what all are compared with is the widest float."""
    has = {"sse2"} | ({"avx2", "fma"} | isa if isa is not None else set())
    monkeypatch.setattr(registry, "cpu_flags", lambda: has)
    assert list(fixed.able()) == IN_LANES[lanes]
    took = {"8 lanes": 10.0, "16 lanes": 6.0, "float, 8 lanes": 8.0, "float, 16 lanes": 3.0}
    monkeypatch.setattr(
        fixed, "timed", lambda cases, *_: {name: [took.get(name, 20.0)] * 6 for name in cases}
    )
    monkeypatch.setattr(fixed, "errors", lambda *_: Picture())
    rows = {row.case: row for row in fixed.beside(16, 3, 1)}
    assert list(rows) == IN_LANES[lanes]
    assert rows["article, 1 lane"].gain is None and rows["1 lane"].gain == 1, "none is beside itself"
    if lanes > 1:
        assert (
            rows["1 lane"].over_float == {8: 0.4, 16: 0.15}[lanes] and rows["8 lanes"].over_like_float == 0.8
        )
        assert rows[f"float, {lanes} lanes"].over_float is None


def test_what_does_not_fit_is_a_row_and_another_error_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def errors(case, scene, size):
        if "roots=article" in case.words:
            raise run.DriverError(status, "render: /any/scene.json: too large")
        return Picture(psnr_db=1.0)

    monkeypatch.setattr(fixed, "errors", errors)
    monkeypatch.setattr(fixed, "timed", lambda cases, *_: {name: [1.0] * 6 for name in cases})
    status = run.UNSUPPORTED
    rows = fixed.sweep(16, 2, 1, "fixed")
    assert [r.refused for r in rows if r.roots == "article"] == ["too large"] * len(fixed.BITS)
    assert all(r.ms == 1 and r.refused is None for r in rows if r.roots != "article")
    status = run.NO_MEMORY
    with pytest.raises(run.DriverError):
        fixed.sweep(16, 2, 1, "fixed")


def test_how_many_frames_each_program_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fixed.animations, "thread_counts", lambda: [1, 2])
    assert fixed.share(900, False, 2) == 900, "the headline"
    assert fixed.share(900, False, 1) == fixed.share(900, True, 2) == 225
    assert fixed.share(900, True, 1) == 60 and fixed.share(2, True, 1) == 2


def test_the_articles_figure_beside_ours() -> None:
    """35 of its cores draw a frame in 14.29 ms, as many pixels as ours."""
    found = tables.system(complete.RUN)
    rows = [row for row in complete.published(FILE)["animation"] if row["frames"] == 900]
    assert found and len(found.claims) == len(rows) > 0, "of the programs with the article's frames"
    for one, row in zip(found.claims, rows, strict=True):
        mean = row["ms"]["mean"]
        assert one.said == "14.29" and complete.figure(one.ours) == pytest.approx(mean, rel=0.01)
        ratio = 14.29 * 35 / (mean * row["threads"])
        assert complete.figure(one.ratio) == pytest.approx(ratio, rel=0.01)


def test_the_lessons_of_a_published_run() -> None:
    """Each row is so many times as fast as the first: of the cases' median launches."""
    times = {row["case"]: statistics.median(row["launches"]) for row in complete.published(FILE)["rows"]}
    lessons = tables.lessons(published())
    assert [one.name for one in lessons] == ["fixed", "fixed_simd", "fixed_float"]
    for one in lessons:
        cases = tables.LESSONS[one.name]
        assert one.table.cells[0][2][0] == "base"
        for case, (_, ms, ratio, *_) in list(zip(cases, one.table.cells, strict=True))[1:]:
            assert complete.figure(ms[0]) == pytest.approx(times[case], rel=0.01)
            assert complete.figure(ratio[0]) == pytest.approx(times[cases[0]] / times[case], rel=0.05)


def test_the_tables_of_a_published_run() -> None:
    result = published()
    found = tables.system(complete.RUN)
    assert found
    cells = {row[0][0]: [text.split()[0] for text, _ in row[3:6]] for row in found.parts[0].table.cells}
    times = {row.case: row.ms or 0 for row in result.rows}
    base, over, like = cells["article, 1 lane"]
    wanted = times["float, 16 lanes"] / times["article, 1 lane"]
    assert (base, like) == ("base", "–") and complete.figure(over) == pytest.approx(wanted, rel=0.05)
    assert cells["float, 8 lanes"][2] == "base" and cells["float, 16 lanes"][1:] == ["base", "base"]
    (moved,) = (one for one in found.parts if one.name == "fixed-animation")
    article = dict(zip([c.name for c in moved.table.columns], moved.table.cells[0], strict=True))
    assert (article["mean"][0], article["core·ns a pixel"][0]) == ("14.29", "241")
    refused = [row for row in result.sweep if row.refused]
    text = show.markdown(show.table(result.sweep, tables.SWEEP))
    assert refused and all(str(row.refused) in text for row in refused)


def test_rows_of_fewer_frames_or_another_size_are_no_claims() -> None:
    moved = complete.published(FILE)["animation"]
    assert tables.claims(published(animation=[row | {"frames": 225} for row in moved])) == []
    assert tables.claims(published(animation=[row | {"n": 90} for row in moved])) == []


@pytest.mark.slow
def test_all_of_it_small(tmp_path: Path) -> None:
    words = ["-n", "16", "--sizes", "16", "--frames", "2", "--frame-n", "16", "--launches", "2"]
    outcome, _ = commands.called("fixed", [*words, "--run", str(tmp_path)])
    result = Fixed.load(tmp_path / FILE)
    assert outcome.ended == 0 and cli.plain(outcome.result) == cli.plain(result)
    simd = registry.find_phase("fixed_simd")
    most = 1 if registry.missing_isa(simd) else registry.variant_here(simd).lanes
    assert [row.case for row in result.rows] == IN_LANES[most]
    assert len(result.sweep) == 3 * len(fixed.BITS) and any(row.refused for row in result.sweep)
    assert result.clearing[0].wrongly_cleared_ppm == 0 < result.clearing[1].wrongly_cleared_ppm
    assert all(len(row.all_ms) == row.common_frames == 2 for row in result.animation)
    cores = len({1, len(run.USABLE)})
    programs = ["article"] * cores + (["lanes"] * cores + ["floats"] * cores if most > 1 else [])
    assert [row.program for row in result.animation] == programs
    errors = [row.error for row in result.animation]
    assert all((e.width, e.n) == (28, 16) and 20 < e.psnr_db < 150 for e in errors), errors
    assert {"roots=article", "clear=corners", "bits=20"} <= set(result.animation[0].settings.split())
