"""Where the time goes: perf's output read and refused, what counts as a frame, tables that sum to it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import emitted
import pytest
import started
from hypothesis import given
from hypothesis import strategies as st

from study.bounds import profiles
from study.bounds.profiles import Place
from study.bounds.schema import Beside, Hotspots, Profiled, Share
from study.core import build, registry, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import ROOT
from study.counting import elf, perf
from study.counting.elf import Program, Segment
from study.counting.schema import Function
from study.experiments.hotspots import experiment, tables
from study.experiments.hotspots.command import VARIANTS

pytestmark = pytest.mark.slow

FIXTURES = Path(__file__).parents[2] / "fixtures" / "hotspots"
SCRIPT = (ROOT / "scripts" / "stepwise", "hotspots")
RECORDED = (FIXTURES / "perf-script.txt").read_text()
needs_perf = pytest.mark.skipif(perf.missing() is not None, reason=str(perf.missing()))


# --- perf's output


def test_recorded_samples_and_mappings():
    recording = perf.parse(RECORDED)
    # By grep -c on the file.
    assert (len(recording.samples), len(recording.mappings)) == (67, 8)
    first = recording.samples[10]
    assert (first.name, first.ip, first.period) == ("sdf_cone", 0x556A99B5243B, 1001001)
    assert Path(first.dso).name == "render-calls"
    # 0x556a99b5243b − 0x556a99b4f000 + 0x3000, from the file's first line
    assert recording.place(first) == ("/home/user/stepwise/build/opt2/render-calls", 0x643B)


@pytest.mark.parametrize("text", [RECORDED[:-20] + "\n", "Samples: 178  of event\n", ""])
def test_other_output_is_refused(text):
    with pytest.raises(StudyError, match="perf script"):
        perf.parse(text)


def test_other_records_and_names_with_spaces_are_no_error():
    more = RECORDED + "1/1 1.0: PERF_RECORD_LOST_SAMPLES lost 3\n"
    more += "1/2 1.5:  7 cycles:u:  1000 operator new(int)+0x1 (/a lib/of (deleted))\n"
    last = perf.parse(more).samples[-1]
    assert (last.tid, last.name, last.dso) == (2, "operator new(int)", "/a lib/of (deleted)")


# --- what is of a frame


@pytest.mark.parametrize(
    "kinds, inside",
    [
        ("phase phase", "11"),
        ("other phase libm phase other", "01110"),
        ("libm other phase", "001"),  # set-up: the gamma table
        ("other libm other", "000"),
        ("other phase libm other", "0110"),  # the last pow of a frame
        ("phase library phase", "111"),
        ("phase library other", "100"),  # getrusage after a frame
        ("phase libm library libm phase", "11111"),
    ],
)
def test_only_the_timed_frame_counts(kinds, inside):
    assert profiles.in_frame(kinds.split()) == [one == "1" for one in inside]


def recorded_program() -> Program:
    """Functions where perf saw them: address less the offset in the symbol, in the file's own addresses."""
    seen = re.findall(r"([0-9a-f]+) (\w+)\+0x([0-9a-f]+) \(/home\S+render-calls\)", RECORDED)
    starts = {(int(ip, 16) - int(offset, 16) - 0x556A99B4F000 + 0x3000, name) for ip, name, offset in seen}
    ordered = sorted(starts)
    ends = [start for start, _ in ordered[1:]] + [ordered[-1][0] + 0x1000]
    functions = [
        elf.Function(name, start, end - start) for (start, name), end in zip(ordered, ends, strict=True)
    ]
    phase = frozenset(one.start for one in functions if one.name != "timer_core_hz")
    return Program(Path("render-calls"), functions, [Segment(0, 0, 1 << 20)], of_phase=phase)


def test_profile_of_the_recorded_run():
    made = json.loads((FIXTURES / "driver.json").read_text())
    sampled = profiles.profile(perf.parse(RECORDED), made, recorded_program(), "calls")
    found, functions = sampled.profile, {one.function: one for one in sampled.profile.functions}
    # Counted in the file by hand: 67 samples, of which the loader, the clock (8), the timer (1) and the pow
    # before the first frame are not of one; the second pow is.
    assert found.samples == 56
    outside = {"__vdso_clock_gettime": 8, "_dl_lookup_direct": 1, "pow": 1, "timer_core_hz": 1}
    assert found.left_out == outside
    assert functions["sdf_cone"].samples == 19
    assert functions["pow (libm)"].samples == 1
    assert found.frames == 3
    assert found.frame_ns == sorted(frame["ns"] for frame in made["frames"])[1]
    assert sum(sampled.addresses.values()) == 55 * 1001001
    # 56 samples of 1.001001 ms in 3 frames; cycles by the driver's core clock of 3 GHz.
    assert found.cpu_ns == pytest.approx(56 * 1001001 / 3)
    assert found.core_cycles / found.cpu_ns == pytest.approx(
        made["frames"][1]["core_hz_before"] / 1e9, rel=0.05
    )


