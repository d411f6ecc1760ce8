"""The chapter of errors to truth."""

from __future__ import annotations

from pathlib import Path

from study.core.show import Row
from study.experiments.accuracy import measure as accuracy
from study.experiments.accuracy import tables as accuracy_page
from study.experiments.section import Section, part, reading
from study.pictures.draw import Drawing


def _again(result: Row) -> str:
    """The command that renders the pictures of these rows again."""
    scenes = " ".join(dict.fromkeys(row["scene"] for row in result["rows"]))
    more = " --convergence" if result.get("convergence") else ""
    sizes = " ".join(dict.fromkeys(str(row["height"]) for row in result["rows"]))
    return f"scripts/stepwise accuracy --scene {scenes} -n {sizes}{more}"


def errors(path: Path) -> Section:
    """Every phase against truth, where its bad pixels lie, the Mandelbulb's convergence."""
    file = path / accuracy.FILE
    parts, remarks, images, drawn, script = [], [], {}, {}, "scripts/stepwise accuracy"
    with reading(file, f"scripts/stepwise accuracy --run {path}"):
        result = accuracy.read(path)
        for name, caption, rows, columns in accuracy_page.tables(result):
            parts += part(name, caption, rows, columns, folded=name in ("accuracy-averaged",))
        if parts:
            remarks = accuracy_page.remarks(result)
            captions = {
                "accuracy-where": "Pixels that are wrong, and where they lie",
                "accuracy-convergence": "The Mandelbulb: precision against hit distance",
            }
            note = accuracy_page.note(result)
            drawn = {
                name: Drawing(captions[name], note, draw)
                for name, draw in accuracy_page.drawings(result).items()
            }
            script = _again(result)
            images = {
                path / row["picture"]: f"{row['scene']} by {row['phase']}: where it is wrong"
                for row in result["rows"]
                if row.get("picture") and row["phase"] in ("baseline", "opt4")
            }
    about = {"file": file, "script": script, "drawn": drawn, "images": images}
    return Section("accuracy", "Error to truth", "make accuracy", parts, remarks, **about)
