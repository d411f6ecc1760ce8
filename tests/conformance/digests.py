#!/usr/bin/env python3
"""Digests of every phase's pictures and FLOP counts, to hold a refactoring against what was there.

    digests.py -o OLD.json            on the commit to keep to
    digests.py --against OLD.json     after a change: lists what differs, exit status 1 if anything does

A digest covers all channels of a picture: phase x scene x lane width, at n = 90 and at 97x53. Counts are
those of render-count at n = 90. Digests depend on the CPU (approximate reciprocal roots), so git keeps none.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from study.core import registry  # noqa: E402  (the package stands in scripts/)
from study.pictures import images  # noqa: E402

SIZES = {"n90": ("-n", "90"), "97x53": ("-n", "53", "-w", "97")}
COUNTED = ("scene0", "mandelbulb", "trio", "csg", "metaballs")
LIMITS = {16: "", 8: "avx2", 4: "none"}  # STEPWISE_ISA_LIMIT by lane width
KEYS = ("calls", "lanes", "paper", "machine", "useful")  # of a function
SLOW = {registry.TRUTH}  # families that are drawn at 97x53 only


def run(program: Path, *arguments: str, limit: str) -> tuple[int, str]:
    """Exit status, and standard output or the last line of the errors."""
    env = os.environ | {"STEPWISE_ISA_LIMIT": limit}
    done = subprocess.run([program, *arguments], capture_output=True, text=True, env=env)
    return done.returncode, done.stdout if done.returncode == 0 else done.stderr.strip()[-200:]


def picture(program: Path, scene: Path, size: tuple[str, ...], limit: str) -> str:
    """SHA-256 of every channel's name and bytes; "status N" where the phase draws no picture."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "picture.exr"
        status, _ = run(program, str(scene), *size, "--aov", "-o", str(out), limit=limit)
        if status:
            return f"status {status}"
        planes, digest = images.read(out), hashlib.sha256()
        for name in sorted(planes):
            digest.update(name.encode() + planes[name].tobytes())
    return digest.hexdigest()[:16]


def counts(program: Path, scene: Path, limit: str) -> str:
    """FLOPs by both conventions, and a digest of every function's calls, lanes and parts."""
    status, said = run(program, str(scene), "-n", "90", "--json", limit=limit)
    if status:
        return f"status {status}"
    record = json.loads(said)
    # Without the functions' names: a rename is no difference.
    rows = sorted(
        sorted(one["parts"].values()) + [one[key] for key in KEYS] for one in record["by_function"].values()
    )
    digest = hashlib.sha256(json.dumps([row for row in rows if any(row)]).encode()).hexdigest()[:16]
    return f"{record['flops']} by function {digest}"


def measure(build: Path, phases: list[str], scenes: list[str]) -> dict[str, str]:
    """Digest by "phase scene size lanes" and count by "phase scene count lanes"."""
    jobs = {}
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for name in phases:
            phase = registry.find_phase(name)
            widths = [one.lanes for one in phase.variants] or [phase.lanes]
            for lanes in widths:
                limit = LIMITS[lanes] if phase.variants else ""
                for scene in scenes:
                    path = registry.find_scene(scene).path
                    for size, words in SIZES.items():
                        if phase.family in SLOW and size == "n90":
                            continue
                        key = f"{name} {scene} {size} {lanes}"
                        jobs[key] = pool.submit(picture, build / name / "render", path, words, limit)
                    if scene in COUNTED and (build / name / "render-count").exists():
                        key = f"{name} {scene} count {lanes}"
                        jobs[key] = pool.submit(counts, build / name / "render-count", path, limit)
        return {key: job.result() for key, job in jobs.items()}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="folder of the programs")
    parser.add_argument("--phase", nargs="+", default=list(registry.phases()))
    parser.add_argument("--scene", nargs="+", default=[*registry.scenes(), *registry.groups()])
    parser.add_argument("-o", "--out", type=Path, help="write the table as JSON")
    parser.add_argument("--against", type=Path, help="a table to compare with")
    return parser.parse_args()


def main() -> int:
    options = arguments()
    table = measure(options.build, options.phase, options.scene)
    if options.out:
        options.out.write_text(json.dumps(table, indent=1) + "\n")
    print(f"{len(table)} digests and counts")
    if not options.against:
        return 0
    old = json.loads(options.against.read_text())
    wanted = {key: value for key, value in old.items() if key.split()[0] in options.phase}
    wanted = {key: value for key, value in wanted.items() if key.split()[1] in options.scene}
    wrong = [key for key in sorted(wanted.keys() | table.keys()) if wanted.get(key) != table.get(key)]
    for key in wrong:
        print(f"differs: {key}: {wanted.get(key)} -> {table.get(key)}"[:300])
    print(f"{len(wrong)} of {len(wanted)} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
