"""The report of tests/fixtures/run: one page that parses, needs nothing else, and says what is missing."""

from __future__ import annotations

import base64
import html.parser
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import emitted
import pytest
import started
from PIL import Image

from study.commands import report
from study.core import patches, registry
from study.core.cli import StudyError, Unwritten
from study.core.run_schema import Configuration, Plan
from study.core.show import Column
from study.experiments import section
from study.numbers import analysis
from study.pictures import ladder as ladder_figures
from study.report import chapters, facts, figures

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
VOID = {"meta", "img", "br", "link", "input", "hr"}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))


def script(*arguments: object) -> subprocess.CompletedProcess:
    command = [sys.executable, str(ROOT / "scripts" / "stepwise"), "report", *map(str, arguments)]
    return started.run(command)


@dataclass(frozen=True)
class Made:
    page: Page
    text: str
    out: Path
    run: Path
    told: dict  # by --json


class Page(html.parser.HTMLParser):
    """Checks nesting; collects ids, what is loaded, links, images, text, and text marked bad."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.marks: list[bool] = []
        self.ids: list[str] = []
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.images: list[dict] = []
        self.text, self.bad = "", ""
        self.feed(text)
        self.close()
        assert not self.open, f"left open: {self.open}"

    def handle_starttag(self, tag: str, attributes: list) -> None:
        found = dict(attributes)
        self.ids += [found["id"]] if "id" in found else []
        self.loaded += [found[k] for k in ("src", "srcset", "data", "action", "poster") if k in found]
        if tag in ("a", "use"):
            self.links.append(found["href"])
        elif "href" in found:
            self.loaded.append(found["href"])
        if tag == "img":
            self.images.append(found)
        if tag not in VOID:
            self.open.append(tag)
            self.marks.append("bad" in found.get("class", "").split())

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()
        self.marks.pop()

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data
            self.bad += data if any(self.marks) else ""


def page_of(run: Path, tmp_path: Path) -> tuple[Page, str]:
    done = script(run, "-o", tmp_path / "out" / "index.html")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "index.html").read_text()
    return Page(text), text


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The page of the unchanged fixture, made once."""
    folder = tmp_path_factory.mktemp("made")
    copy = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", folder / "machine" / "run"))
    done = script(copy, "-o", folder / "out" / "index.html", "--json")
    assert done.returncode == 0, done.stderr
    text = (folder / "out" / "index.html").read_text()
    return Made(Page(text), text, folder / "out", copy, emitted.result(done.stdout))


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Path], Page]:
    """Makes the page of a run in this process, with one plot only."""
    monkeypatch.setattr(ladder_figures, "PLOTS", {"runtime": ladder_figures.runtime})

    def make(run: Path) -> Page:
        return Page(report.page(analysis.load(run), tmp_path / "out" / "index.html"))

    return make


def test_the_page_is_whole_and_loads_nothing(made: Made) -> None:
    page, text = made.page, made.text
    assert text.startswith("<!DOCTYPE html>")
    assert len(page.ids) == len(set(page.ids))
    assert page.loaded and all(item.startswith("data:image/") for item in page.loaded)
    outside = re.sub(
        r'data:image/\S+|xmlns="http://www.w3.org/2000/svg"|<script.*?</script>', "", text, flags=re.S
    )
    assert not re.search(r"@import|url\((?!#)|https?:", outside)
    assert set(re.findall(r"url\(#([^)]+)\)", outside)) <= set(page.ids)
    for link in page.links:
        assert link.startswith("#") and link[1:] in page.ids
    for image in page.images:
        assert image["alt"] and len(base64.b64decode(image["src"].partition("base64,")[2])) > 1000
    assert not re.search(r"<td[^>]*>[^<]*\b(nan|None)\b", text)


def test_tables_and_figures_lie_beside_the_page(made: Made) -> None:
    files = {path.relative_to(made.out).as_posix() for path in made.out.rglob("*.*")}
    for name in ("ladder", "runtime", "verification", "paper"):
        assert {f"tables/{name}.{suffix}" for suffix in ("csv", "md", "json")} <= files
    for name in ladder_figures.PLOTS:
        assert {f"figures/{name}.svg", f"figures/{name}.png"} <= files
    assert not (made.run / "tables").exists()  # the run itself stays as it was


def test_failing_is_red_and_in_words(made: Made) -> None:
    page = made.page
    assert page.bad.count("✗ OUTSIDE: psnr_db") == 3 + 2  # card, both ladders, runtime and verification
    assert "✗ opt4 on mandelbulb" in page.bad and "✓" not in page.bad


def test_the_command_repeats_the_plan() -> None:
    asked = [
        Configuration(spec=spec, phase=spec, scene=scene, width=320, height=180, threads=1)
        for spec in ("baseline", "opt2@opt3")
        for scene in ("scene0", "trio")
    ]
    plan = Plan(configurations=asked, launches=10, reps=3, warmup=1, seed=7, cpu=1)
    words = [word.split() for word in facts.command(plan).partition(" sweep --")[2].split(" --")]
    assert words[0] == ["phase", "baseline", "opt2@opt3"]
    assert words[1] == ["scene", "scene0", "trio", "-n", "320x180"]
    given = {"threads": "1", "launches": "10", "reps": "3", "warmup": "1", "seed": "7", "cpu": "1"}
    assert dict(words[2:]) == given
    assert facts.command(Plan()) == ""
    assert "scene0 run/trio.json" in facts.command(plan, {"trio": Path("run/trio.json")})


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("verify.json", "stepwise verify"),
        ("context.json", "context.json"),
        ("plan.json", "plan.json"),
        ("frames.jsonl", "No frame"),
    ],
)
def test_a_missing_file_is_stated_and_no_crash(run: Path, quick: Callable, file: str, said: str) -> None:
    (run / file).unlink()
    assert said in quick(run).text


