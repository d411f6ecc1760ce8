"""The chapter of what other articles built: alternatives to the ladder, each from its own file of the run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.core import provenance
from study.core.show import Column
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.fixed import tables as fixed_page
from study.experiments.lattice import measure as lattice
from study.experiments.lattice import tables as lattice_page
from study.experiments.packets import figures as packets_figures
from study.experiments.packets import measure as packets
from study.experiments.packets import moving_tables as packets_moving
from study.experiments.packets import pictures as packets_pictures
from study.experiments.packets import systems as packets_systems
from study.experiments.packets import tables as packets_page
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.rods import tables as rods_page
from study.experiments.section import Section, part, reading
from study.experiments.systems import pictures as systems_pictures
from study.experiments.throttle.schema import Throttle

ROWS = [
    Column("", "system", lambda r: r["system"]),
    Column("", "what", lambda r: r["what"]),
    Column("", "the article", lambda r: r["article"]),
    Column("", "here", lambda r: r["ours"]),
    Column("", "ratio", lambda r: r["ratio"]),
    Column("", "error to ground truth", lambda r: r["error"]),
]


FIGURE = re.compile(r"\d|two orders")
RATIO = re.compile(r"([\d.,]+)×")


FILES = (rods.FILE, rods.THROTTLE, lattice.FILE, fixed.FILE, packets.FILE)


def few(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """Of the rows of all systems those beside which an article states a figure; of P2's rays, of which it
    says millions, the best ratio and the worst, and those without any: no reader shall miss where we lose.
    """
    rays = [(RATIO.match(row["ratio"]), row) for row in rows if row["article"].startswith("“millions")]
    ratios = [float(found[1].replace(",", "")) for found, _ in rays if found]
    ends = (min(ratios), max(ratios)) if ratios else ()
    kept = [row for found, row in rays if not found or float(found[1].replace(",", "")) in ends]
    return [row for row in rows if row in kept or FIGURE.search(row["article"])]


def throttled_in(path: Path) -> dict[str, Any]:
    """A run's throttle.json, or one with no rows. Raises StudyError."""
    file = path / rods.THROTTLE
    return Throttle.read(file) if file.exists() else {"rows": []}


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of the table of all systems that a run has files for. Raises StudyError for a broken one."""
    latticed, integers = lattice.read(path / lattice.FILE), fixed.read(path / fixed.FILE)
    traced = packets.read(path / packets.FILE)
    return [
        *rods_page.system_rows(rods.read(path / rods.FILE), throttled_in(path)),
        *(lattice_page.system_rows(latticed) if latticed["rows"] else []),
        *fixed_page.system_rows(integers),
        *packets_systems.system_rows(traced),
        *packets_moving.system_rows(traced),
    ]


def section(path: Path) -> Section:
    """One table with a row for each figure of each system, then what each system's own file has.

    Another system adds its rows and parts here, and its script to SYSTEMS of scripts/stepwise study.
    """
    file = path / rods.FILE
    parts, pictures = [], {}
    with reading(file, f"scripts/stepwise rods --run {path}"):
        result = rods.read(file)
        _ = rods_page.system_rows(result, {"rows": []})  # here, where what fails is still known to be rods'
        drawn = rods_page.drawings(result)
        if result["rows"]:
            caption = "Rod marching against per-pixel marching: time, evaluations, error"
            parts += part("rods", caption, result["rows"], rods_page.SCENES, rods_page.NOTE)
            caption = "Rod marching: starting rods × step cap on two_spheres"
            parts += part("rods-trade", caption, result["trade"], rods_page.TRADES)
            pictures[path / "images" / f"{rods_pictures.PICTURES}.png"] = rods_pictures.CAPTION
    with reading(path / rods.THROTTLE, f"scripts/stepwise throttle --run {path}"):
        throttled = throttled_in(path)
        if throttled["rows"]:
            caption = "Rods, then packets: the throttle's choice of each scene"
            foot = rods_page.throttle_foot(throttled)
            parts += part("throttle", caption, throttled["rows"], rods_page.THROTTLE, foot=foot)
        rows = rods_page.system_rows(result, throttled)
    with reading(path / lattice.FILE, f"scripts/stepwise lattice --run {path}"):
        latticed = lattice.read(path / lattice.FILE)
        if latticed["rows"]:
            caption = "CPU-RTRM's scene by every phase of the ladder"
            foot = f"{lattice_page.foot(latticed['rows'])}\n{lattice_page.note(latticed)}".strip()
            parts += part("lattice", caption, latticed["rows"], lattice_page.COLUMNS, foot=foot)
            rows += lattice_page.system_rows(latticed)
    with reading(path / fixed.FILE, f"scripts/stepwise fixed --run {path}"):
        integers = fixed.read(path / fixed.FILE)
        parts += fixed_page.parts(integers)
        rows += fixed_page.system_rows(integers)
        if integers["rows"]:
            drawn |= fixed_page.drawings(integers)
            pictures[path / "images" / f"{fixed_pictures.PICTURES}.png"] = fixed_pictures.CAPTION
    with reading(path / packets.FILE, f"scripts/stepwise packets --run {path}"):
        traced = packets.read(path / packets.FILE)
        drawn = drawn | packets_figures.drawings(traced)
        parts += packets_page.parts(traced) + packets_moving.parts(traced)
        rows += packets_systems.system_rows(traced) + packets_moving.system_rows(traced)
        if traced["rays"]:
            pictures[path / "images" / f"{packets_pictures.PICTURES}.png"] = packets_pictures.CAPTION
    if rows:
        sheet = path / "images" / f"{systems_pictures.PICTURES}.png"
        pictures = ({sheet: systems_pictures.CAPTION} if sheet.exists() else {}) | pictures
        foot = provenance.disturbed(path, FILES)
        parts = part("systems", "Systems of other articles, and ours", rows, ROWS, foot=foot) + parts
    about = {
        "file": file,
        "script": "scripts/stepwise systems",
        "drawn": drawn,
        "images": pictures,
    }
    return Section("systems", "Other systems", "make systems", parts, answer=_answer(rows), **about)


def _answer(rows: Sequence[dict[str, str]]) -> str:
    """The span of the ratios to Embree, measured beside it, and of those to what articles state of theirs."""
    said = []
    for mark, what in (
        (" over Embree", "as fast as Embree's, side by side on this machine"),
        (" its speed", "as fast as the articles' own figures, of other machines"),
    ):
        found = {}
        for row in rows:
            ratio = RATIO.match(row["ratio"])
            if ratio and mark in row["ratio"]:
                found[float(ratio[1].replace(",", ""))] = row["ratio"].partition(mark)[0]
        if found:
            said.append(f"{found[min(found)]} to {found[max(found)]} {what}")
    return f"Our systems are {'; '.join(said)}." if said else ""
