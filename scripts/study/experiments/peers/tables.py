"""Our phases beside other programs as tables and a figure, made from peers.json alone."""

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.section import Found, Part, chapters, part
from study.numbers.beside import PEERS, PeerRow, Peers
from study.pictures import dots
from study.pictures.draw import Drawing

COLUMNS = [
    Column("", "scene", lambda r: r.scene),
    Column("", "threads", lambda r: str(r.threads)),
    Column("", "program", lambda r: r.program),
    Column("", "ms [95 %]", lambda r: show.spread(r.ms)),
    Column("", "times the fastest phase's [95 %]", lambda r: show.spread(r.ratio, 3, "×")),
    Column("", "PSNR to ground truth, dB", lambda r: r.psnr),
    Column("", "to the exact surface, dB", lambda r: show.number(r.surface_db)),
]
PROGRAMS = [
    Column("", "program", lambda r: r.program),
    Column("", "version", lambda r: r.version),
    Column("", "what is timed", lambda r: r.timed),
    Column("", "why its picture is not ours", lambda r: r.differs),
    Column("", "wrong below, dB", lambda r: " / ".join(f"{x:g}" for x in dict.fromkeys(r.least_db.values()))),
]


def title(row: PeerRow) -> str:
    return f"{row.scene}, {row.threads} thread{'s' * (row.threads > 1)}"


def draw(rows: Sequence[PeerRow]) -> Figure:
    """Ours in blue, the others in grey, the fastest first."""
    panels = list(dict.fromkeys(title(row) for row in rows))
    shown = []
    for row in sorted(rows, key=lambda row: (panels.index(title(row)), row.ms.ends)):
        dot = dots.Dot(title(row), row.program, *row.ms.ends, show.decibels(row.psnr))
        shown.append(dot if row.kind == "phase" else replace(dot, colour=dots.QUIET))
    return dots.draw(shown, "What a frame takes, and its PSNR to ground truth: our phases in blue", "ms")


def answer(result: Peers) -> str:
    """The fastest peer of each scene on one thread, and how many times as long it takes as our phase."""
    said = []
    rows = [row for row in result.rows if row.threads == 1]
    for scene in dict.fromkeys(row.scene for row in rows):
        peers = [row for row in rows if row.scene == scene and row.ratio and row.kind == "peer"]
        best = min(peers, key=lambda row: row.ms.ends, default=None)
        ours = [row for row in rows if best and (row.scene, row.program) == (scene, best.beside)]
        if best and ours:
            said.append(
                f"{best.program} takes {show.spread(best.ratio, 3, '×')} the time of {best.beside} "
                f"on {scene} ({show.decibels(best.psnr)}, ours {show.decibels(ours[0].psnr)})"
            )
    return f"On one thread, the fastest peer of each scene: {'; '.join(said)}." if said else ""


def note(result: Peers) -> str:
    lines = [
        f"{result.machine}; n = {result.n}, {result.launches} interleaved launches; errors in linear RGB at "
        f"n = {result.error_n}, of a Mandelbulb's 4×4 means. Scenes `_plain` have no shadows and no mirrors. "
        "Start, compiling and output are in no time."
    ]
    for one in result.left_out:
        scene = f" on {one.scene}" if one.scene else ""
        lines.append(f"Left out: {one.phase}{scene}: {one.reason}.")
    return "\n".join(lines)


def wrong(result: Peers) -> list[str]:
    """Pictures that are further from ground truth than their program's known differences explain."""
    least = {one.program: one.least_db for one in result.programs}
    made = []
    for row in result.rows:
        wanted = least.get(row.program, {}).get(row.scene)
        if wanted and row.threads == 1 and not row.level >= wanted:
            text = f"{show.decibels(row.psnr)} to ground truth, less than {wanted:g}"
            made.append(f"{row.program} on {row.scene}: {text}")
    return made


def parts(result: Peers) -> list[Part]:
    made = part("peers", "Our phases and other programs", result.rows, COLUMNS, note(result))
    return made + part("peers-programs", "The other programs", result.programs, PROGRAMS)


def found(result: Peers) -> Found:
    caption = "Time of a frame by our phases and by other programs, with each one's PSNR to ground truth"
    drawn = {"peers": Drawing(caption, note(result), lambda: draw(result.rows))}
    return Found(parts(result), answer(result), drawn)


section = chapters("peers", "Beside what one would use instead", PEERS, Peers, found)
