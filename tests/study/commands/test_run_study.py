"""The study: which experiments it runs, with which arguments, and what it makes of their ends."""

import argparse
import shutil
from pathlib import Path

import pytest

from study.commands import study as run_study
from study.core import cli, commands, registry
from study.core.cli import Outcome, StudyError
from study.core.run_schema import Configuration, Plan
from study.experiments import cuts, experiment
from study.experiments.experiment import DEPTHS, Call, Experiment, Study
from study.numbers import analysis

FIXTURE = Path(__file__).resolve().parents[2] / "fixtures" / "run"
ALL = experiment.find_all()


def study_of(depth: str, asked: bool = False) -> Study:
    return Study(FIXTURE, ["scene0", "mandelbulb"], 90, depth, asked)


@pytest.mark.parametrize("asked", [True, False])
@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("name", ALL)
def test_every_experiment_calls_its_commands_rightly(name, depth, asked):
    """Each command takes its arguments: a wrong one is found here, not after six minutes of study."""
    known = commands.find_all()
    for call in ALL[name].commands(study_of(depth, asked)):
        commands.parser_of(known[call.command]).parse_args(list(map(str, call.arguments)))


@pytest.mark.parametrize("name", ["verify", "accuracy"])
def test_a_scene_of_a_path_is_judged_too(name):
    study = Study(FIXTURE, ["mine"], 90, "quick", False)
    words = list(ALL[name].commands(study)[0].arguments)
    scenes = words[words.index("--scene") + 1 :]
    assert "mine" in scenes[: next((n for n, word in enumerate(scenes) if word.startswith("-")), None)]


def test_an_experiment_calls_its_own_command_unless_it_says_more():
    toy = Experiment("toy", "a toy", 1, {})
    assert toy.commands(study_of("quick")) == [Call("toy", ["--run", str(FIXTURE)], may_lack=True)]
    assert Experiment("toy", "a toy", 1, {}, calls=lambda study: []).commands(study_of("quick")) == []


@pytest.mark.parametrize("status", [cli.OK, cli.FAILED, cli.CANNOT_RUN, StudyError("no", 3), ValueError()])
@pytest.mark.parametrize("judges", [True, False])
@pytest.mark.parametrize("may_lack", [True, False])
def test_what_an_end_means_is_the_experiment_s_to_say(status, judges, may_lack, monkeypatch):
    """A bug, or what is not the experiment's to end with, is noted, and the study goes on."""

    def called(name, words):
        if isinstance(status, Exception):
            raise status
        return Outcome(status=status), False

    monkeypatch.setattr(commands, "called", called)
    toy = Experiment("toy", "a toy", 1, {}, calls=lambda study: [Call("toy", [], judges, may_lack)])
    wrong = run_study.Wrong()
    wrong.measure(toy, study_of("quick"))
    lacks = status == cli.CANNOT_RUN or isinstance(status, StudyError)
    broken = (
        isinstance(status, ValueError) or (status == cli.FAILED and not judges) or (lacks and not may_lack)
    )
    assert bool(wrong.broken) == broken and bool(wrong.failed) == (status == cli.FAILED and judges)
    assert wrong.status() == (cli.CRASHED if broken else cli.FAILED if wrong.failed else cli.OK)


def arguments(tmp_path: Path, depth: str = "quick", part: list[str] | None = None) -> argparse.Namespace:
    words = ["--depth", depth, "--results", str(tmp_path)]
    words += [word for one in part or [] for word in ("--part", one)]
    return commands.parser_for("study", run_study).parse_args(words)


def test_a_deeper_study_has_all_of_a_shallower_one(tmp_path):
    found = []
    for depth in DEPTHS:
        found.append([one.name for one in run_study.chosen(arguments(tmp_path, depth))])
        assert "sweep" not in found[-1] and "verify" in found[-1]
    assert set(found[0]) <= set(found[1]) < set(found[2])
    some = run_study.chosen(arguments(tmp_path, part=["roofline", "flops"]))
    assert [one.name for one in some] == ["flops", "roofline"], "in a study's order"


