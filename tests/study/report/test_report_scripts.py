"""What the report's page does with scripts, in headless Chromium: tables, figures, pictures, machine."""

import base64
import html
import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import complete
import numpy as np
import pytest
from PIL import Image

from study.commands import report
from study.commands.upkeep import publish
from study.core.registry import ROOT
from study.numbers import analysis
from study.pictures import images
from study.pictures import ladder as ladder_figures
from study.report import compared, figures, machines

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
LEFT, RIGHT = (10, 20, 30), (200, 100, 50)  # colours of the two pictures
SEEN = [(1280, False), (1280, True), (400, False), (400, True)]  # pixels across, whether dark

# Before the page's own scripts: what fails in any of them.
CATCH = """<script>
window.failed = [];
addEventListener("error", (event) => failed.push(event.message));
addEventListener("unhandledrejection", (event) => failed.push(String(event.reason)));
const complain = console.error;
console.error = (...all) => (failed.push(all.join(" ")), complain(...all));
</script>"""
# Behind them: one after another what a reader would do, and what he then sees.
USE = """<script>
const is = (one, ...all) => all.map((name) => one.querySelector(name));
const change = (one, value, kind) => {
  one.value = value;
  one.dispatchEvent(new Event(kind));
};
const visible = (table) => [...table.tBodies[0].rows].filter((row) => !row.hidden);
const column = (table, at) => visible(table).map((row) => row.cells[at].textContent);
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
async function use() {
  const said = { across: innerWidth, dark: matchMedia("(prefers-color-scheme: dark)").matches };
  document.querySelectorAll("details").forEach((one) => (one.open = true));
  const figure = document.querySelector("figure.pictures");
  for (let i = 0; i < 50 && !figure.dataset.ready; i++) await wait(100);
  said.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const stills = document.querySelectorAll("figure:has(> img)");
  const wider = [...stills].filter((one) => one.scrollWidth > one.clientWidth && !one.matches(".pictures"));
  said.cut = wider.map((one) => getComputedStyle(one, "::before").content);

  const table = document.querySelector("#ladder table");
  const heads = [...table.tHead.rows[table.tHead.rows.length - 1].cells];
  const at = heads.findIndex((head) => head.textContent.startsWith("ms a frame"));
  const sort = heads[at].querySelector("button");
  said.sorted = {};
  said.sorted[heads[at].getAttribute("aria-sort")] = column(table, at);
  for (let i = 0; i < 3; i++) {
    sort.click();
    said.sorted[i + heads[at].getAttribute("aria-sort")] = column(table, at);
  }
  sort.focus();
  said.focused = document.activeElement === sort;

  const points = [...document.querySelectorAll("#pareto table")].pop();
  const field = points.parentElement.previousElementSibling.querySelector("input");
  change(field, "opt4 mandelbulb", "input");
  said.filtered = visible(points).map((row) => row.textContent);
  said.count = field.parentElement.querySelector("output").textContent;
  change(field, "", "input");
  said.unfiltered = column(points, 0).length;

  const charts = [...document.querySelectorAll(".chart")];
  for (let i = 0; i < 50 && !charts.every((one) => one.dataset.ready); i++) await wait(100);
  const names = (menu) => [...menu.options].map((one) => one.text);
  const choices = (one) => [...one.querySelectorAll("select")].map(names);
  const marks = (one) => one.querySelectorAll(".mark-symbol path[aria-roledescription='point']").length;
  said.choices = charts.map(choices);
  said.marks = [];
  for (const chart of charts) {
    const menus = [...chart.querySelectorAll("select")];
    said.marks.push([marks(chart)]);
    for (const menu of menus) {
      menu.selectedIndex = 1;
      menu.dispatchEvent(new Event("change"));
      menu.dispatchEvent(new Event("input"));
      await wait(300);
      said.marks[said.marks.length - 1].push(marks(chart));
    }
  }
  const [slider, canvas, text] = is(figure, "input[type=range]", "canvas", ".pixel");
  const colours = () => [0.1, 0.9].map((part) =>
    [...canvas.getContext("2d").getImageData(part * canvas.width, 5, 1, 1).data].slice(0, 3));
  said.slider = { 50: colours() };
  for (const value of [0, 100]) {
    change(slider, value, "input");
    said.slider[value] = colours();
  }
  const place = canvas.getBoundingClientRect();
  const [clientX, clientY] = [place.left + 0.75 * place.width, place.top + 0.5 * place.height];
  canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY, bubbles: true }));
  said.pointer = { divider: Number(slider.value), text: text.textContent };
  const crosses = [...figure.querySelectorAll("b")];
  said.pointer.crosses = crosses.map((one) => [one.hidden, one.style.left, one.style.top]);
  const difference = figure.querySelectorAll("canvas")[1];
  said.difference = [...difference.getContext("2d").getImageData(3, 3, 1, 1).data];
  said.heat = figure.querySelectorAll("canvas")[2].parentElement.parentElement.hidden;
  const cells = ["32.0× [30.0, 36.0]", "1,797 [1,700, 1,900]", "base", "> 150", "1.2e-04", "1 insufficient"];
  said.values = [...cells, "opt4"].map(valueOf);
  said.ends = valueOf("∞") === Infinity && valueOf("identical") === Infinity;
  said.failed = failed;
  return said;
}
addEventListener("load", () => use().catch((error) => ({ failed: [...failed, String(error.stack)] }))
  .then((said) => parent.postMessage(JSON.stringify(said), "*")));
</script>"""
AROUND = """<!DOCTYPE html><body style="margin: 0"><pre></pre>
<script>
addEventListener("message", (event) => (document.querySelector("pre").textContent = event.data));
</script>
<iframe src="page.html" style="border: 0" width={} height="900"></iframe>"""