def test_cycles_are_taken_for_what_they_are():
    """A PMU's periods are cycles and differ: shares go by them, and so does the time."""
    text = RECORDED.replace("cpu-clock:u", "cycles:u").replace("1001001", "3000000")
    text = re.sub(r"3000000( cycles:u:\s+\w+ sdf_cone)", r"6000000\1", text)
    made = json.loads((FIXTURES / "driver.json").read_text())
    found = profiles.profile(perf.parse(text), made, recorded_program(), "calls").profile
    assert found.event == "cycles" and found.core_cycles == (56 + 19) * 1e6
    assert found.share_of({"sdf_cone"}) == pytest.approx(2 * 19 / (56 + 19))


def sample(i: int, place: str) -> perf.Sample:
    ip = {"phase": 0x1000, "other": 0x2000}.get(place, 0x9000)
    dso = {"libm": "/lib/libm.so.6", "library": "/lib/libc.so.6"}.get(place, "/build/x/render")
    return perf.Sample(1, 1, float(i), 1000, "cpu-clock:u", ip + i % 16, f"f{i % 5}", dso)


@given(st.lists(st.sampled_from(["phase", "libm", "library", "other"]), min_size=1, max_size=60))
def test_listed_and_left_out_are_everything(kinds):
    built = Program(
        Path("/build/x/render"),
        [elf.Function("sdf", 0x1000, 16), elf.Function("main", 0x2000, 16)],
        [Segment(0, 0, 0x9000)],
        of_phase=frozenset({0x1000}),
    )
    mapping = perf.Mapping(1, 0, 0x9000, 0, "/build/x/render")
    recording = perf.Recording([sample(i, kind) for i, kind in enumerate(kinds)], [mapping])
    about = {"phase": "opt2", "flags_from": "opt2", "scene": "scene0", "width": 2, "height": 1}
    frame = {"warmup": False, "ns": 1_000_000, "core_cycles": 3e6}
    about |= {"frames": [frame]}
    if "phase" not in kinds:
        with pytest.raises(StudyError, match="no sample"):
            profiles.profile(recording, about, built, "shipped")
        return
    found = profiles.profile(recording, about, built, "shipped").profile
    listed = sum(one.samples for one in found.functions)
    assert listed == found.samples
    assert listed + sum(found.left_out.values()) == len(kinds)
    assert sum(one.share for one in found.functions) == pytest.approx(1)
    assert sum(one.seconds for one in found.functions) == pytest.approx(found.weight / 1e9)
    # Whatever is shown, a column of the table is the whole frame.
    rows = tables.table_rows(Hotspots(profiles=[found]), shown=2)
    assert sum(row.shipped_percent or 0 for row in rows) == pytest.approx(100)
    assert sum(row.shipped_samples or 0 for row in rows) == listed


# Published: Wilson's interval as in R. G. Newcombe, Statistics in Medicine 17 (1998), table I.
@pytest.mark.parametrize(
    "part, of, low, high", [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0, 0.1611)]
)
def test_interval_of_a_share(part, of, low, high):
    assert profiles.wilson(part, of) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize(
    "symbol, library, name",
    [
        ("sdf_mandelbulb.isra.0", False, "sdf_mandelbulb"),
        ("header.part.0.cold", False, "header"),
        ("vec_norm_sq", False, "vec_norm_sq"),
        ("__sincos_fma", True, "sincos"),
        ("__ieee754_pow_fma", True, "pow"),
        ("sincos@plt", True, "sincos"),
        ("pow@@GLIBC_2.29", True, "pow"),
        ("__log_avx2", True, "log"),
    ],
)
def test_names_as_in_the_source(symbol, library, name):
    assert elf.canonical(symbol, library) == name


def test_inlined_chains_without_the_compilers_headers():
    text = (FIXTURES / "addr2line.txt").read_text()
    chains = elf.parse_addr2line(text)
    assert chains[0x617B] == ["root", "sdf_octahedron", "distance_to_shape", "sdf", "ray_march"]
    assert chains[0x634A][1] == "sdf_cone"


