"""Lines of cache that miss and branches that are mispredicted, by Valgrind's model of a core.

The model is the same on every machine: a first level of 32 KB with 8 ways, a second of 1 MB, a predictor of
two bits a branch. It is simpler than a core of today, so a count says what a program asks for, not what it
costs. N. Nethercote and J. Seward, "Valgrind", PLDI 2007.
"""

import shutil

from study.core import temporary
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT, Scene, Spec

TOOL = "valgrind"
MODEL = ("--cache-sim=yes", "--branch-sim=yes", "--I1=32768,8,64", "--D1=32768,8,64", "--LL=1048576,16,64")
EVENTS = {  # what is counted: its sums of cachegrind's events, and what it is called
    "lines": (("D1mr", "D1mw"), "cache lines into L1"),
    "mispredictions": (("Bcm", "Bim"), "mispredicted branches"),
}


def counted(spec: Spec, scene: Scene, height: int) -> dict[str, int] | None:
    """Events of one frame and its set-up, by the keys of EVENTS; None without Valgrind. Raises StudyError for
    a program that it cannot run, as one with AVX-512."""
    if not shutil.which(TOOL):
        return None
    with temporary.folder(ROOT / "build", ".cachegrind.") as folder:
        out = folder / "out"
        program = [build(spec), scene.path, "-n", str(height), "--json"]
        words = [TOOL, "--tool=cachegrind", *MODEL, f"--cachegrind-out-file={out}", *program]
        done = child.run(words, capture_output=True)
        if done.returncode or not out.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            why = said[-1] if said else done.returncode
            raise StudyError(f"{spec}: Valgrind cannot run it: {why}", CANNOT_RUN)
        lines = out.read_text().splitlines()
    keyed = dict(line.split(":", 1) for line in lines if line[:1].isalpha() and ":" in line)
    found = dict(zip(keyed["events"].split(), map(int, keyed["summary"].split()), strict=True))
    return {name: sum(found[one] for one in events) for name, (events, _) in EVENTS.items()}