FIXTURE = ROOT / "tests" / "fixtures" / "run"
BESIDE = {"phase": "baseline", "scene": "scene0", "n": 180, "ours_over_theirs": {"value": 0.8}}
BESIDE |= {"ours_launches_ms": [200.0] * 6, "theirs_launches_ms": [250.0] * 6}


def published(folder: Path, name: str, faster: dict[str, int], beside: bool) -> None:
    """A run of another machine: phases of `faster` take a whole part of the fixture's time."""
    run = Path(shutil.copytree(FIXTURE, folder / name))
    frames = [json.loads(line) for line in (run / "frames.jsonl").read_text().splitlines()]
    for frame in frames:
        frame["ns"] //= faster.get(frame["phase"], faster.get("all", 1))
    (run / "frames.jsonl").write_text("".join(json.dumps(frame) + "\n" for frame in frames))
    context = json.loads((run / "context.json").read_text())
    context["cpu"]["microarchitecture"] = name
    (run / "context.json").write_text(json.dumps(context))
    plan = json.loads((run / "plan.json").read_text())
    for one in plan["configurations"]:
        one["height"] = 180 if "180" in one["config"] else 90
        one["width"] = one["height"] * 16 // 9
    (run / "plan.json").write_text(json.dumps(plan))
    if beside:
        complete.write(run / "original.json", {"rows": [BESIDE]})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the fixture with a published pareto.json and two pictures of one colour each, beside the
    paper's program; two other machines are published, one beside that program."""
    folder = tmp_path_factory.mktemp("scripts")
    published(folder / "published", "Fast Lake", {"all": 2}, beside=False)
    published(folder / "published", "Held Lake", {"opt4": 4}, beside=True)
    run = Path(shutil.copytree(FIXTURE, folder / "machine" / "run"))
    complete.write(run / "original.json", {"rows": [BESIDE]})
    shutil.copy(ROOT / "results" / "reference" / "zen4-2026-11-29" / "pareto.json", run)
    verify = json.loads((run / "verify.json").read_text())
    pair = next(one for one in verify["pairs"] if (one["phase"], one["scene"]) == ("opt4", "scene0"))
    for name, colour in (("reference_png", LEFT), ("png", RIGHT)):
        pair[name] = f"images/{name}.png"
        images.write_png(run / pair[name], np.full((90, 160, 3), colour, np.uint8))
    (run / "verify.json").write_text(json.dumps(verify))
    with pytest.MonkeyPatch.context() as patch:
        plots = {"speedup-ladder": ladder_figures.speedups, "runtime": ladder_figures.runtime}
        patch.setattr(ladder_figures, "PLOTS", plots)
        patch.setattr(machines, "PUBLISHED", folder / "published")
        text = report.page(analysis.load(run), folder / "out" / "index.html")
    (folder / "index.html").write_text(text)
    return folder


