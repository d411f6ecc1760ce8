"""stepwise functions, build/functions/bench: bounds are published figures or theory, no time is judged."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from fractions import Fraction

import msgspec
import numpy as np
import pytest
from mpmath import mp

from study.experiments.functions import coefficients, edges
from study.experiments.functions import measure as functions
from study.experiments.functions.schema import Entry
from study.measuring import function_bench

pytestmark = pytest.mark.slow

QUICK_STRIDE = 12289  # of common/functions/exhaustive.c
# One in 16, at another place of each 16: every value of the upper 20 bits, in both exponents.
ONE_TO_FOUR = np.arange(0x3F800000, 0x40800000, 16, dtype=np.uint32)
ONE_TO_FOUR = (ONE_TO_FOUR + np.arange(len(ONE_TO_FOUR), dtype=np.uint32) * 7 % 16).view(np.float32)

# Largest errors in ulp of what is stated of each: the GNU C Library's manual, "Known maximum errors in math
# functions" (x86-64: 1 ulp of the rounded result, so 1.5 of the exact one) and libmvec's (4); SLEEF's names.
STATED = {"libm": 1.5, "libmvec": 4.0, "SLEEF u10": 1.0, "SLEEF u35": 3.5}
# Ours, by theory: reduction, polynomial and last rounding make less than this. pow is said apart.
OWN = {"exp": 1.2, "log": 1.0, "sin": 1.6, "cos": 1.6, "atan2": 2.5, "acos": 1.6}
# C. Lomont, "Fast inverse square root" (2003): largest relative errors of 0x5f375a86, 0 to 2 steps.
LOMONT = (0.0343655, 0.00175124, 4.65437e-6)


@pytest.fixture(scope="module")
def rows() -> list[Entry]:
    """Every entry with its errors (quick)."""
    found, *_ = functions.entries()
    functions.add_errors(found, True, 2, 1)
    return found


def entry(rows: list[Entry], function: str, name: str, isa: str, precision: str = "float") -> Entry:
    wanted = (function, name, isa, precision)
    row = next(r for r in rows if (r.function, r.name, r.isa, r.precision) == wanted)
    if row.missing:
        pytest.skip(f"{name}, {isa}: {row.missing}")
    return row


def relative_errors(row: Entry) -> np.ndarray:
    exact = 1 / np.sqrt(ONE_TO_FOUR.astype(np.float64))
    return np.abs(functions.evaluate(row, ONE_TO_FOUR).astype(np.float64) / exact - 1)


# --- Errors


def ulp_error(got: float, numerator: int, shift: int) -> Fraction:
    """|got − numerator/2^shift| in ulp of a float of that size, exactly."""
    exponent = numerator.bit_length() - 1 - shift
    ulp = Fraction(2) ** (max(exponent, -126) - 23)
    return abs(Fraction(got) - Fraction(numerator, 1 << shift)) / ulp


@pytest.mark.parametrize("name", ["1/sqrt", "rsqrtss + 1", "Lomont + 2"])
def test_the_largest_error_is_that_of_whole_number_arithmetic(rows: list[Entry], name: str) -> None:
    """1/√x to 2⁻¹⁶⁰ by integer square roots; every 7th of the quick run's arguments, and its worst one."""
    row = entry(rows, "rsqrt", name, "scalar")
    bits = np.arange(0x00800000, 0x7F800000, QUICK_STRIDE, dtype=np.uint32)
    assert row.count == len(bits)
    some = np.append(bits[::7], np.float32(row.worst_a).view(np.uint32))
    some = np.append(some, np.repeat(some[-1], -len(some) % 16)).astype(np.uint32)
    arguments = some.view(np.float32)
    values = functions.evaluate(row, arguments)
    errors = []
    for a, value in zip(arguments.tolist(), values.tolist(), strict=True):
        top, bottom = a.as_integer_ratio()  # 1/√a = √(bottom/top)
        root = math.isqrt((bottom << 320) // top)
        errors.append(ulp_error(value, root, 160))
    assert float(max(errors)) == pytest.approx(row.max_ulp, abs=2**-27)
    assert float(errors[-1]) == pytest.approx(row.max_ulp, abs=2**-27)
    rms = math.sqrt(sum(float(e) ** 2 for e in errors[: len(bits[::7])]) / len(bits[::7]))
    assert rms == pytest.approx(row.rms_ulp, rel=0.02)


def test_square_roots_are_exactly_rounded(rows: list[Entry]) -> None:
    """IEEE 754: half an ulp; 2⁻²⁷ is the reference's own error."""
    exact = [r for r in rows if r.function == "sqrt" and r.name in ("sqrt", "libm") and r.count]
    assert len(exact) >= 2
    for row in exact:
        assert 0.49 < row.max_ulp <= 0.5 + 2**-27, row


def test_libraries_keep_their_bounds(rows: list[Entry]) -> None:
    judged = [r for r in rows if r.name in STATED and r.count]
    assert {"libm"} <= {r.name for r in judged}
    for row in judged:
        assert row.max_ulp is not None and row.max_ulp <= STATED[row.name], row
        assert row.non_finite == 0


@pytest.mark.parametrize("precision", ["float", "double"])
def test_own_functions_keep_their_bounds(rows: list[Entry], precision: str) -> None:
    own = [r for r in rows if r.family == "own" and r.precision == precision and r.count]
    if not own:
        pytest.skip("no AVX2 or no MPFR here")
    for row in own:
        if row.function == "pow":  # (2 + |b·ln a|) ulp of relative error, and two to an ulp
            largest = 12 if precision == "float" else 100
            bound = 2 * (2 + largest * 10 * math.log(2))
        else:
            bound = OWN[row.function]
        assert row.non_finite == 0 and row.max_ulp <= bound, row
        assert row.max_ulp > 0.49  # nothing is exact


@pytest.mark.parametrize(("steps", "published"), list(enumerate(LOMONT)))
def test_the_bit_trick_has_the_published_error(rows: list[Entry], steps: int, published: float) -> None:
    """The published errors are of real arithmetic: floats add their rounding."""
    error = relative_errors(entry(rows, "rsqrt", f"Lomont + {steps}", "scalar")).max()
    assert error == pytest.approx(published, rel=1e-5, abs=2.5 * 2**-24)


def test_a_corrected_step_halves_the_error_of_the_trick(rows: list[Entry]) -> None:
    """L. Moroz et al.: 8.8e-4 after one corrected step instead of 1.75e-3."""
    assert relative_errors(entry(rows, "rsqrt", "Moroz + 1", "scalar")).max() < 8.8e-4
    assert relative_errors(entry(rows, "rsqrt", "Moroz + 2", "scalar")).max() < LOMONT[2] / 4


def test_newton_squares_the_error(rows: list[Entry]) -> None:
    """y(1 + δ) → y(1 − 3δ²/2 − δ³/2), plus the roundings of four operations."""
    first = relative_errors(entry(rows, "rsqrt", "rsqrtps + 0", "SSE")).max()
    second = relative_errors(entry(rows, "rsqrt", "rsqrtps + 1", "SSE")).max()
    assert second <= 1.5 * first**2 + 0.5 * first**3 + 4 * 2**-24
    assert second >= 1.5 * first**2


# --- Edges


def test_libm_is_right_at_every_edge(rows: list[Entry]) -> None:
    """The table of expected values against an implementation of C's Annex F."""
    libm = [r for r in rows if r.family == "libm"]
    functions.add_edges(libm)
    wrong = [(r.function, e) for r in libm for e in r.edges if not e.right]
    assert wrong == []
    assert {r.function for r in libm} == set(functions.FUNCTIONS)


def test_rsqrt_of_zero_is_lost_by_newton(rows: list[Entry]) -> None:
    """∞·0 in the step: NaN, where the instruction itself gives infinity."""
    for steps, value, good in ((0, "∞", True), (1, "NaN", False)):
        row = entry(rows, "rsqrt", f"rsqrtps + {steps}", "SSE")
        functions.add_edges([row])
        assert (row.edges[0].argument, row.edges[0].value) == ("0", value)
        assert row.edges[0].right == good


RIGHT = [(0.0, 0.0), (math.nan, math.nan), (math.inf, math.inf)]
RIGHT += [(1.04, mp.mpf(1)), (math.inf, mp.mpf(10) ** 39), (0.0, mp.mpf(10) ** -60)]
WRONG = [(-0.0, 0.0), (math.nan, 0.0), (1.0, math.nan), (-math.inf, math.inf), (3e38, math.inf)]
WRONG += [(1.06, mp.mpf(1)), (1e-44, mp.mpf(10) ** -60), (math.nan, mp.mpf(1))]


def test_a_value_is_right_by_its_sign_its_size_and_its_kind() -> None:
    assert all(edges.right(value, exact, "float") for value, exact in RIGHT)
    assert not any(edges.right(value, exact, "float") for value, exact in WRONG)


# --- Dispatch


def test_nothing_of_a_wider_set_runs_without_it() -> None:
    """On an emulated CPU without AVX: wide entries name what is missing, and the rest runs."""
    if not shutil.which("qemu-x86_64"):
        pytest.skip("qemu-x86_64 is missing")
    command = ["qemu-x86_64", "-cpu", "Nehalem", str(function_bench.program())]
    listed = json.loads(subprocess.run([*command, "list"], capture_output=True, check=True).stdout)
    found = msgspec.convert(listed["entries"], list[Entry])
    wide = [r for r in found if r.isa in ("AVX2", "AVX-512")]
    assert wide and all(r.missing for r in wide)
    assert [r for r in found if r.isa == "SSE" and not r.missing]
    words = [*command, "evaluate", "--id", str(wide[0].id)]
    refused = subprocess.run(words, capture_output=True, text=True, input="")
    assert (refused.returncode, refused.stdout) == (2, "") and refused.stderr.count("\n") == 1
    words = [*command, "normalise", "--vectors", "1024", "--rounds", "1"]
    ran = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
    found = {row["isa"] for row in ran["rows"]}
    assert found == {"scalar", "SSE"}


# --- Own coefficients


def test_the_coefficients_are_those_derived() -> None:
    assert coefficients.FILE.read_text() == coefficients.header()


# --- Normalisation


def test_normalised_vectors_are_of_unit_length() -> None:
    """Three roundings below the root, 1/√ and the product: under 4.5 ulp; the Newton step's own included."""
    found = function_bench.normalise(1024, 1, 3, None)
    checked = [r for r in found if r.name != "no arithmetic"]
    assert {"AoS", "SoA"} == {r.layout for r in checked}
    for row in checked:
        assert 0.5 < row.max_ulp < 4.5 and row.bytes == 12288
    bare = [r for r in found if r.name == "no arithmetic"]
    assert bare and all(r.max_ulp is None and r.share_of_memory == 1 for r in bare)
