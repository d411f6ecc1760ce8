"""scripts/stepwise functions: fronts, edges, what is missing, the command, its tables and figures."""

from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from study.core import cli, commands, show, store
from study.experiments.functions import edge_tables, experiment, figures, tables
from study.experiments.functions import measure as functions
from study.experiments.functions.schema import FILE, Edge, Entry, Functions
from study.numbers.schema import Range

ASKED = (("0", "∞"), ("−1", "NaN"), ("∞", "0"))  # 1/√x, by IEEE 754's rSqrt


def entry(name: str, isa: str, stream: float, latency: float, ulp: float | None, *at: str) -> Entry:
    """An entry of 1/√x; `at`: what it gives at 0, −1, ∞."""
    times = {
        key: Range(value=ns, low=ns, high=ns) for key, ns in (("stream_ns", stream), ("latency_ns", latency))
    }
    edges = [
        Edge(argument=a, value=v, exact=e, right=v == e)
        for (a, e), v in zip(ASKED, at or ("∞", "NaN", "0"), strict=True)
    ]
    about = {"function": "rsqrt", "precision": "float", "isa": isa, "bits": 128, "count": 16}
    family = "libm" if name == "libm" else "instruction"
    return Entry(name=name, family=family, max_ulp=ulp, edges=edges, **about, **times)


# libm: alone on the front of latency; fast and near: on that of throughput, whose Newton step loses 0.
LIBM = entry("libm", "scalar", 2.0, 5.0, 0.5)
NEAR = entry("rsqrtps + 1", "AVX2", 1.0, 9.0, 2.5, "NaN", "NaN", "0")
NARROW = entry("rsqrtps + 1", "SSE", 1.5, 9.5, 2.5, "NaN", "NaN", "0")
TRICK = entry("Lomont + 0", "SSE", 1.2, 6.0, 5e5, "1.3212e+19", "3.2879e+38", "0")
NOISE = entry("noise", "SSE", 3.0, -0.1, 0.4)  # nearest; its latency is within the chain's own noise


def result(*entries: Entry) -> Functions:
    return Functions(schema=1, quick=True, entries=list(entries))


def test_front() -> None:
    def made(ns: float, ulp: float | None, function: str = "exp") -> Entry:
        return msgspec.structs.replace(entry("x", "SSE", ns, ns, ulp), function=function)

    rows = [made(1, 9.0), made(5, 0.5), made(5, 9.0), made(3, 2.0), made(3, 2.0), made(0.1, None)]
    rows += [made(9, 9.0, "log"), made(4, 2.0), made(3, 3.0)]
    functions.mark_front(rows)
    assert [r.front for r in rows] == [True, True, False, True, True, False, True, False, False]


def test_fronts_of_throughput_and_of_latency_are_told_apart() -> None:
    fronts = {r.name: r.fronts for r in tables.fronts(result(LIBM, NEAR, TRICK, NOISE))}
    one = ["throughput"]
    assert fronts == {"libm": [*one, "latency"], "rsqrtps + 1": one, "noise": one}


def test_what_is_missing_is_said_once() -> None:
    lacking = msgspec.structs.replace(LIBM, family="SLEEF", missing="libsleef.so.3 is not installed")
    said = functions.without([lacking, lacking], False)
    assert len(said) == 2 and said[0].startswith("SLEEF") and "2 entries" in said[0]
    broken = msgspec.structs.replace(LIBM, non_finite=3)
    assert len(functions.wrong([broken, LIBM])) == 1


def test_edges_show_only_who_differs_and_where(tmp_path: Path) -> None:
    store.write_json(tmp_path / FILE, cli.plain(result(LIBM, NEAR, NARROW, TRICK)))
    parts = {part.name: part for part in experiment.section(SimpleNamespace(path=tmp_path)).parts}
    table = parts["functions-edges"].table
    assert [column.name for column in table.columns[2:]] == ["0", "−1"]  # ∞: all agree
    assert [[text for text, _ in row[1:]] for row in table.cells] == [
        [edge_tables.ASKED, "∞", "NaN"],
        ["rsqrtps + 1 (AVX2, SSE)", "NaN", edge_tables.AGREES],
        ["Lomont + 0 (SSE)", "1.32e+19", "3.29e+38"],
    ]
    marks = [["bad" in mark.split() for _, mark in row[2:]] for row in table.cells]
    assert marks == [[False, False], [True, False], [True, True]]
    assert "1 of 4" in parts["functions-edges"].caption
    alone = result(LIBM)
    assert all(edge_tables.rows(alone, of) == [] for of in edge_tables.TABLES.values())
    values = {"−5.3419e-155": "−5.34e−155", "0.0049620": "0.00496", "NaN": "NaN", "−∞": "−∞", "−0": "−0"}
    assert {text: edge_tables.short(text) for text in values} == values


def test_both_precisions_and_both_times_have_a_figure() -> None:
    made = figures.drawings(result(LIBM, NEAR, NOISE))
    assert list(made) == [f"functions-{p}{time}" for time in ("", "-latency") for p in ("float", "double")]
    figure = made["functions-float-latency"].make()
    drawn = sorted(tuple(marks.get_offsets()[0]) for marks in figure.axes[1].collections)
    assert drawn == [(0.5, 5.0), (2.5, 9.0)]
    named = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"libm", "instruction", "scalar", "AVX2"} <= named and "AVX-512" not in named


@pytest.mark.slow
@pytest.mark.usefixtures("rough_figures")
def test_the_command_and_its_chapter(tmp_path: Path) -> None:
    words = ["--quick", "--rounds", "6", "--vectors", "1024", "--seed", "1", "--run", str(tmp_path)]
    assert commands.called("functions", words)[0].ended == 0
    found = Functions.load(tmp_path / FILE)
    assert {r.function for r in found.entries} == set(functions.FUNCTIONS)
    names = [f"functions-{p}{time}" for p in ("float", "double") for time in ("", "-latency")]
    drawn = {f.name for f in (tmp_path / "figures").iterdir()}
    assert drawn == {f"{name}.{kind}" for name in names for kind in ("svg", "png")}
    assert all(r.ns("stream_ns") > 0 and r.edges for r in found.entries if not r.missing)
    parts = {part.name: part.markdown for part in experiment.section(SimpleNamespace(path=tmp_path)).parts}
    assert all(tables.TITLES[function] in parts["functions"] for function in functions.FUNCTIONS)
    assert parts["normalise"].count("SSE") >= 3 and "18.35×" in parts["normalise"]
    assert show.markdown(show.table(found.entries, tables.ENTRIES)) == parts["functions-all"]