@pytest.fixture(scope="module")
def used(made: Path) -> Callable[[int, bool], dict]:
    """What the page says after it was used, in a window of that width; each is loaded once."""
    if not CHROMIUM:
        pytest.skip("needs chromium (Debian: apt install chromium)")
    page = (made / "index.html").read_text()
    (made / "page.html").write_text(page.replace("<head>", f"<head>{CATCH}", 1) + USE)
    found: dict[tuple[int, bool], dict] = {}

    def use(across: int, dark: bool) -> dict:
        if (across, dark) not in found:
            around = made / f"around-{across}.html"
            around.write_text(AROUND.format(across))
            command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000"]
            command += [f"--user-data-dir={made / 'browser'}", "--window-size=1400,1000", "--dump-dom"]
            command += [f"--blink-settings=preferredColorScheme={0 if dark else 1}", around.as_uri()]
            done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
            text = re.search(r"<pre>(.*?)</pre>", done.stdout, re.DOTALL)
            assert text and text[1], done.stderr[-2000:]
            found[across, dark] = json.loads(html.unescape(text[1]))
        return found[across, dark]

    return use


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_no_script_fails_and_nothing_is_wider_than_the_window(
    used: Callable, across: int, dark: bool
) -> None:
    """With every part of the page unfolded."""
    said = used(across, dark)
    assert said["failed"] == []
    assert (said["across"], said["dark"]) == (across, dark)
    assert said["overflow"] <= 0


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_a_figure_that_is_cut_says_that_it_scrolls(used: Callable, across: int, dark: bool) -> None:
    said = used(across, dark)["cut"]
    assert bool(said) == (across < 640) and all("swipe" in text for text in said)


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_a_column_sorts_there_and_back(used: Callable, across: int, dark: bool) -> None:
    said = used(across, dark)["sorted"]
    before = said["none"]
    middle = {text: sum(map(float, re.findall(r"[\d.]+", text.partition("[")[2]))) / 2 for text in before}
    assert len(before) > 2 and "[" in before[0]
    up = sorted(before, key=middle.__getitem__)
    assert up != before
    assert (said["0ascending"], said["1descending"], said["2none"]) == (up, up[::-1], before)
    assert used(across, dark)["focused"]


def test_a_cell_counts_as_the_middle_of_its_interval(used: Callable) -> None:
    said = used(*SEEN[0])
    assert said["values"] == [33, 1800, 1, 150, 1.2e-4, 1, None] and said["ends"]


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_a_filter_leaves_the_rows_with_all_its_words(
    used: Callable, made: Path, across: int, dark: bool
) -> None:
    said = used(across, dark)
    rows = json.loads((made / "machine" / "run" / "pareto.json").read_text())["rows"]
    wanted = [row for row in rows if row["scene"] == "mandelbulb" and "opt4" in row["phase"]]
    assert len(said["filtered"]) >= len(wanted) > 0
    assert all("mandelbulb" in text and "opt4" in text for text in said["filtered"])
    assert said["count"].split()[::2] == [str(len(said["filtered"])), str(len(rows))]
    assert said["unfiltered"] == len(rows)


def test_the_charts_follow_their_choices(used: Callable) -> None:
    """A machine, a scene and a base of the ladder; a scene and a shadow of speed against error."""
    said = used(*SEEN[0])
    (names, scenes, bases), (drawn, shadows) = said["choices"]
    assert names[0].startswith("Example Lake ") and names[1:] == ["Fast Lake", "Held Lake"]
    assert bases == ["baseline", "opt2, same flags", "the paper's baseline", machines.TIMES]
    assert scenes == ["scene0", "mandelbulb"] and drawn[:2] == scenes and len(shadows) == 2
    ladder, errors = said["marks"]
    # Six phases; not held beside the paper's program: no ratio to its baseline; over opt2: all of them.
    assert ladder == [6, 0, 0, 6]
    assert errors[0] > 50 and errors[1] > 50


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_the_slider_moves_and_the_pixel_is_told(used: Callable, across: int, dark: bool) -> None:
    said = used(across, dark)
    left, right = list(LEFT), list(RIGHT)
    assert said["slider"] == {"50": [left, right], "0": [right, right], "100": [left, left]}
    assert abs(said["pointer"]["divider"] - 75) <= 1
    numbers = [120, 45, 10, 20, 30, 4, 200, 100, 50, 190, 80, 20, 255]
    assert list(map(int, re.findall(r"\d+", said["pointer"]["text"]))) == numbers
    assert said["pointer"]["crosses"] == 3 * [[False, "75.3125%", "50.5556%"]]
    assert said["difference"] == [255, 255, 255, 255]  # 16 × 20 and more
    assert said["heat"]  # no evaluations in this run


