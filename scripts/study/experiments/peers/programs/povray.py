"""POV-Ray 3.7: the scene's solids as its own, intersected in closed form and in double."""

import itertools
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.scene_json import Content, Material, Shape
from study.experiments.peers import shader
from study.experiments.peers.peer import Drawn, Job, Peer, run

TIME = re.compile(r"Trace Time: .*\(([0-9.]+) seconds\)")
FADE = 1e-6  # its light falls off as 2/(1 + d/FADE), which is 2 FADE/d to 1e-7 of it


def vector(v: Sequence[float]) -> str:
    return f"<{', '.join(repr(float(x)) for x in v)}>"


def solid(s: Shape) -> str:
    """The shape where its own coordinates have it. Raises StudyError for one that POV-Ray lacks."""
    if s.type == "sphere":
        return f"sphere {{ 0, {s.radius!r}"
    if s.type == "plane":
        return f"plane {{ {vector(s.normal)}, {s.offset / float(np.linalg.norm(s.normal))!r}"
    if s.type == "box" and not s.rounding:
        return f"box {{ {vector(np.negative(s.half_size))}, {vector(s.half_size)}"
    if s.type == "torus":
        return f"torus {{ {s.major_radius!r}, {s.minor_radius!r}"
    if s.type == "cone":
        h = s.half_height
        return f"cone {{ {vector([0, -h, 0])}, {s.bottom_radius!r}, {vector([0, h, 0])}, {s.top_radius!r}"
    if s.type == "octahedron":
        faces = itertools.product(*([-s.radius * axis, s.radius * axis] for axis in np.eye(3)))
        triangles = [f"triangle {{ {', '.join(map(vector, corners))} }}" for corners in faces]
        return "\n".join(["mesh {", *triangles])
    raise StudyError(f"POV-Ray has no {s.type}{' with rounded edges' if s.type == 'box' else ''}")


def finish(m: Material, fog: float) -> str:
    """A material, which fog blends into black: a map of textures by the distance from the origin."""
    lit = (
        f"pigment {{ rgb {vector(m.color)} }} finish {{ ambient 0.01 diffuse 1 phong 0.2 "
        f"phong_size {m.shininess!r} }}"
    )
    if not fog:
        return f"texture {{ {lit} }}"
    dark = "pigment { rgb 0 } finish { ambient 0 diffuse 0 }"
    share = f"function {{ exp(-{fog!r} * pow(x*x + y*y + z*z, 1.5)) }}"
    return f"texture {{ {share} texture_map {{ [0 {dark}] [1 {lit}] }} }}"


def translated(scene: Content, width: int, height: int) -> str:
    """The scene for POV-Ray, whose coordinates are ours. Raises StudyError for what it lacks."""
    seen, light = shader.camera(scene, width, height), scene.light
    if light.shadows in ("soft", "ideal") or any(m.reflectivity for m in scene.materials.values()):
        raise StudyError("POV-Ray has other soft shadows and mirrors")
    lines = [
        "#version 3.7;",
        "global_settings { assumed_gamma 1.0 ambient_light rgb 1 }",
        f"background {{ rgb {vector(scene.background)} }}",
        f"camera {{ perspective location {vector(seen.position)} direction {vector(seen.ahead)} "
        f"right 2 * {vector(seen.right)} up 2 * {vector(seen.up)} }}",
        f"light_source {{ {vector(light.position)}, rgb {vector(np.divide(light.emission, 2 * FADE))} "
        f"fade_distance {FADE} fade_power 1 }}",
    ]
    for shape, material in zip(scene.shapes, scene.of_shapes, strict=True):
        if any(shape.repeat):
            raise StudyError("POV-Ray repeats no shape")
        matrix = [*shader.turn(shape.rotation_degrees).flatten(), *shape.position]
        bounds = f"clipped_by {{ sphere {{ 0, {scene.march.bounds_radius!r} }} }}"
        lines += [
            solid(shape),
            f"matrix {vector(matrix)}",
            bounds if shape.type == "plane" else "",
            finish(material, scene.fog),
            # A light that is `shadowless` has no highlights, so here no shape throws a shadow.
            "no_shadow" if light.shadows == "none" else "",
            "}",
        ]
    return "\n".join(lines) + "\n"


def read_linear(path: Path) -> np.ndarray:
    pixels = oiio.ImageBuf(str(path)).get_pixels("uint16")
    if pixels is None or not pixels.size:
        raise StudyError(f"POV-Ray: {path.name} is no readable picture", CANNOT_RUN)
    return pixels[:, :, :3].astype(np.float32) / np.float32(65535)


@dataclass(frozen=True)
class POVRay(Peer):
    """Timed without a picture file; the picture is of a launch of its own."""

    def lacking(self) -> str | None:
        return None if shutil.which("povray") else "needs Debian's package povray"

    def draw(self, job: Job) -> Drawn:
        (job.folder / "scene.pov").write_text(translated(job.scene.content, *job.size), encoding="utf-8")
        program = shutil.which("povray") or "povray"
        words = ["+Iscene.pov", f"+W{job.size[0]}", f"+H{job.size[1]}", f"+WT{job.threads}", "-D", "-A", "-V"]
        words += ["+FN16", "File_Gamma=1.0", "+Opicture.png"] if job.picture else ["-F"]
        ns = []
        for _ in range(1 if job.picture else job.frames):
            _, said = run([program, *words], job, self.title)
            found = TIME.search(said)
            if not found:
                raise StudyError(f"{self.title}: says no trace time", CANNOT_RUN)
            ns.append(float(found[1]) * 1e9)
        about = child.run([program, "--version"], capture_output=True, text=True)
        version = re.search(r"^POV-Ray (\S+)", about.stdout + about.stderr, re.MULTILINE)
        return Drawn(
            ns,
            version[1] if version else "unknown",
            read_linear(job.folder / "picture.png") if job.picture else None,
        )


PEER = POVRay(
    name="povray",
    title="POV-Ray",
    timed="its own trace time, in ms, without parsing and output",
    differs="closed form in double; its picture has 16 bits a channel",
    least_db={"scene0_plain": 100},
)
