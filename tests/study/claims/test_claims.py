"""The claims register, on runs made to order: how far a statement was tried, threads, compilers, commands."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import complete
import numpy as np
import pandas as pd
import pytest
from claimed import claimed

from study.bounds import roof
from study.claims import claims, register
from study.commands import tables
from study.core import commands, table_files
from study.core.registry import ROOT
from study.core.run_schema import Context, Cpu, Plan
from study.experiments import experiment
from study.numbers import analysis, ladder, paper
from study.numbers.analysis import Cell, Data, Facts
from study.numbers.verdicts import FAILS, HOLDS, NEVER, OPEN, PART, UNSURE, WORDS, Found, sized
from study.report import chapters

STEADY = (0.999, 1.0, 1.001, 1.0, 0.9995, 1.0005)


def cell(spec: str, n: int, pace: float, threads: int = 1, spread: tuple = STEADY, lanes: int = 1) -> Cell:
    """`pace`: ns per pixel of its median launch; n pixels square."""
    # No two cells' launches go up and down together.
    ns = pd.Series([pace * n * n * part for part in np.roll(spread, ord(spec[-1]) + n // 100)])
    values = pd.DataFrame({"ns": ns, "core_cycles": 4 * ns})
    return Cell("scene0", spec, n, n, threads, Facts(lanes=lanes), values)


@pytest.fixture
def run(tmp_path: Path):
    def make(*cells: Cell, cpus: int = 2) -> Data:
        context = Context(cpu=Cpu(logical_cpus=cpus))
        return Data(tmp_path, context, Plan(), pd.DataFrame(), list(cells), [], [])

    return make


def rows_of(data: Data) -> pd.DataFrame:
    """What ladder.rows gives `speedup`: which size is the headline's."""
    n = max(one.height for one in data.cells)
    return pd.DataFrame([{"scene": "scene0", "height": n, "width": n, "headline": True}])


def judge(what: str, data: Data, **claim: object) -> Found:
    return claims.CHECKS[what](data, rows_of(data), claimed(**claim))


WILD = (0.5, 1.0, 1.5, 0.7, 1.3, 1.0)


@pytest.mark.parametrize(
    ("paces", "spread", "verdict"),
    [
        ({500: 100, 2000: 109}, STEADY, HOLDS),
        ({500: 100, 1999: 109}, STEADY, PART),  # "for every n" up to 2000
        ({500: 100, 2000: 112}, STEADY, FAILS),
        ({500: 112, 1000: 100, 1500: 105}, STEADY, FAILS),  # refuted at any size of the range
        ({500: 100, 2000: 112}, WILD, UNSURE),
        ({50: 150, 500: 100, 2000: 105}, STEADY, HOLDS),  # below the paper's range nothing is stated
        ({50: 150, 90: 100}, STEADY, UNSURE),
        ({2000: 100}, STEADY, OPEN),
    ],
)
def test_constant_over_n(run, paces: dict[int, float], spread: tuple, verdict: str) -> None:
    data = run(*(cell("baseline", n, pace, spread=spread) for n, pace in paces.items()))
    found = judge("constant", data, n=2000)
    assert found.verdict == verdict
    if verdict == PART:
        assert "over n = 500 … 1999" in found.why and "n = 2,000" in found.why
    if len(paces) == 2:
        assert found.value == pytest.approx(max(paces.values()) / min(paces.values()))


@pytest.mark.parametrize(
    ("small", "large", "n", "verdict"),
    [(100, 50, 2000, HOLDS), (100, 50, 200, PART), (50, 100, 2000, FAILS), (50, 100, 200, UNSURE)],
)
def test_a_gain_that_grows_is_known_at_the_papers_size_alone(run, small, large, n, verdict) -> None:
    base = [cell("baseline", size, 1000) for size in (100, n)]
    fast = [cell("opt4", size, pace) for size, pace in ((100, small), (n, large))]
    found = judge("grows", run(*base, *fast), phase="opt4", n=2000)
    assert found.verdict == verdict and (n == 2000 or "n = 100 … 200" in found.why)
    assert found.value == pytest.approx(small / large)


@pytest.mark.parametrize(
    ("pace", "n", "lanes", "verdict"),
    [
        (40, 2000, 8, HOLDS),
        (40, 200, 8, PART),
        (60, 2000, 8, FAILS),
        (60, 200, 8, UNSURE),  # the paper: small n gain less, where there are lanes
        (60, 200, 1, FAILS),
        (50, 2000, 8, UNSURE),
    ],
)
def test_a_speedup_says_how_far_it_was_tried(run, pace, n, lanes, verdict) -> None:
    found = judge(
        "speedup",
        run(cell("baseline", n, 1000), cell("opt4", n, pace, lanes=lanes)),
        phase="opt4",
        value=20,
        n=2000,
    )
    assert found.verdict == verdict and found.value == pytest.approx(1000 / pace)
    assert found.low < found.value < found.high and ("tried at n = 200" in found.why) == (n == 200)


@pytest.mark.parametrize("verdict", [HOLDS, PART, FAILS, UNSURE])
def test_the_size_rule(verdict: str) -> None:
    found = Found("x", verdict, "so it is", 1.0, n=100)
    assert sized(found, 100) == sized(found, math.nan) == found
    short = sized(found, 101)
    assert short.verdict == (PART if verdict == HOLDS else verdict)
    assert sized(found._replace(n=None), 101).verdict == short.verdict
    assert sized(Found("", OPEN, "no file"), 101) == Found("", OPEN, "no file")


