"""What every experiment keeps, known only through its `Experiment`; and docs/experiment.md, whose experiment
is found everywhere without another file being edited."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import complete
import copied
import pytest

from study.core import store
from study.core.registry import ROOT
from study.core.run_schema import RUN_TOML, About
from study.experiments import experiment
from study.numbers import analysis

ALL = experiment.find_all()
FILES = [(name, file) for name, one in ALL.items() for file in one.schemas]
PUBLISHED = sorted(path.parent for path in (ROOT / "results" / "reference").glob("*/context.json"))
FIXTURE = ROOT / "tests" / "fixtures" / "run"
LINED = ".jsonl"


def kept(file: str) -> list[Path]:
    """The published files of that name."""
    return [run / file for run in PUBLISHED if store.stored(run / file).exists()]


@pytest.mark.parametrize(("name", "file"), [pair for pair in FILES if not pair[1].endswith(LINED)])
def test_published_files_are_of_the_schema(name: str, file: str) -> None:
    """Where none is published, one row that is made up of the schema's least values."""
    kind = ALL[name].schemas[file]
    for path in kept(file):
        assert kind.load(path)
    if not kept(file):
        assert kind.of(json.loads(complete.text(file, {"rows": [{}]})), file)


@pytest.mark.parametrize("run", PUBLISHED, ids=lambda run: run.name)
def test_every_published_run_says_what_it_is(run: Path) -> None:
    assert About.of(tomllib.loads((run / RUN_TOML).read_text(encoding="utf-8")), str(run)).machine


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, one in ALL.items() if one.sections and one.schemas])
def test_chapters_are_made_of_the_files_alone(name: str, tmp_path: Path) -> None:
    """In a run with the sweep's files and its own, each table is what it is in the published run."""
    one = ALL[name]
    sources = [run for run in PUBLISHED if all(store.stored(run / file).exists() for file in one.schemas)]
    source = max(sources, key=lambda run: len(list(run.glob("*.json*"))), default=None)
    if source is None:
        pytest.skip(f"no published run has {', '.join(one.schemas)}")
    run = tmp_path / "machine" / "run"
    run.mkdir(parents=True)
    for file in [*ALL["sweep"].schemas, "verify.json", *one.schemas]:
        path = store.stored(source / file)
        if path.exists():
            shutil.copy(path, run / path.name)
    both = analysis.load(run), analysis.load(source)
    for _, make in one.sections:
        here, there = map(make, both)
        tables = [(part.name, part.markdown) for part in here.parts]
        if here.lacking != f"make {name}" and not tables:
            continue  # of another experiment's file
        assert (tables or here.drawn or here.html) and here.title
        assert {name for name, _ in tables} <= {part.name for part in there.parts}
        assert here.answer or not there.answer


def test_a_run_without_its_file_has_an_empty_chapter() -> None:
    """The chapter says by which command it is filled, and nothing else."""
    data = analysis.load(FIXTURE)
    for name, one in ALL.items():
        if not any(store.stored(FIXTURE / file).exists() for file in one.schemas):
            for section in (make(data) for _, make in one.sections):
                assert section.lacking.startswith("make ") and not section.failing, name


def test_no_experiment_writes_over_an_earlier_result_of_its_default_folder() -> None:
    """Each asks for a folder (running.folder) by the names of the files that it writes."""
    files = {"sweep", "flops", "hotspots", "ceilings", "roofline"}  # into a run, or nowhere
    for name, one in ALL.items():
        if one.command and name not in files:
            text = Path(str(one.command.__file__)).read_text(encoding="utf-8")  # type: ignore[attr-defined]
            assert re.search(r"\bfolder\(args, \S", text) and "folder(args)" not in text, name


PAGE = (ROOT / "docs" / "experiment.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```python\n# (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with the experiment of docs/experiment.md, and a run to add it to."""
    folder = copied.sources(tmp_path_factory.mktemp("project"))
    for path, text in BLOCK.findall(PAGE):
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text.lstrip("\n"), encoding="utf-8")
    shutil.copytree(FIXTURE, folder / "results" / "machine" / "run")
    return folder


def said(folder: Path, *words: str) -> str:
    done = subprocess.run([*words], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{words}\n{done.stdout[-2000:]}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.mark.slow
def test_an_experiment_is_found_by_its_folder(copy: Path) -> None:
    """By the list, make, the study, its own command, the documents, the report, publish and redraw."""
    run = "results/machine/run"
    assert len(BLOCK.findall(PAGE)) == 3
    assert re.search(r"^ +sizes +\w", said(copy, "scripts/stepwise", "list"), re.MULTILINE)
    assert re.search(r"make sizes +\w", said(copy, "make", "help"))
    assert "study --part sizes" in said(copy, "make", "-n", "sizes")
    refused = subprocess.run(
        ["scripts/stepwise", "study", "--part", "x"], cwd=copy, capture_output=True, text=True
    )
    assert refused.returncode == 2 and "sizes" in refused.stderr
    lines = said(copy, "scripts/stepwise", "sizes", "--phase", "baseline", "opt1", "--run", run)
    assert [line.partition(":")[0] for line in lines.splitlines()] == ["baseline", "opt1"]
    said(copy, "scripts/stepwise", "docs")
    assert "| `sizes` |" in (copy / "docs" / "commands.md").read_text(encoding="utf-8")
    assert "lines" in (copy / "build" / "docs" / "keys" / "sizes.json.md").read_text(encoding="utf-8")
    said(copy, "scripts/stepwise", "report", run, "-o", "out/index.html")
    assert (copy / "out" / "tables" / "sizes.csv").is_file()
    said(copy, "scripts/stepwise", "redraw", "-h")
    said(copy, "scripts/stepwise", "publish", run, "results/reference/toy", "--unclean")
    assert (copy / "results" / "reference" / "toy" / "sizes.json").is_file()