def plan_of(start: float, programs: dict[str, float]) -> Plan:
    """A dry run's plan: seconds of a launch of 1 + 3 frames, which take `programs` seconds at height 100."""
    made = [
        Configuration(
            spec=spec, phase=spec, scene="s", height=n, estimate_s=start + 4 * frame * (n / 100) ** 2
        )
        for spec, frame in programs.items()
        for n in run_study.CALIBRATED
    ]
    return Plan(reps=3, warmup=1, configurations=made)


@pytest.mark.parametrize(
    ("start", "programs", "seconds", "height"),
    [
        (0.0, {"a": 0.001}, 1e9, 360),  # everything fits
        # Six launches at 160, 80, 40: 4 frames of 0.0256, 0.0064, 0.0016 s each, in all 0.8064 s.
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
    monkeypatch.setattr(commands, "called", lambda *_: (Outcome(cli.plain(plan_of(start, programs))), False))
    assert run_study.choose_height(["s"], seconds, 6, "standard") == height


@pytest.mark.parametrize(("seconds", "height"), [(0.615, 160), (0.614, 128)])
def test_a_quick_study_times_one_height(seconds, height, monkeypatch):
    """Six launches at 160: 4 frames of 0.0256 s each, in all 0.6144 s."""
    made = Outcome(cli.plain(plan_of(0.0, {"a": 0.01})))
    monkeypatch.setattr(commands, "called", lambda *_: (made, False))
    assert run_study.choose_height(["s"], seconds, 6, "quick") == height


@pytest.mark.slow
def test_a_real_dry_run_tells_the_height():
    assert run_study.choose_height(["two_spheres"], 1e9, 1, "quick") == run_study.HEIGHTS[0]
    assert run_study.choose_height(["two_spheres"], 0, 1, "quick") == run_study.HEIGHTS[-1]


def test_every_experiment_has_a_quick_depth_or_says_why_not():
    """What a quick study runs in another way than the standard one is named, and nothing else is."""
    for name, one in ALL.items():
        assert not one.cut or one.cut.endswith("."), name
        if one.depth != "quick":
            assert one.cut, name
        elif name != "sweep":
            quick, standard = (one.commands(study_of(depth)) for depth in ("quick", "standard"))
            assert bool(one.cut) == (quick != standard), name


@pytest.fixture
def done(tmp_path, monkeypatch) -> list[tuple[str, list[str]]]:
    """Name and arguments of each command that the study calls; none of them runs. `functions` has a bug."""
    run = Path(shutil.copytree(FIXTURE, tmp_path / "run"))
    made: list[tuple[str, list[str]]] = []

    def called(name, words):
        made.append((name, list(words)))
        if name == "functions":
            raise ValueError("a bug")
        return Outcome(plan_of(0.0, {"a": 0.01}), run=run), False

    monkeypatch.setattr(commands, "called", called)
    monkeypatch.setattr(run_study, "PAGE", tmp_path / "out" / "index.html")
    monkeypatch.setattr(run_study, "PAGE_SECONDS", 0)
    monkeypatch.setattr(run_study, "build", lambda _: None)
    monkeypatch.setattr(run_study, "build_together", lambda tasks, _: made.append(("build", list(tasks))))
    return made


def test_a_page_is_written_before_all_phases_are_built(done, tmp_path, monkeypatch):
    outcome = run_study.run(arguments(tmp_path))
    assert outcome.ended == cli.CRASHED
    assert [name for name, _ in done[:4]] == ["build", "sweep", "report", "build"]
    first, timed, page, every = (what for _, what in done[:4])
    assert len(first) < len(every) == len(registry.ladder())
    assert timed[timed.index("-n") + 1] == "90" and timed[timed.index("--launches") + 1] == "6"
    assert page[1] == "--running" and set(page[3:]) == {p.what for p in run_study.chosen(arguments(tmp_path))}
    names = [name for name, _ in done]
    assert names[-1] == "report" and names.index("functions") < names.index("frames")
    quick = {one.name for one in ALL.values() if one.depth == "quick" and one.cut}
    assert set(cuts.read(tmp_path / "run")) == quick
    (broken,) = outcome.result["crashed"]
    assert "functions" in broken


def test_a_study_whose_budget_holds_no_round_is_refused(done, tmp_path):
    (tmp_path / "run" / "frames.jsonl").write_text("")
    with pytest.raises(StudyError) as caught:
        run_study.run(arguments(tmp_path))
    assert caught.value.exit_status == cli.CANNOT_RUN and done[-1][0] == "sweep"


def test_a_study_says_a_line_a_chapter_and_keeps_the_remarks(done, tmp_path, monkeypatch, capsys):
    called = commands.called

    def remarking(name, words):
        cli.say(f"{name} murmurs")
        return called(name, words)

    monkeypatch.setattr(commands, "called", remarking)
    run_study.run(arguments(tmp_path))
    said = capsys.readouterr().err
    lines = [line for line in said.splitlines() if line.startswith("[")]
    parts = [part.what for part in run_study.chosen(arguments(tmp_path))]
    assert len(lines) == len(parts) + 5
    for what, line in zip(
        parts, [line for line in lines if any(part in line for part in parts)], strict=True
    ):
        assert what in line
    assert "frames: frames murmurs" in cuts.remarks(tmp_path / "run")
    assert "murmurs" not in said


def test_a_slow_machine_leaves_out_the_last_chapters(done, tmp_path, monkeypatch, capsys):
    """Only of a quick study; the command that makes them is named, and pictures are judged in any case."""
    monkeypatch.setattr(run_study, "QUICK_ENDS", 0)
    run_study.run(arguments(tmp_path))
    names = [one.name for one in run_study.chosen(arguments(tmp_path))]
    called = {name for name, _ in done}
    assert names[:2] == ["verify", "accuracy"] and called >= {*names[:2]} and not called & {*names[2:]}
    (said,) = cuts.remarks(tmp_path / "run")
    assert said.endswith(f"make {' '.join(names[2:])}") and said.partition(": ")[2] in capsys.readouterr().err
    shutil.rmtree(tmp_path / "run")
    shutil.copytree(FIXTURE, tmp_path / "run")
    run_study.run(arguments(tmp_path, "standard"))
    assert {"verify", "frames"} <= {name for name, _ in done}


def test_a_young_page_is_left_as_it_is(done, tmp_path, monkeypatch):
    monkeypatch.setattr(run_study, "PAGE_SECONDS", 3600)
    run_study.run(arguments(tmp_path))
    running = ["--running" in words for name, words in done if name == "report"]
    assert running == [True, True, False]  # a first look, the sweep, the end


def test_the_page_says_what_a_quick_study_cut(tmp_path):
    run = Path(shutil.copytree(FIXTURE, tmp_path / "run"))
    assert not any(section.cut for section in experiment.sections(analysis.load(run)))
    cuts.note(run, "stability", "Two phases.")
    cuts.note(run, "flops", "One scene.")
    cuts.note(run, "flops", "")  # measured again, by its name
    said = {section.id: section.cut for section in experiment.sections(analysis.load(run)) if section.cut}
    assert said == {"stability": "Two phases."}
    cuts.note(run, "verify", "", ["one", "two"])
    cuts.note(run, "verify", "", ["three"])
    assert cuts.remarks(run) == ["verify: three"] and cuts.read(run) == {"stability": "Two phases."}


def test_the_newest_run_is_taken_and_none_is_none(tmp_path):
    args = arguments(tmp_path)
    assert run_study.newest(args) == (None, 0)
    folder = tmp_path / "machine" / "20260101-000000-abc"
    folder.parent.mkdir()
    folder.symlink_to(FIXTURE)
    args.scene = ["scene0"]
    path, height = run_study.newest(args)
    assert path == folder and height > 0
    args.scene = ["trio"]
    assert run_study.newest(args) == (None, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["frames", "scaling", "pareto"])
def test_a_chapters_line_is_a_whole_clause(name):
    """With its numbers, and no parenthesis left open."""
    found = sorted((registry.ROOT / "results" / "reference").glob(f"*/{name}.json"))
    said = run_study.came_out(found[-1].parent, ALL[name])
    assert said.count("(") == said.count(")") and sum(char.isdigit() for char in said) > 3, said


def test_a_scene_that_there_is_not_leaves_the_last_page(stepwise, tmp_path, monkeypatch):
    page = tmp_path / "out" / "index.html"
    monkeypatch.setattr(run_study, "PAGE", page)
    page.parent.mkdir()
    page.touch()
    done = stepwise("study", "--scene", "no_such_scene", "--results", tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (cli.BAD_INPUT, 1) and page.exists()
