"""The main job's parts: which scripts they call, and which ends they take for an end."""

import argparse
import dataclasses
import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import emitted
import pytest

from study.commands import study as run_study
from study.core import cli, commands, html, registry, run_schema
from study.core.host import child
from study.experiments import cuts, experiment
from study.experiments.experiment import DEPTHS, Call, Study
from study.numbers import analysis

FIXTURE = Path(__file__).resolve().parents[2] / "fixtures" / "run"


@pytest.fixture(autouse=True)
def every_page(monkeypatch):
    """A page after each part, however soon the part has ended."""
    monkeypatch.setattr(run_study, "PAGE_SECONDS", 0)


@pytest.fixture
def options(tmp_path):
    return argparse.Namespace(
        scene=["scene0", "mandelbulb"], depth="quick", part=None, results=tmp_path, budget=10.0, json=False
    )


def study_of(depth: str, asked: bool = False) -> Study:
    return Study(FIXTURE, ["scene0", "mandelbulb"], 90, depth, asked)


@pytest.mark.parametrize("asked", [True, False])
@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("name", experiment.find_all())
def test_every_experiment_calls_its_commands_rightly(name, depth, asked, monkeypatch):
    """Each command takes its arguments: a wrong one is found here, not after six minutes of study."""
    known, parse, taken = commands.find_all(), argparse.ArgumentParser.parse_args, []

    def parsed(parser, *_):
        taken.append(parse(parser))
        raise Parsed

    calls = experiment.find_all()[name].calls(study_of(depth, asked))
    for call in calls:
        module = importlib.import_module(known[call.command].module)
        with monkeypatch.context() as patched:
            patched.setattr(argparse.ArgumentParser, "parse_args", parsed)
            patched.setattr(sys, "argv", [f"stepwise {name}", *call.arguments])
            with pytest.raises(Parsed):
                module.main()
    assert len(taken) == len(calls)


def test_an_experiment_calls_its_own_command_unless_it_says_more():
    toy = experiment.Experiment("toy", "a toy", 1, {})
    assert toy.calls(study_of("quick")) == [Call("toy", ["--run", str(FIXTURE)], may_lack=True)]
    assert experiment.Experiment("toy", "a toy", 1, {}, calls=lambda study: []).calls(study_of("quick")) == []


class Parsed(Exception):
    """The command has parsed its arguments; it is not run."""


@pytest.mark.parametrize("status", [cli.OK, cli.FAILED, cli.CANNOT_RUN])
@pytest.mark.parametrize("judges", [True, False])
@pytest.mark.parametrize("may_lack", [True, False])
def test_what_a_status_means_is_the_experiment_s_to_say(status, judges, may_lack, monkeypatch):
    ends(monkeypatch, status)
    toy = experiment.find_all()["ceilings"]
    toy = dataclasses.replace(toy, calls=lambda study: [Call("ceilings", [], judges, may_lack)])
    broken = (status == cli.FAILED and not judges) or (status == cli.CANNOT_RUN and not may_lack)
    if broken:
        with pytest.raises(cli.StudyError, match=f"stepwise ceilings ended with status {status}"):
            run_study.measure(toy, study_of("quick"))
    else:
        assert run_study.measure(toy, study_of("quick")) is (status != cli.FAILED)


def test_a_deeper_study_has_all_of_a_shallower_one(options):
    found = []
    for depth in DEPTHS:
        options.depth = depth
        found.append([one.name for one in run_study.chosen(options)])
        assert "sweep" not in found[-1] and "verify" in found[-1]
    assert set(found[0]) <= set(found[1]) < set(found[2])
    options.part = ["views", "flops"]
    assert [one.name for one in run_study.chosen(options)] == ["flops", "views"], "in a study's order"


def ends(monkeypatch, status):
    done = subprocess.CompletedProcess([], status)
    monkeypatch.setattr(child, "run", lambda *_, **__: done)
    return done


def plan_of(start: float, programs: dict[str, float]) -> dict:
    """A dry run's plan: seconds of a launch of 1 + 3 frames, which take `programs` seconds at height 100."""
    made = [
        {"spec": spec, "scene": "s", "height": n, "estimate_s": start + 4 * frame * (n / 100) ** 2}
        for spec, frame in programs.items()
        for n in run_study.CALIBRATED
    ]
    return {"reps": 3, "warmup": 1, "configurations": made}


