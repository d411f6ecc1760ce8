"""The chapter "Programs" of a run of `stepwise time` or `stepwise import`."""

from study.core import show
from study.core.show import Column, Row
from study.experiments.section import Section, part
from study.numbers import programs
from study.numbers.analysis import Data
from study.numbers.summary import cell
from study.pictures import launch_order

TITLE, QUESTION = "Programs", "How fast is each program here?"
FOOT = (
    "A ratio is the median over rounds of the first program's time over this one's: over 1, this one is "
    "faster. How its interval and its verdict are made is in docs/method.md, Programs."
)


def _text(row: Row, key: str) -> str:
    return cell(show.cell(row, key)) or show.NOTHING


COLUMNS = [Column("", title, lambda row, key=key: _text(row, key)) for key, title in programs.COLUMNS]


def timed(data: Data) -> Section:
    found = programs.rows(data.cells, data.plan)
    if not found:
        return Section("programs", TITLE, "scripts/stepwise time", [])
    said = [f"{one.name} is {one.verdict}, {show.spread(one.ratio)}" for one in found if one.ratio]
    answer = f"Beside {found[0].name}: {'; '.join(said)}." if said else ""
    about = {"answer": answer, "remarks": programs.remarks(found), "script": "scripts/stepwise time"}
    drawn = {"launches": launch_order.drawing(data.frames, data.plan)}
    parts = part("programs", "Times and ratios", found, COLUMNS, FOOT, open=True)
    return Section("programs", TITLE, "scripts/stepwise time", parts, drawn=drawn, **about)