def test_inlined_chains_with_folders_of_a_phase_and_the_vector_library():
    places = {
        "v_pow": "/a/common/simd/powers.h",
        "sdf_cone": "/a/common/packet/distances.h",
        "enter_box": "/a/phases/opt9_convex/hit/solids.h",
        "enter_torus": "/a/build/opt10_scene/source/hit/torus.c",
        "march": "phases/opt4/march.c",
        "_mm512_add_ps": "/usr/lib/gcc/include/avx512fintrin.h",
        "workers_run": "/a/common/workers/workers.c",
    }
    text = "".join(f"{name}\n{place}:7\n" for name, place in places.items())
    assert elf.parse_addr2line(f"0x10\n{text}") == {
        0x10: ["v_pow", "sdf_cone", "enter_box", "enter_torus", "march"]
    }


def test_an_owner_is_the_innermost_that_is_not_folded(monkeypatch):
    chains = {0x10: ["root", "sdf_cone", "sdf"], 0x20: ["root"], 0x30: []}
    monkeypatch.setattr(profiles, "inlined", lambda path, addresses: chains)
    owner = profiles.owners(perf.Recording([], []), recorded_program(), {"root"})
    named = [owner(Place("phase", "ray_march", address)) for address in (0x10, 0x20, 0x30, 0x40)]
    assert named == ["sdf_cone", "root", "ray_march", "ray_march"]


# --- programs


def text_of(path: Path) -> bytes:
    command = ["objcopy", "-O", "binary", "-j", ".text", str(path), "/dev/stdout"]
    return subprocess.run(command, check=True, capture_output=True).stdout


@pytest.mark.parametrize("phase", ["baseline", "opt2", "opt4"])
def test_the_sampled_build_is_the_shipped_code(phase):
    """Line tables add no instruction and move none."""
    build.build(phase), build.build(phase, "render-lines")
    folder = ROOT / "build" / phase
    shipped = text_of(folder / "phase.o")
    assert len(shipped) > 1000
    assert text_of(folder / "lines/phase.o") == shipped


def names_of(phase: str, variant: str) -> set[str]:
    path = build.build(phase, profiles.TARGETS[variant])
    found = elf.read(path, ROOT / "build" / phase / profiles.OBJECTS[variant])
    return {elf.canonical(one.name) for one in found.functions if one.start in found.of_phase}


@pytest.mark.parametrize("phase", ["opt2", "opt3", "opt4"])
def test_without_inlining_every_function_is_one(phase):
    calls, shipped = names_of(phase, "calls"), names_of(phase, "shipped")
    assert {"sdf_cone", "ray_march", "sdf", "soft_shadow", "vec_dot", "vec_norm"} <= calls
    assert "sdf_cone" not in shipped and "vec_dot" not in shipped
    assert "main" not in calls and "frame_create" not in calls


def test_names_for_single_instructions_are_known():
    path = build.build("opt3", "render-calls")
    found = elf.wrappers(elf.read(path, ROOT / "build/opt3/calls/phase.o"))
    assert {"v_madd", "v_select", "v_sqrt", "v_negate_where"} <= found  # each one intrinsic, or two
    assert not {"vec_dot", "vec_norm", "sdf_cone", "sdf_sphere", "phase_render"} & found


# --- tables


def sampled(per_cycle: float = 2.5, **changed) -> Hotspots:
    """A profile of 100 samples: three quarters in sdf, the rest too few for a quotient."""
    functions = [Share(function=name, samples=n, weight=n) for name, n in (("sdf", 75), ("rare", 25))]
    about = {"phase": "baseline", "flags_from": "baseline", "variant": "calls", "scene": "scene0"}
    about |= {"width": 16, "height": 9, "event": "cpu-clock", "frames": 2, "frame_ns": 2e6, "cpu_ns": 2e6}
    about |= {"core_cycles": 1000.0, "samples": 100, "weight": 100, "covered": 1.0, "left_out": {}}
    one = Profiled(**about | changed, functions=functions)
    beside = Beside(per_cycle={"sdf": per_cycle}, lanes_active={})
    return Hotspots(profiles=[one], beside={"scene0|baseline|16|9": beside})


def test_quotients_beside_the_shares():
    """1500 instructions in three quarters of 1000 cycles; 25 samples are too few for a quotient."""
    (one,) = sampled().profiles
    assert tables.per_cycle(one, {"sdf": 1500, "rare": 10, "gone": 5}) == {"sdf": 2.0}
    declared = Function(calls=9, lanes=9, machine=4, useful=3)
    counted = {"sdf": declared, "march": Function(calls=2, lanes=4), "none": Function(calls=0)}
    assert tables.lanes_active(counted, 8) == {"sdf": 0.75, "march": 0.25}


