"""Our phases beside other programs: scenes, launches in turn, errors to ground truth."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.core import cli, registry, run, store, temporary
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments.peers.peer import Drawn, Job, Peer
from study.measuring import launches
from study.numbers import stats
from study.numbers.beside import PeerRow
from study.numbers.schema import Interval, Skipped
from study.pictures import images
from study.truth import judging, truth
from study.truth.judging import FACTOR

FRAMES = 4  # timed ones of a launch; one where a frame takes a second
PHASES = ("opt4", "opt9_convex", "opt10_scene")
Errors = dict[str, Any]  # the keys of PictureErrors


@dataclass(frozen=True)
class Point:
    program: str
    scene: str
    threads: int


def plain(name: str, folder: Path) -> Scene:
    """The scene without shadows and mirrors, as NAME_plain.json in `folder`."""
    scene = registry.find_scene(name.removesuffix("_plain"))
    materials = {key: {**one, "reflectivity": 0.0} for key, one in scene.data["materials"].items()}
    light = {**scene.data["light"], "shadows": "none"}
    data = {**scene.data, "light": light, "materials": materials}
    path = folder / f"{scene.name}_plain.json"
    store.write_json(path, data)
    return Scene(path.stem, path, data, scene.fractal)


def errors(exact: images.Picture, rgb: np.ndarray, fractal: bool) -> Errors:
    """Errors of linear colours to ground truth, where it knows them. A fractal's 4×4 means are held against a
    march, and a Mandelbulb's against its exact surface too."""
    found = _to(images.rgb(exact), exact["status.all"] >= truth.MARCHED, rgb, fractal)
    if judging.has_surface(exact):
        surface = _to(images.rgb(exact, "surface."), exact["surface.status"] == truth.PROVED, rgb, fractal)
        found["surface_db"] = surface["psnr_db"]
    return cli.plain(found | {"averaged": fractal})


def _to(exact: np.ndarray, known: np.ndarray, rgb: np.ndarray, fractal: bool) -> Errors:
    known = known & np.isfinite(exact).all(axis=-1)
    base, own = (np.where(known[..., None], one, 0).astype(np.float32) for one in (exact, rgb))
    bad = int((~np.isfinite(own)).sum())
    if fractal:
        whole = np.repeat(known[..., None], 3, axis=-1).astype(np.float32)
        known = images.box_average(whole, FACTOR)[..., 0] == 1
        base, own = images.box_average(base, FACTOR), images.box_average(own, FACTOR)
    found = images.colour_errors(base, own, False, known)
    names = ("psnr_db", "rmse", "fraction_over_1_255", "psnr_display_db")
    return {name: found[name] for name in names} | {"non_finite": bad}


class Measuring:
    """Draws and times points. `others`: what is not ours, by its name."""

    def __init__(
        self, others: Mapping[str, Peer], scenes: Mapping[str, Scene], height: int, cpu: int
    ) -> None:
        self.others, self.scenes, self.height, self.cpu = others, scenes, height, cpu
        self.versions: dict[str, str] = {}
        self.reps: dict[tuple[str, str], int] = {}

    def title(self, program: str) -> str:
        return self.others[program].title if program in self.others else program

    def draw(self, point: Point, height: int, frames: int, padding: int = 0, picture: bool = False) -> Drawn:
        """One launch. Raises StudyError."""
        scene = self.scenes[point.scene]
        size = scene.size(height)
        with temporary.folder() as folder:
            if point.program in self.others:
                cpus = run.cpu_set(self.cpu, point.threads) or set(run.USABLE)
                job = Job(scene, size, point.threads, frames, cpus, folder, padding, picture)
                return self.others[point.program].draw(job)
            out = folder / "picture.exr" if picture else None
            how: dict[str, Any] = {"cpu": self.cpu, "threads": point.threads, "env_bytes": padding}
            how |= {"warmup": int(frames > 1), "reps": frames, "out": out}
            made = launches.render(point.program, scene.path, size[1], size[0], **how)
            ns = [frame.ns for frame in made.timed]
            return Drawn(ns, "", images.rgb(images.read(out)) if out else None)

    def judge(self, point: Point, height: int) -> Errors:
        """Errors of its picture `height` rows high; keeps its version and how many frames a launch has."""
        scene = self.scenes[point.scene]
        made = self.draw(point, height, 1, picture=True)
        assert made.rgb is not None
        self.versions[point.program] = made.version
        second = min(made.ns) * (self.height / height) ** 2 > 1e9
        self.reps[point.program, point.scene] = 1 if second else FRAMES
        return errors(truth.picture(scene, scene.size(height)), made.rgb, scene.fractal)

    def judged(
        self, points: Sequence[Point], height: int
    ) -> tuple[dict[tuple[str, str], Errors], list[Skipped]]:
        found, out = {}, []
        for program, scene in dict.fromkeys((point.program, point.scene) for point in points):
            try:
                found[program, scene] = self.judge(Point(program, scene, 1), height)
            except StudyError as error:
                out.append(Skipped(phase=self.title(program), scene=scene, reason=str(error)))
        return found, out

    def once(self, point: Point, padding: int) -> float:
        """Median ns of a launch's frames."""
        frames = self.reps[point.program, point.scene]
        return float(np.median(self.draw(point, self.height, frames, padding).ns))

    def rows(
        self, times: Mapping[Point, Sequence[float]], told: Mapping[tuple[str, str], Errors]
    ) -> list[PeerRow]:
        """One per point, held against the fastest phase on as many threads."""
        made = []
        for point, ns in times.items():
            same = [p for p in times if (p.scene, p.threads) == (point.scene, point.threads)]
            ours = [p for p in same if p.program not in self.others]
            best = min(ours, key=lambda p: np.median(times[p]), default=None)
            ratio = None if best in (None, point) else Interval.of(stats.ratio_interval(ns, times[best]))
            made.append(
                PeerRow(
                    program=self.title(point.program),
                    kind="peer" if point.program in self.others else "phase",
                    scene=point.scene,
                    threads=point.threads,
                    ns=list(ns),
                    ms=Interval.of(stats.median_interval(np.array(ns) * 1e-6)),
                    beside=best.program if best else None,
                    ratio=ratio,
                    **told[point.program, point.scene],
                )
            )
        return made


def points(
    specs: Sequence[Spec], others: Mapping[str, Peer], scenes: Iterable[str], threads: Sequence[int]
) -> list[Point]:
    """Each scene that another program draws, by that program and by our phases."""
    made = []
    for scene in scenes:
        for count in dict.fromkeys(threads):
            theirs = [n for n, one in others.items() if scene in one.least_db and (count == 1 or one.cores)]
            if not theirs:
                continue
            ours = [s for s in specs if count == 1 or registry.find_phase(s.phase).threads]
            made += [Point(str(name), scene, count) for name in (*ours, *theirs)]
    return made
