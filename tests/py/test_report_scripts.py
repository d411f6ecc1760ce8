"""What the report's page does with scripts, in headless Chromium: tables, pictures, chart, base of ratios."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from study.commands import report
from study.core.registry import ROOT
from study.experiments.pareto import tables as pareto_tables
from study.experiments.sweep import figures as sweep_figures
from study.numbers import analysis
from study.pictures import images
from study.report import compared

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

  const ratio = heads.findIndex((head) => head.dataset.choices);
  const [base] = document.querySelectorAll("#ladder select");
  said.ratios = { before: column(table, ratio), bases: [...base.options].map((one) => one.text) };
  base.selectedIndex = 1;
  base.dispatchEvent(new Event("change"));
  said.ratios.after = column(table, ratio);
  said.ratios.head = heads[ratio].textContent;
  const long = [...document.querySelectorAll("#ladder table")][2];
  const same = [...long.tHead.rows[1].cells].findIndex((head) => head.textContent.startsWith("opt2, same"));
  said.ratios.column = column(long, same);

  const chart = document.querySelector(".pareto-chart");
  const panels = chart.querySelector(".panels");
  const marks = () => panels.querySelectorAll("polygon").length;
  const box = (name) => chart.querySelector(`input[value="${name}"]`);
  const whole = panels.innerHTML;
  said.marks = { all: marks() };
  box("opt4").click();
  said.marks.without = marks();
  box("opt4").click();
  box("mandelbulb").click();
  said.marks.scene0 = marks();
  said.marks.panels = panels.children.length;
  box("mandelbulb").click();
  panels.dispatchEvent(new KeyboardEvent("keydown", { key: "+" }));
  said.zoomed = panels.innerHTML !== whole;
  panels.dispatchEvent(new KeyboardEvent("keydown", { key: "0" }));
  said.restored = panels.innerHTML === whole;
  const mark = panels.querySelector("polygon");
  mark.dispatchEvent(new PointerEvent("pointerover", { bubbles: true }));
  said.mark = [chart.querySelector("output").textContent, mark.textContent];
  said.errors = [...chart.querySelectorAll("select option")].map((one) => one.text);
  for (const i of said.errors.keys()) {
    chart.querySelector("select").selectedIndex = i;
    chart.querySelector("select").dispatchEvent(new Event("change"));
    if (panels.innerHTML.includes("NaN")) failed.push(`NaN in the chart of ${said.errors[i]}`);
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
  const difference = figure.querySelectorAll("canvas")[1];
  said.difference = [...difference.getContext("2d").getImageData(3, 3, 1, 1).data];
  said.heat = figure.querySelectorAll("canvas")[2].parentElement.hidden;
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


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the fixture with a published pareto.json and two pictures of one colour each."""
    folder = tmp_path_factory.mktemp("scripts")
    run = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", folder / "machine" / "run"))
    shutil.copy(ROOT / "results" / "reference" / "zen4-2026-11-25" / "pareto.json", run)
    verify = json.loads((run / "verify.json").read_text())
    pair = next(one for one in verify["pairs"] if (one["phase"], one["scene"]) == ("opt4", "scene0"))
    for name, colour in (("reference_png", LEFT), ("png", RIGHT)):
        pair[name] = f"images/{name}.png"
        images.write_png(run / pair[name], np.full((90, 160, 3), colour, np.uint8))
    (run / "verify.json").write_text(json.dumps(verify))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep_figures, "PLOTS", {"runtime": sweep_figures.runtime})
        patch.setattr(pareto_tables, "FIGURES", {"psnr_db": "pareto"})
        text = report.page(analysis.load(run, strict=False), folder / "out" / "index.html")
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
    assert said["count"] == f"{len(said['filtered'])} of {len(rows)} rows"
    assert said["unfiltered"] == len(rows)


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_the_ratios_follow_the_base(used: Callable, across: int, dark: bool) -> None:
    """The long table has the ratio to opt2 with the same flags in a column of its own."""
    said = used(across, dark)["ratios"]
    assert said["bases"] == ["baseline", "opt2, same flags"]
    assert said["head"].startswith("× opt2, same flags")
    assert said["after"] == said["column"] != said["before"]


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_the_chart_filters_zooms_and_tells(used: Callable, made: Path, across: int, dark: bool) -> None:
    said = used(across, dark)
    rows = json.loads((made / "machine" / "run" / "pareto.json").read_text())["rows"]
    drawn = [row for row in rows if row["psnr_db"] is None or row["psnr_db"] > 0]
    count = {key: len([r for r in drawn if key in (r["scene"], r["phase"])]) for key in ("scene0", "opt4")}
    assert said["marks"] == {
        "all": len(drawn),
        "without": len(drawn) - count["opt4"],
        "scene0": count["scene0"],
        "panels": 1,
    }
    assert said["zoomed"] and said["restored"]
    assert said["mark"][0] == said["mark"][1] and re.search(r"ns/pixel; PSNR .* dB", said["mark"][0])
    assert len(said["errors"]) == 4


@pytest.mark.parametrize(("across", "dark"), SEEN)
def test_the_slider_moves_and_the_pixel_is_told(used: Callable, across: int, dark: bool) -> None:
    said = used(across, dark)
    left, right = list(LEFT), list(RIGHT)
    assert said["slider"] == {"50": [left, right], "0": [right, right], "100": [left, left]}
    assert abs(said["pointer"]["divider"] - 75) <= 1
    assert said["pointer"]["text"].startswith("Pixel 120, 45: baseline 10 20 30; opt4 200 100 50")
    assert said["difference"] == [255, 255, 255, 255]  # 16 × 20 and more
    assert said["heat"]  # no evaluations in this run


def test_without_scripts_the_page_has_its_figure_and_pictures(made: Path) -> None:
    text = (made / "index.html").read_text()
    assert '<div class="pareto-chart" hidden>' in text and text.count("<img data-scene=") == 2
    assert "<input" not in text.partition("<script>")[0]
    for file in (ROOT / "report" / "templates").glob("*.js"):
        assert len(file.read_text().splitlines()) < 200, file.name


def test_pictures_are_thinned_and_limited_and_evaluations_are_levels(
    made: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of a picture 1,281 pixels across every third; evaluations as 255 levels of their most."""
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
    data = analysis.load(run, strict=False)
    text = compared.fragment(data)
    coded = re.findall(r"base64,([^\"]+)", text)
    shown = [np.asarray(Image.open(io.BytesIO(base64.b64decode(one)))) for one in coded]
    assert [one.shape for one in shown[:2]] == [(90, 160, 3), (3, 427, 3)]
    assert np.array_equal(shown[1], large[::3, ::3])
    assert (shown[2] if shown[2].ndim == 2 else shown[2][..., 0]).tolist() == [[0, 64], [128, 255]]
    assert 'data-most="200"' in text and "every 3rd pixel" in text
    monkeypatch.setattr(compared, "MOST", 100)
    assert compared.fragment(data) == ""
