"""scripts/stepwise lattice: figures by hand, the tables of a made-up result, a small run."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core import cli, commands, store
from study.experiments.lattice import command as lattice
from study.experiments.lattice import tables
from study.experiments.lattice.schema import Lattice
from study.measuring.schema import HitErrors

NAMES = ["baseline", "opt4", "opt10_scene"]
ERRORS = dict.fromkeys(NAMES, HitErrors(wrong_ppm=0.0, dt_p99=0.5, psnr_db=60.0, non_finite=0))
SIZE = (1280, 720)


def made_up() -> Lattice:
    """Six launches each: opt10_scene takes 10 ms on one thread and 5 on two."""
    ms = {"baseline": 1000.0, "opt4": 100.0, "opt10_scene": 10.0}
    points = lattice.points(NAMES, lattice.SIZES, [1, 2, 2])
    rows = [lattice.row(point, [ms[point.phase] / point.threads] * 6, ERRORS) for point in points]
    about = {"schema": 1, "program": lattice.PROGRAM, "paper": lattice.PAPER, "error_size": [320, 180]}
    return Lattice(**about, rows=rows)


def test_a_phase_has_threads_where_it_takes_several() -> None:
    points = lattice.points(NAMES, lattice.SIZES, [1, 2, 2])
    assert len(points) == len(set(points)) == 2 * (1 + 1 + 2)
    assert {p.phase for p in points if p.threads == 2} == {"opt10_scene"}


def test_ratios_by_hand() -> None:
    found = {(r.phase, r.n, r.threads): r for r in made_up().rows}
    assert len(found) == 8
    one, two = (found["opt10_scene", 720, threads] for threads in (1, 2))
    assert one.program == pytest.approx(5.77) and two.program == pytest.approx(33.1 / 5)
    assert found["opt10_scene", 562, 1].program is None is found["opt10_scene", 562, 1].program_ms
    assert found["opt4", 720, 1].program == pytest.approx(0.577)


def test_intervals_have_their_ends_the_right_way_round() -> None:
    row = lattice.row(lattice.Point("opt4", SIZE, 1), [10, 11, 12, 13, 14, 15], ERRORS)
    assert row.ms_low < row.ms < row.ms_high
    assert row.program_low < row.program < row.program_high
    few = lattice.row(lattice.Point("opt4", SIZE, 1), [10], ERRORS)
    assert few.ms_low is None and few.ms == 10


def test_tables_are_made_from_the_file_alone(tmp_path: Path) -> None:
    store.write_json(tmp_path / lattice.FILE, made_up())
    result = Lattice.load(tmp_path / lattice.FILE)
    assert result.best(2).phase == "opt10_scene" and result.best(3) is None
    system = tables.system(tmp_path)
    one, two, claim = system.claims
    assert (one.said, one.ours.split()[0], one.ratio) == ("57.7", "10.0", "5.77×")
    assert two.ours.split()[0] == "5.00"
    assert (claim.said, claim.ratio) == ("14×", "0.473×")  # 6.62 over 14
    (part,) = system.parts
    assert "| opt10_scene | 1280×720 | 2 | 5.00 [5.00" in part.markdown and "320×180" in part.foot


def called(*words: object) -> cli.Outcome:
    return commands.called("lattice", [str(word) for word in words])[0]


@pytest.mark.slow
def test_a_small_run(tmp_path: Path) -> None:
    words = ["-n", 18, "--error-n", 18, "--launches", 1, "--threads", 1, "--run", tmp_path]
    outcome = called("--phase", "opt9_convex", "opt4", *words)
    result = Lattice.load(tmp_path / lattice.FILE)
    assert outcome.ended == cli.OK and cli.plain(outcome.result) == cli.plain(result)
    exact, march = result.rows
    assert (exact.phase, march.phase, exact.width) == ("opt9_convex", "opt4", 32)
    assert exact.wrong_ppm == 0 < march.wrong_ppm and exact.program is None and exact.ms > 0