def test_without_scripts_the_page_has_its_figure_and_pictures(made: Path) -> None:
    text = (made / "index.html").read_text()
    assert text.count("<img data-scene=") == 2 and "<input" not in text.partition("<script>")[0]


def test_a_page_is_never_larger_than_its_limit(
    made: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What is left out is named."""
    run = Path(shutil.copytree(made / "machine" / "run", tmp_path / "machine" / "run"))
    (run / "pareto.json").unlink()
    data = analysis.load(run)
    monkeypatch.setattr(ladder_figures, "PLOTS", {"runtime": ladder_figures.runtime})
    monkeypatch.setattr(machines, "PUBLISHED", tmp_path)
    whole = report.page(data, tmp_path / "index.html")
    limit = len(whole.encode()) - 20_000
    monkeypatch.setattr(figures, "MOST", limit)
    less = report.page(data, tmp_path / "index.html")
    assert limit - 400_000 < len(less.encode()) <= limit
    assert less.lower().count("left out") >= 2


def test_a_published_run_keeps_pictures_for_the_slider(made: Path, tmp_path: Path) -> None:
    """The reference's and the last phase's of each scene that has two, every fourth pixel of 1,280."""
    run = Path(shutil.copytree(made / "machine" / "run", tmp_path / "run"))
    rng = np.random.default_rng(1)
    pixels = {name: rng.integers(0, 256, (720, 1280, 3), np.uint8) for name in ("reference_png", "png")}
    for name, picture in pixels.items():
        images.write_png(run / "images" / f"{name}.png", picture)
    verify = json.loads((run / "verify.json").read_text())
    next(one for one in verify["pairs"] if "png" in one)["width"] = 1280
    (run / "verify.json").write_text(json.dumps(verify))
    folder = tmp_path / "published"
    folder.mkdir()
    publish.copy_files(run, folder)
    assert publish.copy_pictures(run, folder) == ["images/reference_png.png", "images/png.png"]
    for name, picture in pixels.items():
        assert np.array_equal(images.read_png(folder / "images" / f"{name}.png"), picture[::4, ::4])
    text = compared.fragment(analysis.load(folder))
    assert text.count("<img data-scene=") == 2 and "every 4th pixel" in text


def test_pictures_are_thinned_and_limited_and_evaluations_are_levels(
    made: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Every third pixel of a picture 1,281 across; evaluations as 255 levels of their most."""
    run = Path(shutil.copytree(made / "machine" / "run", tmp_path / "run"))
    rng = np.random.default_rng(1)
    large = rng.integers(0, 256, (9, 1281, 3), np.uint8)
    images.write_png(run / "images" / "png.png", large)
    verify = json.loads((run / "verify.json").read_text())
    pair = next(one for one in verify["pairs"] if "png" in one)
    pair["reference_image"] = "images/reference.exr"
    (run / "verify.json").write_text(json.dumps(verify))
    (run / "images" / "reference.exr").touch()
    planes = {"evals": np.float32([[0, 50], [100, 200]])}
    monkeypatch.setattr(images, "read", lambda path: planes if path.suffix == ".exr" else None)
    data = analysis.load(run)
    text = compared.fragment(data)
    coded = re.findall(r"base64,([^\"]+)", text)
    shown = [np.asarray(Image.open(io.BytesIO(base64.b64decode(one)))) for one in coded]
    assert [one.shape for one in shown[:2]] == [(90, 160, 3), (3, 427, 3)]
    assert np.array_equal(shown[1], large[::3, ::3])
    assert (shown[2] if shown[2].ndim == 2 else shown[2][..., 0]).tolist() == [[0, 64], [128, 255]]
    assert 'data-most="200"' in text and "every 3rd pixel" in text
    monkeypatch.setattr(compared, "MOST", 100)
    assert compared.fragment(data) == ""
