"""The times in a phase's NOTES.md, beside its parent's, from the published run of the ladder at 1280×720.

They stand below the heading MARK: a paragraph, and in a lesson without a table of ideas a table. What has
threads of its own as its idea has its times on one thread and on two. What other articles built has the table
of its experiment (System.lessons), from the newest published run of `make systems`.
"""

import re
import textwrap
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from study.core import registry, show
from study.core.show import Column, word
from study.experiments import experiment
from study.numbers import analysis, ladder, stats
from study.numbers.analysis import Data
from study.report import facts, lessons

MARK = "## Result <!-- times: stepwise lessons -->\n\n"
IDEAS = "<!-- ideas:"
WIDE, HIGH, COLUMNS = 1280, 720, 100


@cache
def _read(run: Path) -> Data:
    return analysis.load(run)


@cache
def _errors() -> dict[tuple[str, str], str]:
    """PSNR to ground truth, by scene and phase."""
    rows = ladder.rows(_read(lessons.LARGE)).itertuples()
    return {(one.scene, one.phase): show.number(one.truth_own_db) for one in rows}


def _rows(phase: registry.Phase, threads: bool) -> Iterator[dict[str, str]]:
    data = _read(lessons.THREADS if threads else lessons.LARGE)
    pair = [(phase.name, 1), (phase.name, 2)] if threads else [(phase.parent or "", 1), (phase.name, 1)]
    for scene in ("scene0", "mandelbulb"):
        both = [data.cell(scene, name, HIGH, WIDE, count) for name, count in pair]
        before, after = (show.spread(stats.median_interval(one.values.ns / 1e6), 4) for one in both)
        errors = dict.fromkeys(_errors()[scene, name] for name, _ in pair)
        told = {"scene": scene, "before": before, "after": after}
        told["gain"] = show.spread(both[1].over(both[0]), 3, "×")
        yield told | {"error": f"{' → '.join(errors)} dB{' (ideal)' * phase.draws_ideal}"}


def _table(phase: registry.Phase, threads: bool, rows: list[dict[str, str]]) -> str:
    first, second = ("one thread", "two threads") if threads else (phase.parent, phase.name)
    names = {"scene": "scene", "before": f"{first}, ms [95 %]", "after": f"{second}, ms [95 %]"}
    names |= {"gain": "ratio [95 %]", "error": "PSNR to ground truth"}
    return show.markdown(show.table(rows, [Column("", name, word(key)) for key, name in names.items()]))


def _where(run: Path, made: str = "") -> str:
    return f"{facts.short_name(_read(run))} ({made}run `{run.relative_to(registry.ROOT)}`)"


def _of_phase(phase: registry.Phase, inline: bool) -> tuple[str, str]:
    """The paragraph and the table."""
    threads = lessons.threads in lessons.PANELS[phase.name][1]
    run, rows = lessons.THREADS if threads else lessons.LARGE, list(_rows(phase, threads))
    about = f"{'' if threads else 'One thread, '}{WIDE}×{HIGH}, {_where(run)}"
    if not inline:
        return f"{about}.", _table(phase, threads, rows)
    told = "On {scene} {before} → {after} ms, {gain}, {error}" + " to truth" * (not phase.draws_ideal)
    return f"{about}. {'. '.join(told.format(**row) for row in rows)}.".replace("\u00a0", " "), ""


def _of_system(phase: registry.Phase, run: Path) -> tuple[str, str]:
    """The same of what another article built. Raises StudyError for a broken file."""
    systems = (one.system(run) for one in experiment.find_all().values() if one.system)
    (part,) = (part for one in systems if one for part in one.lessons() if part.name == phase.name)
    about = f"{part.caption}. One thread, {_where(run, '`make systems`, ')}. {part.foot}"
    return about.strip(), show.markdown(part.table)


def filled(name: str, text: str) -> str | None:
    """The lesson with its times made anew; None where it has no MARK."""
    before, mark, rest = text.partition(MARK)
    if not mark:
        return None
    phase, inline = registry.find_phase(name), IDEAS in rest
    system = phase.family == registry.SYSTEMS
    about, table = _of_system(phase, lessons.systems()) if system else _of_phase(phase, inline)
    lines = textwrap.fill(about, COLUMNS, break_long_words=False, break_on_hyphens=False)
    old = r"\A(?:[^\n|#!].*\n)+" + ("" if inline else r"(?:\n(?:\|.*\n)+)?")
    made = f"{lines}\n" + ("" if inline else f"\n{table}")
    return before + mark + re.sub(old, lambda _: made.replace("\u00a0", " "), rest)