@pytest.mark.parametrize(
    ("cpus", "threads", "pace", "verdict"),
    [
        (2, 2, 51, NEVER),
        (4, 2, 51, NEVER),
        (4, 4, 30, HOLDS),
        (4, 4, 60, PART),
        (4, 4, 101, FAILS),
        (2, 1, 100, OPEN),
    ],
)
def test_threads_need_the_cores(run, cpus: int, threads: int, pace: float, verdict: str) -> None:
    """2.67 is out of two threads' reach; what they gave stands beside that. 100 ns on one thread."""
    cells = [cell("opt4", 180, 100), cell("opt5_threads", 180, 100), cell("opt5_threads", 90, 1, 2)]
    cells = [*cells[:2], cell("opt5_threads", 180, pace, threads)]
    found = judge("threads", run(*cells, cpus=cpus), phase="opt5_threads", base="opt4", value=2.67)
    assert found.verdict == verdict
    if threads > 1:
        assert found.value == pytest.approx(100 / pace) and f"on {cpus} CPUs" in found.here
        assert found.here.count(f": {100 / pace:.3g}") == 2  # over opt4, and over itself on one thread
    if verdict == NEVER:
        assert {"3", str(cpus)} <= set(found.why.split()) and "a note" in found.why


def test_float_over_double_is_flops_per_cycle_and_not_time(run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the time with three quarters of the FLOPs: 1.5 times the flops/cycle, where 2 were by time."""
    data = run(cell("opt3", 2000, 100), cell("opt4", 2000, 50))
    flops = {"opt3": 4e6 * 400, "opt4": 4e6 * 300}
    about = {"scene": "scene0", "height": 2000, "width": 2000, "pixels": 4e6, "flops_per_core_cycle": 9.0}
    points = [
        SimpleNamespace(
            **about,
            phase=name,
            paper_rule_flops=count,
            paper_rule_flops_per_core_cycle=count / (4e6 * 4 * pace),
        )
        for (name, count), pace in zip(flops.items(), (100, 50), strict=True)
    ]
    monkeypatch.setattr(roof, "points", lambda *_: points)
    for stated, verdict in ((1.5, HOLDS), (1.8, PART)):
        claim = claimed(phase="opt4", base="opt3", value=stated, n=2000)
        found = register.CHECKS["flops_gain"](data, claim)
        assert found.verdict == verdict and found.value == pytest.approx(1.5)
        assert found.low < 1.5 < found.high


def timed(**ms: float) -> dict[str, object]:
    rows = []
    for name, value in ms.items():
        compiler, _, phase = name.partition("_")
        about = {"compiler": compiler, "phase": phase, "flags": "as shipped", "scene": "mandelbulb", "n": 90}
        rows.append(about | {"ms": {"value": value, "low": value - 1, "high": value + 1}})
    return {"rows": rows}


@pytest.mark.parametrize(
    ("ms", "verdict"),
    [
        ({"gcc_opt4": 10, "gcc_opt1": 90, "icx_opt4": 15, "icx_opt1": 50}, HOLDS),  # the best alone counts
        ({"gcc_opt4": 15, "icx_opt4": 10}, FAILS),
        ({"gcc_opt4": 10, "icx_opt4": 11}, UNSURE),
        ({"gcc_opt4": 10, "clang_opt4": 5, "icx_opt4": 15}, HOLDS),  # gcc against ICC is what is said
        ({"gcc_opt4": 10, "clang_opt4": 12}, NEVER),
        ({"icx_opt4": 10}, OPEN),
    ],
)
def test_the_best_performance_is_gccs(run, ms: dict[str, float], verdict: str) -> None:
    data = run()
    complete.write(data.path / "toolchains.json", timed(**ms))
    claim = claimed(scene="mandelbulb", n=math.nan)
    found = register.CHECKS["best_compiler"](data, claim)
    assert found.verdict == verdict
    if verdict == NEVER:  # why, and what there is without it
        assert {"10", "12"} <= set(found.here.split())
        assert register.CHECKS["compilers"](data, claim)[:3] == found[:3]
    assert register.CHECKS["best_compiler"](data, claimed(scene="scene0")).verdict == OPEN


@pytest.mark.usefixtures("few_resamples")
def test_the_register_is_written_with_the_tables(tmp_path: Path) -> None:
    source = ROOT / "tests" / "fixtures" / "run"
    data = analysis.load(source)
    rows = ladder.rows(data)
    paths = table_files.write(tables.make(rows, [chapters.reproduced(data, rows)]), tmp_path)
    found = pd.read_csv(tmp_path / "claims.csv")
    assert len(found) == len(paper.read("claims")) and set(found["verdict"]) <= set(WORDS)
    assert found["why"].notna().all() and found["line"].gt(0).all() and found["unit"].notna().sum() > 30
    one = found[found["quote"].str.startswith("up to 32.1")].iloc[0]
    assert (one["stated"], one["line"], one["value"], one["n"]) == (32.1, 321, pytest.approx(32.0), 180)
    assert one["low"] < 32 < one["high"] and one["verdict"] == UNSURE
    assert one["command"].endswith("sweep --scene scene0")
    stored = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))
    assert [row["verdict"] for row in stored] == list(found["verdict"]) and tmp_path / "claims.json" in paths


COMMANDS = sorted({c for c in paper.read("claims")["command"] if isinstance(c, str)})


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_works_without_a_run(command: str) -> None:
    """What reads a run that is there already fails in a fresh clone. A script takes the options named."""
    program, *options = command.split()
    if program == "make":
        (name,) = options
        assert name in experiment.find_all() or f"\n{name}:" in (ROOT / "Makefile").read_text()
        return
    assert (ROOT / program).is_file()
    parser = commands.parser_of(commands.find_all()[options[0]])
    assert "[RUN]" not in parser.format_usage()
    known = parser._option_string_actions
    assert all(word in known for word in options if word.startswith("--"))
