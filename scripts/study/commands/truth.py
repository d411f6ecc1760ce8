"""The exact pictures that phases are judged by: made once, kept in build/truth/cache; how sure each is."""

from __future__ import annotations

import dataclasses

from study.core import cli, registry
from study.truth import truth


def table(found: list[truth.Summary]) -> str:
    """One line a scene."""
    heads = ["scene", "size", "proved", "exactly", "undecided", "converged only", "widest", "seconds"]
    rows = [heads]
    for s in found:
        counts = [s.proved, s.decided_exactly, s.undecided, s.converged_only]
        measures = [f"{s.widest:.1e}", f"{s.seconds:.1f}"]
        rows.append([s.scene, f"{s.width}x{s.height}", *map(str, counts), *measures])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(lines)


def main() -> int:
    parser = cli.parser(__doc__, {1: "a ray of a scene without a fractal stayed undecided"})
    parser.add_argument("scene", nargs="*", metavar="SCENE", help="default: all")
    parser.add_argument(
        "-n", type=cli.at_least(1), default=720, metavar="HEIGHT", help="height in pixels; default: 720"
    )
    parser.add_argument(
        "-w", type=cli.at_least(1), metavar="WIDTH", help="width in pixels; default: 16:9, two_spheres square"
    )
    args = parser.parse_args()
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]
    found = []
    for scene in scenes:
        cli.say(f"{scene.name} ...")
        found.append(truth.summary(scene, scene.size(args.n, args.w)))
    if args.json:
        cli.emit({"schema": 1, "scenes": [dataclasses.asdict(item) for item in found]})
    else:
        print(table(found))
        print(
            "Pixels by their primary ray; widest: enclosure of t in scene units; seconds: when it was made."
        )
    smooth = {scene.name for scene in scenes if not scene.fractal}
    return cli.FAILED if any(s.undecided for s in found if s.scene in smooth) else cli.OK
