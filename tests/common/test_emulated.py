"""Sixteen lanes without AVX-512 (tests/emulate): each emulated intrinsic against numpy and, where the CPU has
it, against the true one; where it has not, what phases draw by them, 16 lanes against 8.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from emulated import SHIM, SIMDE, TRUE, needs_emulation, needs_sixteen, sixteen

from study.core import registry
from study.core.build import build
from study.core.registry import ROOT
from study.pictures import images

pytestmark = pytest.mark.slow

LANES = np.arange(16)
GIVEN = np.dtype(
    [(name, "f4", 16) for name in "abc"]
    + [("d", "f8", 8), ("p", "i8", 8), ("q", "i8", 8), ("at", "i4", 16), ("k", "u4"), ("l", "u4")]
)
SPECIAL = [0.0, -0.0, np.inf, -np.inf, np.nan, 1e-45, -1e-40, 2.0**-126, 1.5, 0.75, -1.0, 2.5, -0.5, 3.4e38]
SPECIAL += [2.0**31, -(2.0**31), 1 - 2.0**-24, 1e9, 0.5, 3.5, 1.4999999]


def given() -> np.ndarray:
    """Ordinary numbers, any bits, and special values against each other, each block with its mask."""
    random = np.random.default_rng(512)
    all_ = np.zeros(240, GIVEN)
    for name in "abc":
        all_[name] = random.normal(size=(240, 16)) * 2.0 ** random.integers(-12, 12, (240, 16))
        all_[name][80:160] = random.integers(0, 2**32, (80, 16), np.uint32).view(np.float32)
        all_[name][160:] = random.choice(np.float32(SPECIAL), (80, 16))
    all_["d"] = np.abs(random.normal(size=(240, 8))) * 2.0 ** random.integers(-80, 80, (240, 8))
    all_["d"][:4] = [0.0, -0.0, np.inf, 2.0**-1040, 4.0, -1.0, -2.5, 1e300]
    all_["p"] = random.integers(-(2**63), 2**63 - 1, (240, 8))
    all_["q"] = random.integers(-(2**63), 2**63 - 1, (240, 8))
    all_["q"][::2] = random.integers(-3, 70, (120, 8))  # lengths of shifts, and beyond
    all_["at"] = random.integers(-(2**31), 2**31 - 1, (240, 16))
    for name in "kl":
        all_[name] = random.integers(0, 2**16, 240)
        all_[name][:3] = [0, 0xFFFF, 0x8000]
    return all_


def program(folder: Path, compiler: str, *flags: str | Path) -> Path:
    path = folder / f"each-{compiler}-{len(flags)}"
    words = [compiler, "-std=c11", "-D_GNU_SOURCE", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
    done = subprocess.run(
        [*words, *map(str, flags), str(SHIM / "each.c"), "-lm", "-o", str(path)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return path


def rows_of(path: Path, blocks: np.ndarray) -> dict[str, np.ndarray]:
    """Of each intrinsic the 64 bytes of every block."""
    names = subprocess.run([path, "names"], capture_output=True, text=True, check=True).stdout.split()
    done = subprocess.run([path], input=blocks.tobytes(), capture_output=True)
    assert done.returncode == 0, f"{done.returncode}: an inactive lane's memory was touched?"
    rows = np.frombuffer(done.stdout, np.uint8).reshape(len(blocks), len(names), 64)
    return {name: rows[:, i] for i, name in enumerate(names)}


def fused(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """a·b + c of floats, rounded once: in double to odd (Boldo and Melquiond, 2008), then to float."""
    product, c = a.astype(float) * b.astype(float), c.astype(float)
    high = product + c
    back = high - product
    low = (product - (high - back)) + (c - back)
    odd = np.nextafter(high, np.where(low > 0, np.inf, -np.inf))
    exact = (low == 0) | ~np.isfinite(low) | (high.view(np.int64) & 1 == 1)
    return np.where(exact, high, odd).astype(np.float32)


def fused_double(d: np.ndarray) -> np.ndarray:
    """3/2·d - 1/3 (the double) of doubles, rounded once."""
    third = Fraction(-1.0 / 3)
    one = [float(Fraction(x) * Fraction(3, 2) + third) if np.isfinite(x) else x for x in d.ravel().tolist()]
    return np.array(one).reshape(d.shape)


def whole(value: np.ndarray) -> np.ndarray:
    fits = (value >= -(2.0**31)) & (value < 2.0**31)
    return np.where(fits, np.rint(np.where(fits, value, 0)).astype(np.int64), -(2**31)).astype(np.int32)


def bits16(value: np.ndarray) -> np.ndarray:
    return value.astype(np.uint16)


def packed(bits: np.ndarray) -> np.ndarray:
    return (bits.astype(np.uint32) << np.arange(bits.shape[1], dtype=np.uint32)).sum(1).astype(np.uint16)


def by_numpy(g: np.ndarray) -> dict[str, np.ndarray]:
    """What Intel's manual defines, block by block; not of rsqrt14 and rcp14."""
    a, b, c, d, p, q, at, k, l_ = (g[name] for name in GIVEN.names)
    on, u = (k[:, None] >> LANES & 1).astype(bool), np.uint32
    p32, q32 = (np.ascontiguousarray(x).view(np.int32) for x in (p, q))
    fraction, exponent = np.frexp(np.where(np.isfinite(a), a, 1).astype(float))
    half, by = np.abs(2 * fraction), q.view(np.uint64)
    mant = np.copysign(np.where(half >= 1.5, half / 2, half), a)
    mant = np.where(np.isnan(a), a, np.where((a == 0) | np.isinf(a), np.copysign(1, a), mant))
    getexp = np.where(a == 0, -np.inf, np.where(np.isfinite(a), exponent - 1, np.abs(a)))
    nan_last, order = np.where(on, LANES, 99).argsort(1, kind="stable"), np.cumsum(on, 1) - 1
    full = on.sum(1)[:, None] > LANES
    squeezed = np.where(full, np.take_along_axis(a, nan_last, 1), np.float32(0))
    both, index = np.concatenate([a, b], 1), np.where(order < 0, 0, order)
    fitting, sixteenths = by < 64, (k | l_) & 0xFFFF
    low = np.where(fitting, by, 0).astype(np.uint64)
    insert = a.copy()
    insert[:, 8:12] = b[:, :4]
    highest = np.where(on.any(1), 16 - on[:, ::-1].argmax(1), 0)[:, None]
    return {
        "mul_add_operators": a * b + c,
        "add_ps": a + b,
        "mask_add_ps": np.where(on, a + b, c),
        "min_ps": np.where(a < b, a, b),
        "max_ps": np.where(a > b, a, b),
        "and_ps": a.view(u) & b.view(u),
        "or_ps": a.view(u) | b.view(u),
        "andnot_ps": ~a.view(u) & b.view(u),
        "mask_xor_ps": np.where(on, a.view(u) ^ b.view(u), c.view(u)),
        "mask_blend_ps": np.where(on, b.view(u), a.view(u)),
        "maskz_mov_ps": np.where(on, a.view(u), 0),
        "fmadd_ps": fused(a, b, c),
        "fmsub_ps": fused(a, b, -c),
        "fnmadd_ps": fused(-a, b, c),
        "mask_fmadd_ps": np.where(on, fused(a, b, c), a),
        "sqrt_ps": np.sqrt(a),
        "floor_ps": np.floor(a),
        "roundscale_ps": np.rint(a),
        "getexp_ps": getexp.astype(np.float32),
        "getmant_ps": mant.astype(np.float32),
        "cmp_lt": packed(a < b),
        "cmp_gt": packed(a > b),
        "cmp_ge": packed(a >= b),
        "cmp_eq": packed(a == b),
        "mask_cmp_ngt": packed(on & ~(a > b)),
        "maskz_compress_ps": squeezed.view(u),
        "mask_expand_ps": np.where(on, np.take_along_axis(a.view(u), index, 1), b.view(u)),
        "cvtss_f32": a[:, :1],
        "extractf32x8_ps": a[:, 8:].view(u),
        "castps512_ps256": a[:, :8].view(u),
        "insertf32x8": np.concatenate([a[:, :8], b[:, :8]], 1).view(u),
        "insertf32x4": insert.view(u),
        "cvtps_epi32": whole(a),
        "cvtps_pd": a[:, :8].astype(float),
        "movepi32_mask": packed(np.signbit(a)),
        "cvtepi32_ps": p32.astype(np.float32),
        "cvtepi64_pd": p.astype(float),
        "add_epi32": p32 + q32,
        "sub_epi32": p32 - q32,
        "mask_add_epi32": np.where(on, p32 + p32, q32),
        "maskz_compress_epi32": np.where(full, np.take_along_axis(p32, nan_last, 1), 0),
        "mask_expand_epi32": np.where(on, np.take_along_axis(p32, index, 1), q32),
        "add_epi64": p + q,
        "sub_epi64": p - q,
        "mul_epi32": p32[:, ::2].astype(np.int64) * q32[:, ::2],
        "and_si512": p & q,
        "or_si512": p | q,
        "slli_epi32": p32 << 23,
        "srli_epi32": p32.view(u) >> 23,
        "sllv_epi64": np.where(fitting, p.view(np.uint64) << low, 0).astype(np.uint64),
        "srlv_epi64": np.where(fitting, p.view(np.uint64) >> low, 0).astype(np.uint64),
        "srav_epi64": np.where(fitting, p >> low.astype(np.int64), np.where(p < 0, -1, 0)),
        "mask_blend_epi64": np.where(on[:, :8], q, p),
        "cmplt_epi64": packed(p < q),
        "test_epi32": packed((p32 & q32) != 0),
        "test_epi64": packed((p & q) != 0),
        "permutex2var_ps": np.take_along_axis(both.view(u), at.astype(np.int64) & 31, 1),
        "permutexvar_ps": np.take_along_axis(a.view(u), at.astype(np.int64) & 15, 1),
        "i32gather_ps": np.take_along_axis(a.view(u), at.astype(np.int64) & 15, 1),
        "i64gather_epi64": np.take_along_axis(q, p & 7, 1),
        "cvtpd_ps": d.astype(np.float32),
        "add_pd": d + 1.5,
        "sqrt_pd": np.sqrt(d),
        "floor_pd": np.floor(d),
        "kand16": bits16(k & l_),
        "kandn16": bits16(~k & l_),
        "kor16": bits16(k | l_),
        "knot16": bits16(~k),
        "kand8": bits16(k & l_ & 255),
        "kandn8": bits16(~k & l_ & 255),
        "kor8": bits16((k | l_) & 255),
        "cvtmask16_u32": k,
        "kortestz16": bits16(sixteenths == 0),
        "kortestc16": bits16(sixteenths == 0xFFFF),
        "kortestz8": bits16(sixteenths & 255 == 0),
        "mask_expandloadu_ps": np.where(on, np.take_along_axis(c.view(u), index, 1), b.view(u)),
        "mask_storeu_ps": np.where(highest > LANES, np.where(on, a.view(u), c.view(u)), 0),
        "stream_ps": a.view(u),
        "fmadd_pd": fused_double(d),
        "fnmadd_pd": fused_double(-d),
    }