@pytest.mark.parametrize(
    ("per_cycle", "name", "shown"),
    [
        (6.7, "Emerald Rapids", False),
        (6.7, "Zen 5", True),
        (6.7, None, True),
        (9.06, "Zen 5", False),
    ],
)
def test_no_core_runs_more_than_its_width(tmp_path, per_cycle, name, shown):
    store.write_json(tmp_path / "hotspots.json", sampled(per_cycle))
    section = experiment.hot(tmp_path, name)
    row = section.parts[0].rows[0]
    assert (row.function, row.per_cycle) == ("sdf", per_cycle if shown else None)


def test_the_papers_rows_are_beside():
    theirs = tables.theirs("baseline")
    # Table 2a: 8.96 s of apply_transform; its ten rows sum to 27.18 s.
    rotated = theirs["apply_transform"]
    assert rotated["paper_seconds"] == 8.96 and theirs["sincos"]["paper_usage"] == 0.15
    assert rotated["paper_share"] == pytest.approx(8.96 / 27.18)
    assert tables.theirs("opt4") == {}


def test_a_record_is_merged_by_what_it_is_of():
    both = tables.merge(sampled(1), sampled(2, frames=3))
    both = tables.merge(both, sampled(2, phase="opt3"))
    assert [(one.phase, one.frames) for one in both.profiles] == [("baseline", 3), ("opt3", 2)]
    assert both.beside["scene0|baseline|16|9"].per_cycle == {"sdf": 2}


# --- for real


@needs_perf
def test_our_names_are_perfs():
    """perf finds the program's functions its own way: the two must agree on every sample."""
    scene = registry.find_scene("scene0")
    recording, made = perf.record("opt2", scene, 60, None, 20, "render-calls", None)
    path = build.build("opt2", "render-calls")
    built = elf.read(path, ROOT / "build/opt2/calls/phase.o")
    places = [(s, profiles.locate(recording, s, built)) for s in recording.samples]
    ours = [(s, place) for s, place in places if place.address is not None]
    assert len(ours) > 50
    assert [place.name for _, place in ours] == [elf.canonical(s.name) for s, _ in ours]
    assert len(made["frames"]) == 20


@needs_perf
def test_the_script_for_real(tmp_path):
    (tmp_path / "plan.json").write_text("{}")
    command = [sys.executable, *SCRIPT, "--phase", "opt3", "-n", "40", "--samples", "200", "--no-bounds"]
    done = subprocess.run(
        [*command, "--json", "--run", tmp_path], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    made = emitted.result(done.stdout)
    rows = [row for row in made["hotspots"] if row["phase"] == "opt3"]
    for column in ("shipped_percent", "calls_percent"):
        assert sum(row.get(column) or 0 for row in rows) == pytest.approx(100)
    assert any(row["function"] == "sdf_cone" and row["shipped_samples"] for row in rows)
    for one in made["record"]["profiles"]:
        # Sampled time is timed time, as far as a busy machine leaves the process alone.
        assert 0 < one["covered"] < 1.2
    assert len(Hotspots.load(tmp_path / "hotspots.json").profiles) == len(VARIANTS)


def run_script(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return started.run(
        [sys.executable, *SCRIPT, *arguments],
        env=os.environ | environment,
        timeout=600,
    )


def test_without_perf_one_line_says_what_it_would_add(tmp_path, monkeypatch):
    monkeypatch.setattr(perf, "program", lambda: None)
    line = perf.missing()
    assert line and "\n" not in line
    assert "linux-perf" in line and "linux-tools-generic" in line
    if not list(Path("/usr/lib").glob("linux-tools*")):
        done = run_script("--phase", "opt2", PATH=str(tmp_path))
        assert done.returncode == CANNOT_RUN
        assert done.stdout == "" and done.stderr == f"stepwise hotspots: {line}\n"


def test_a_kernel_that_forbids_it_names_the_setting(tmp_path, monkeypatch):
    monkeypatch.setattr(perf, "program", lambda: "/bin/perf")
    monkeypatch.setattr(perf, "event", lambda: None)
    setting = tmp_path / "paranoid"
    monkeypatch.setattr(perf, "PARANOID", setting)
    for value, wanted in (("3", "perf_event_paranoid=2"), ("2", "records nothing")):
        setting.write_text(value)
        assert wanted in str(perf.missing())
    setting.unlink()
    assert "no perf events" in str(perf.missing())


def test_bad_arguments_and_a_broken_file_are_status_2_before_it_samples(tmp_path):
    store.write_json(tmp_path / "plan.json", {})
    (tmp_path / "hotspots.json").write_text('{"profiles": [{"phase": "opt2"}]}')
    for arguments in (["-n", "0"], ["--samples", "1"], ["--phase", "opt99"], ["--run", str(tmp_path)]):
        done = run_script(*arguments)
        assert done.returncode == 2 and done.stdout == "", arguments