@pytest.mark.parametrize(
    ("start", "programs", "seconds", "height"),
    [
        (0.0, {"a": 0.001}, 1e9, 360),  # everything fits
        # Of six launches at 160, 80, 40: 4 frames of 0.0256, 0.0064, 0.0016 s each, in all 0.8064 s.
        (0.0, {"a": 0.01}, 0.807, 160),
        (0.0, {"a": 0.01}, 0.806, 128),
        # Three starts of 0.1 s a launch, 1.8 s in all, are of no size.
        (0.1, {"a": 0.01}, 2.607, 160),
        (0.1, {"a": 0.01}, 2.606, 128),
        # A frame of more than 0.25 s is alone: at 96, 48, 24: 0.4608 + 4·0.1152 + 4·0.0288 s.
        (0.0, {"a": 0.5}, 6.23, 96),
        (0.0, {"a": 0.5}, 6.21, 64),
        (0.0, {"a": 0.01, "b": 0.01}, 1.613, 160),  # two programs take twice as long
        (0.0, {"a": 9.0}, 1.0, 64),  # nothing fits: the least
    ],
)
def test_the_largest_picture_that_fits(start, programs, seconds, height, monkeypatch):
    said = json.dumps({"result": plan_of(start, programs)})
    done = subprocess.CompletedProcess([], 0, stdout=said)
    monkeypatch.setattr(run_study, "run_command", lambda *_, **__: done)
    assert run_study.choose_height(["s"], seconds, 6) == height


def test_a_failed_check_is_an_end_only_where_a_command_judges(monkeypatch):
    done = ends(monkeypatch, cli.FAILED)
    with pytest.raises(cli.StudyError, match=r"stepwise tables ended with status 1"):
        run_study.run_command("tables")
    assert run_study.run_command("verify", accepted=run_study.CHECKED) is done


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (cli.CRASHED, "stepwise verify crashed; its traceback is above"),
        (-9, "stepwise verify was killed by SIGKILL"),
        (cli.FAILED, "verify: see above"),
    ],
)
def test_a_crash_of_verify_is_no_failed_check(status, sentence, monkeypatch):
    ends(monkeypatch, status)
    wrong, verify = run_study.Wrong(), experiment.find_all()["verify"]
    wrong.hold(lambda: run_study.measure(verify, study_of("quick", asked=True)), "verify: see above")
    if status == cli.FAILED:
        assert (wrong.failed, wrong.crashed, wrong.status()) == ([sentence], [], cli.FAILED)
    else:
        assert (wrong.failed, wrong.crashed, wrong.status()) == ([], [sentence], cli.CRASHED)


def test_every_experiment_has_a_quick_depth_or_says_why_not():
    """What a quick study runs in another way than the standard one is named, and nothing else is."""
    for name, one in experiment.find_all().items():
        assert not one.cut or one.cut.endswith("."), name
        if one.depth != "quick":
            assert one.cut, f"{name}: why has a quick study none of it?"
        elif name != "sweep":
            quick, standard = (one.calls(study_of(depth)) for depth in ("quick", "standard"))
            assert bool(one.cut) == (quick != standard), name


