"""A side of stepwise peers: NAME TASK.json, in the Python that has what draw_NAME imports.

Prints one JSON object: ns of each frame after the first UNTIMED, which compile, and the version. The origin
moves by a hair from frame to frame; the picture is of the first.
"""

import importlib
import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np


def main():
    name, path = sys.argv[1:]
    sys.path.insert(0, str(Path(__file__).parent))  # which -I leaves out
    program = importlib.import_module(f"draw_{name}")
    text = Path(path).read_text(encoding="utf-8")
    task = json.loads(text, object_hook=lambda keys: SimpleNamespace(**keys))
    render, picture, version = program.renderer(task)
    ns = []
    for number in range(program.UNTIMED + task.frames):
        origin = [p + 1e-6 * number for p in task.position]
        begun = time.perf_counter_ns()
        render(origin)
        ns.append(time.perf_counter_ns() - begun)
        if number == 0 and task.out:
            np.save(task.out, picture())
    print(json.dumps({"ns": ns[program.UNTIMED :], "version": version}))


if __name__ == "__main__":
    main()