def same_or_nan(made: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Bit by bit; of floats a NaN as another: which one an operation hands on is not asked for."""
    made = np.ascontiguousarray(made).view(wanted.dtype)[:, : wanted.shape[1]]
    unsigned = f"u{wanted.dtype.itemsize}"
    same = made.view(unsigned) == np.ascontiguousarray(wanted).view(unsigned)
    return same | (np.isnan(made) & np.isnan(wanted)) if wanted.dtype.kind == "f" else same


def test_other_headers_to_emulate_by_build_anew(tmp_path: Path) -> None:
    """Of SIMDe any header, whose age says nothing; what is as it was is left alone. Phases and the intrinsics
    that are parsed once hang on it (rules.mk)."""
    header = tmp_path / "include" / "simde" / "x86" / "avx512" / "add.h"
    header.parent.mkdir(parents=True)
    made = tmp_path / "build" / "common" / "emulated_by"

    def said(text: str, seconds: int) -> tuple[str, int]:
        header.write_text(text)
        os.utime(header, (seconds, seconds))
        words = ["make", "-s", "-C", registry.ROOT, "EMULATE=1", f"BUILD={tmp_path / 'build'}"]
        words += [f"SIMDE_INCLUDE={tmp_path / 'include'}", made]
        subprocess.run([str(word) for word in words], check=True, capture_output=True)
        return made.read_text(), made.stat().st_mtime_ns

    first = said("0.7.4", 2_000_000)
    assert said("0.7.4", 2_000_000) == first
    older = said("0.7.2", 1_000_000)
    longer = said("0.7.2.", 1_000_000)
    assert len({text for text, _ in (first, older, longer)}) == 3


def check_14_bits(made: np.ndarray, exact: np.ndarray, normal: np.ndarray) -> None:
    made = np.ascontiguousarray(made).view(exact.dtype)[:, : exact.shape[1]].astype(float)
    exact = exact.astype(float)
    with np.errstate(all="ignore"):
        near = np.abs(made - exact) < 2.0**-14 * np.abs(exact)
    equal = (made == exact) & (np.signbit(made) == np.signbit(exact))
    assert ((near & normal) | equal | (np.isnan(made) & np.isnan(exact)) | ~normal).all()
    assert (equal | (np.isnan(made) & np.isnan(exact)) | np.isfinite(exact)).all()


# Of which there is nothing to hold: constants, memory as it is, bits taken for another type.
PLAIN = re.compile(r"_mm512_(set(1|r|zero)_|(loadu|storeu)_|cast(ps|pd|si512)\d*_)")
WIDE = re.compile(r"\b(_mm512_\w+|_k\w+_mask\w+|_cvt\w*mask\w+)\(")


def test_every_intrinsic_of_512_bits_that_the_phases_use_is_held() -> None:
    """Else only a machine without AVX-512 finds out, where the build fails."""
    used = {
        name
        for folder in ("phases", "systems", "common/simd")
        for path in (ROOT / folder).rglob("*.[ch]")
        for name in WIDE.findall(path.read_text())
        if not PLAIN.match(name)
    }
    held = set(WIDE.findall((SHIM / "each.c").read_text()))
    assert len(used) > 50 and used <= held, used - held


@pytest.mark.skipif(not SIMDE.exists(), reason="SIMDe (libsimde-dev) is not here: nothing is emulated")
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_each_intrinsic_is_what_the_manual_says(compiler: str, tmp_path: Path) -> None:
    if not registry.cpu_flags() >= {"avx2", "fma"}:
        pytest.skip("the CPU lacks avx2 and fma")
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is missing")
    blocks = given()
    made = rows_of(program(tmp_path, compiler, "-mavx2", "-mfma", "-Wno-psabi", "-isystem", SHIM), blocks)
    with np.errstate(all="ignore"):
        wanted = by_numpy(blocks)
        a, d, root = blocks["a"], blocks["d"], np.sqrt
        inverse, inverse_root = 1 / a.astype(float), 1 / root(a.astype(float))
    rough = {"rsqrt14_ps", "rsqrt14_pd", "rcp14_ps"}
    assert made.keys() == wanted.keys() | rough | {"reduce_min_ps", "reduce_max_ps"}
    for name, value in wanted.items():
        value = value.reshape(len(blocks), -1)
        same = same_or_nan(made[name], value)
        assert same.all(), (name, np.argwhere(~same)[:4])
    with np.errstate(all="ignore"):
        small, large = np.abs(a) >= 2.0**-126, np.abs(a) <= 2.0**126
        check_14_bits(made["rcp14_ps"], inverse.astype(np.float32), small & large | (a == 0) | np.isinf(a))
        check_14_bits(made["rsqrt14_ps"], inverse_root.astype(np.float32), np.full(a.shape, True))
        check_14_bits(made["rsqrt14_pd"], 1 / root(d), np.full(d.shape, True))
    # Which of a NaN and a number a reduction returns is the compiler's choice: it may reorder the lanes.
    numbers = ~np.isnan(blocks["b"]).any(axis=1)
    reductions = {"reduce_min_ps": np.min, "reduce_max_ps": np.max}
    for name, most in reductions.items():
        one = np.ascontiguousarray(made[name][:, :4]).view(np.float32)[numbers, 0]
        assert np.array_equal(one, most(blocks["b"][numbers], axis=1)), name
    if TRUE:
        true = rows_of(program(tmp_path, compiler, "-mavx512f", "-mavx512dq"), blocks)
        for name in made.keys() - rough:
            kind = wanted[name].dtype if name in wanted else np.dtype(np.float32)
            rows = np.ascontiguousarray(true[name]).view(kind)
            held = numbers if name in reductions else np.full(len(blocks), True)
            assert same_or_nan(made[name], rows)[held].all(), f"{name}: not what the CPU does"


def picture(program: Path, path: Path, folder: Path, limit: str) -> tuple[dict, dict]:
    out = folder / "picture.exr"
    width = "61" if "mandelbulb" in path.stem else "64"  # of which rows may go past the caches
    words = [program, path, "-w", width, "-n", "33", "--aov", "--json", "-o", out]
    environment = os.environ | {"STEPWISE_ISA_LIMIT": limit, "STEPWISE_UNTIMED": "1"}
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return images.read(out), json.loads(done.stdout)


# opt9_convex's 16 lanes are opt10_scene's; packets and opt6_wide are drawn by tests of their own.
PHASES = {
    "opt7_tiles": ["scene0", "trio", "spheres40", "cubes"],
    "opt8_streams": ["scene0", "trio", "mandelbulb", "cubes"],
    "opt10_scene": ["scene0", "trio", "mandelbulb", "cubes", "lattice", "spheres40"],
    "opt11_ideal": ["scene0", "trio", "mandelbulb", "cubes", "spheres40"],
    "rods_simd": ["two_spheres", "trio"],
    "fixed_simd": ["spheres40"],
    "fixed_float": ["spheres40"],
}
ULP = {("opt10_scene", "trio"): 6e-8}  # a few pixels' colours by the last bit, 16 lanes against 8
ULP |= {("opt11_ideal", scene): 4e-6 for scene in ("scene0", "trio")}  # where a search ends (room_for)


@needs_emulation
@pytest.mark.parametrize("phase", [pytest.param(name, id=f"{name}, 16 lanes emulated") for name in PHASES])
def test_sixteen_lanes_draw_what_eight_draw(phase: str, tmp_path: Path) -> None:
    for name in PHASES[phase]:
        path = registry.scenes()[name].path
        eight, _ = picture(build(phase), path, tmp_path, "avx2")
        wide, record = picture(sixteen(phase), path, tmp_path, "")
        assert record["lanes"] == 16 and record["isa"] == "avx2+fma, 16 lanes emulated"
        assert "avx512" not in record["flags"]
        if name == "mandelbulb":  # reciprocal roots differ: what is seen does not
            assert (wide["id"] == eight["id"]).mean() > 0.999
            hit = eight["id"] >= 0
            assert (np.abs(wide["Z"] - eight["Z"])[hit & (wide["id"] >= 0)] < 1e-3).mean() > 0.999
            off = np.abs(images.rgb(wide) - images.rgb(eight)).max(-1)
            assert np.isfinite(off).all() and np.mean(off > 1 / 255) < 0.002  # 4 pixels of 2,013; 1 seen
            continue
        for plane in eight:
            allowed = ULP.get((phase, name), 0) if plane in "RGB" else 0
            with np.errstate(invalid="ignore"):
                apart = np.abs(np.where(wide[plane] == eight[plane], 0, wide[plane] - eight[plane]))
            assert (apart <= allowed).all(), (name, plane, apart.max())


@needs_emulation
def test_an_emulated_build_takes_eight_where_it_must(tmp_path: Path) -> None:
    _, record = picture(sixteen("fixed_float"), registry.scenes()["spheres40"].path, tmp_path, "avx2")
    assert (record["lanes"], record["isa"]) == (8, "avx2+fma")


@needs_sixteen
@pytest.mark.parametrize("phase", ["opt9_convex", "opt10_scene"])
def test_a_frame_that_is_marched_leaves_nothing_behind_for_the_next(phase: str, tmp_path: Path) -> None:
    """A worker's approaches lie where the next frame's desk is: 16 lanes' of so many shapes on its counts."""
    scene, random = json.loads(registry.scenes()["spheres40"].path.read_text()), np.random.default_rng(3)
    scene["light"]["shadows"] = "soft"
    scene["march"] |= {"max_steps": 300, "max_bounces": 1}
    gone = {"type": "line", "to": [30, 0, 0.5], "period": 0.2}  # in the second frame
    beside = {"type": "box", "half_size": [0.05, 2, 0.05], "position": [0.3, 0, 0.5], "material": "c0"}
    places = random.uniform([-3, -2, 6], [3, 2, 14], (2999, 3)).tolist()
    balls = [{"type": "sphere", "radius": 0.05, "position": place, "material": "c1"} for place in places]
    scene["shapes"] = [beside | {"path": gone}, *balls]
    path = tmp_path / "moving.json"
    path.write_text(json.dumps(scene))
    out = tmp_path / "first.exr"
    words = [sixteen(phase), path, "-w", "4", "-n", "4", "--frames", "2", "--aov", "-o", out]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (images.read(out)["evals"] > 1).all(), "the first frame was not marched: nothing is shown"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["EMULATE=1", "phase-opt6_wide"], "a folder of its own"),
        (["EMULATE=1", "BUILD=build/emulated", "build/emulated/opt6_wide/render-count"], "cannot count"),
    ],
)
def test_it_is_neither_counted_nor_where_a_script_looks(words: list[str], said: str) -> None:
    done = subprocess.run(["make", "-s", "-C", str(registry.ROOT), *words], capture_output=True, text=True)
    assert done.returncode != 0 and said in done.stderr