def test_a_quick_study_answers_every_question_of_the_page(options):
    """Chapters that it has not are of what takes minutes or a download."""
    names = {one.name for one in run_study.chosen(options)} | {"sweep"}
    lacking = {one.name for one in experiment.find_all().values() if one.sections and one.name not in names}
    assert lacking == {"peers", "toolchains", "systems", "flight"}


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Where a study without builds writes its page; its run, a copy of the fixture."""
    run = Path(shutil.copytree(FIXTURE, tmp_path / "run"))
    monkeypatch.setattr(run_study, "PAGE", tmp_path / "out" / "index.html")
    monkeypatch.setattr(run_study, "build", lambda _: None)
    return run


def recorded(run: Path, monkeypatch) -> list:
    """Name and arguments of each command that the study calls from now on; none of them runs."""
    said = {"run": str(run), "result": {"failures": [], **plan_of(0.0, {"a": 0.01})}}
    done = []

    def fake(name, *arguments, capture=False, accepted=(cli.OK,)):
        done.append((name, arguments))
        return subprocess.CompletedProcess([], cli.OK, stdout=json.dumps(said))

    monkeypatch.setattr(run_study, "run_command", fake)
    return done


def test_a_page_is_written_before_all_phases_are_built(options, elsewhere, monkeypatch):
    done = recorded(elsewhere, monkeypatch)
    monkeypatch.setattr(run_study, "build_together", lambda tasks, _: done.append(("build", tasks)))
    monkeypatch.setattr(run_study, "arguments", lambda: options)
    assert run_study.main() == cli.OK
    assert [name for name, _ in done[:4]] == ["build", "sweep", "report", "build"]
    first, timed, page, every = (what for _, what in done[:4])
    assert len(first) < len(every) == len(registry.ladder())
    assert timed[timed.index("-n") + 1] == "90" and timed[timed.index("--launches") + 1] == "6"
    assert page[1] == "--running" and "first look" in page[2] and "90 pixels high, 6 launches" in page[2]
    assert set(page[3:]) == {one.what for one in run_study.chosen(options)}
    names = [name for name, _ in done]
    after = {names.index("verify") + 2: "report", names.index("frames") - 1: "report"}
    assert all(names[place] == name for place, name in after.items()), names
    assert set(cuts.read(elsewhere)) == {
        one.name for one in experiment.find_all().values() if one.depth == "quick" and one.cut
    }


def test_a_young_page_is_left_as_it_is(options, elsewhere, monkeypatch):
    """The first look, and the last page."""
    done = recorded(elsewhere, monkeypatch)
    monkeypatch.setattr(run_study, "build_together", lambda tasks, _: None)
    monkeypatch.setattr(run_study, "arguments", lambda: options)
    monkeypatch.setattr(run_study, "PAGE_SECONDS", 3600)
    assert run_study.main() == cli.OK
    pages = [arguments for name, arguments in done if name == "report"]
    assert [("--running" in arguments) for arguments in pages] == [True, False]


def test_the_page_says_what_a_quick_study_cut_and_how_to_have_it_whole(elsewhere, tmp_path):
    data = analysis.load(elsewhere)
    assert not any(section.cut for section in experiment.sections(data))
    cuts.note(elsewhere, "stability", "Two <phases>.")
    cuts.note(elsewhere, "views", "One scene.")
    cuts.note(elsewhere, "views", "")  # measured again, by its name
    said = {section.id: section.cut for section in experiment.sections(data) if section.cut}
    whole = "The whole: `make study DEPTH=standard` or `make stability`."
    assert said == {"stability": f"Two <phases>. {whole}"}
    shown = html.markdown().renderInline(said["stability"])
    assert shown.startswith("Two &lt;phases&gt;.") and "<code>make stability</code>" in shown
    (elsewhere / run_schema.STUDY).write_text("[]")
    with pytest.raises(cli.StudyError, match=r"study\.json: not what scripts/stepwise study writes"):
        experiment.sections(data)


def test_the_study_goes_on_after_a_part_that_crashed(options, elsewhere, monkeypatch, capsys):
    called = []

    def fake(name, *arguments, capture=False, accepted=(cli.OK,)):
        called.append((name, arguments))
        if name == "functions":
            raise run_study.Crashed("stepwise functions crashed; its traceback is above", cli.CRASHED)
        return subprocess.CompletedProcess([], cli.OK, stdout="{}")

    options.part, options.json = ["functions", "views"], True
    monkeypatch.setattr(run_study, "run_command", fake)
    monkeypatch.setattr(run_study, "arguments", lambda: options)
    monkeypatch.setattr(run_study, "build_together", lambda *_: None)
    monkeypatch.setattr(run_study, "newest", lambda _: (elsewhere, 90))
    assert cli.finish(run_study.main()) == cli.CRASHED
    names = [name for name, _ in called]
    assert names[:5] == ["report", "functions", "report", "views", "report"]
    assert called[0][1][1:] == (
        "--running",
        "functions: speed against ulp",
        "views that nothing was tuned on",
    )
    assert called[4][1] == (str(elsewhere),), "the last page has nothing still to come"
    said = capsys.readouterr()
    assert emitted.result(said.out)["crashed"] == ["stepwise functions crashed; its traceback is above"]
    assert said.err.splitlines()[-1] == "study: stepwise functions crashed; its traceback is above"


def test_the_newest_run_is_taken_and_none_is_none(options, tmp_path):
    assert run_study.newest(options) == (None, 0)
    folder = tmp_path / "machine" / "20260101-000000-abc"
    folder.parent.mkdir()
    folder.symlink_to(FIXTURE)
    options.scene = ["scene0"]
    path, height = run_study.newest(options)
    assert path == folder and height > 0
    options.scene = ["trio"]
    assert run_study.newest(options) == (None, 0)