def test_an_empty_run_still_makes_a_page(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    page, _ = page_of(tmp_path / "run", tmp_path)
    for said in ("No frame", "make flops", "recorded no phase"):
        assert said in page.text
    assert page.bad == ""


def test_pictures_and_failing_heat_maps_are_in_the_page(run: Path, quick: Callable, tmp_path: Path) -> None:
    without = len(quick(run).images)
    (run / "figures").mkdir()
    (run / "images").mkdir()
    for path in (
        run / "figures" / "contact-sheet.png",
        run / "images" / "map.png",
        run / "images" / "fine.png",
    ):
        Image.effect_noise((200, 100), 50).save(path)
    verify = json.loads((run / "verify.json").read_text())
    for pair in verify["pairs"]:
        pair["heatmap"] = "images/fine.png" if pair["within_tolerance"] else "images/map.png"
    (run / "verify.json").write_text(json.dumps(verify))
    page = quick(run)
    assert len(page.images) == without + 2
    assert {"contact-sheet.png", "map.png"} <= {
        path.name for path in (tmp_path / "out" / "figures").iterdir()
    }


def test_phases_come_from_the_plan_with_their_notes(
    run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "phases" / "opt4").mkdir(parents=True)
    (tmp_path / "phases" / "opt4" / "NOTES.md").write_text("It was **bound** by latency.")
    (tmp_path / "phases" / "opt4" / "lesson.svg").write_text("<svg/>")
    monkeypatch.setattr(patches, "folders", lambda: {"opt4": tmp_path / "phases" / "opt4"})
    monkeypatch.setattr(registry, "ROOT", tmp_path)
    plan = json.loads((run / "plan.json").read_text())
    plan["phases"] = {"opt4": {"name": "opt4", "family": "ladder", "order": 4}}
    plan["phases"]["baseline"] = {"name": "baseline", "family": "ladder", "order": 0}
    (run / "plan.json").write_text(json.dumps(plan))
    found = chapters.described(analysis.load(run))
    assert [phase["name"] for phase in found] == ["baseline", "opt4"]
    assert found[0]["notes"] is None and "<strong>bound</strong>" in found[1]["notes"]
    assert found[0]["lesson"] is None and found[1]["lesson"].startswith("data:image/svg+xml;base64,")


def test_a_phase_of_several_widths_says_what_ran(run: Path) -> None:
    plan = json.loads((run / "plan.json").read_text())
    wide = [{"lanes": 16, "isa": ["avx512f"], "flags": "-mavx512f"}, {"lanes": 8, "isa": [], "flags": ""}]
    about = {"name": "opt4", "family": "ladder", "order": 4, "lanes": 16, "isa": ["avx2"], "cflags": "-O3"}
    plan["phases"] = {"opt4": about | {"variants": wide}}
    (run / "plan.json").write_text(json.dumps(plan))
    (found,) = chapters.described(analysis.load(run))
    assert (found["lanes"], found["isa"]) == (8, ["avx2", "fma"]) and "-mavx2" in found["cflags"]


def test_json_and_statuses(made: Made, run: Path, tmp_path: Path) -> None:
    assert made.told["bytes"] == (made.out / "index.html").stat().st_size and made.told["missing"] == []
    done = script(tmp_path / "nothing", "-o", tmp_path / "index.html")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    (run / "context.json").write_text("{")
    done = script(run, "-o", tmp_path / "index.html")
    assert done.returncode == 2 and "context.json:1:2" in done.stderr


def test_what_was_drawn_of_the_same_tables_stays_only_where_it_may(tmp_path: Path) -> None:
    """A study's page, written after each part, keeps it; a page that is asked for is drawn anew."""
    written = []

    class Drawn:
        caption, note = "a", "b"

        def write(self, stem: Path, across: float | None = None) -> list[Path]:
            paths = [stem.with_suffix(suffix) for suffix in (".svg", ".png")]
            written.append(stem.name)
            for path in paths:
                Image.new("RGB", (2, 2)).save(path, "PNG")
            return paths

    def shown(value: int, reuse: bool) -> None:
        rows = [{"x": value}]
        parts = section.part("t", "T", rows, [Column("", "x", lambda r: str(r["x"]))])
        figures.draw([section.Section("s", "S", "", parts, drawn={"one": Drawn()})], tmp_path, reuse)

    for value, reuse, count in [(1, True, 1), (1, True, 1), (2, True, 2), (2, False, 3), (2, True, 3)]:
        shown(value, reuse)
        assert len(written) == count
    (tmp_path / "one.png").unlink()
    shown(2, True)
    assert len(written) == 4


@pytest.mark.parametrize(("kind", "blamed"), [(Unwritten, False), (StudyError, True)])
def test_a_full_disk_is_not_the_fault_of_what_was_read(kind: type[StudyError], blamed: bool) -> None:
    with pytest.raises(kind, match=r"^one\.svg") as raised, section.reading("sweep.json", "its command"):
        raise kind("one.svg: no space")
    assert ("sweep.json again" in str(raised.value)) == blamed
