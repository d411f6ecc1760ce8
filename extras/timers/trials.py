#!/usr/bin/env python3
"""How often `stepwise time`, hyperfine and pyperf are wrong about two programs of which one takes 2 % longer.

    .venv/bin/python extras/timers/trials.py --trials 200 --pyperf PYTHON

A trial lets each tool compare both, with its own defaults; which stands first is random. In every other
trial a neighbour begins in the tool's mid-run: a busy process on each CPU. Nothing else may run meanwhile.
The programs spin for fixed counts, 13 ms and 2 % more. hyperfine is to be installed; PYTHON is of an
environment with pyperf.
"""

import argparse
import collections
import json
import math
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SPIN = """
#include <stdlib.h>
int main(int argc, char **argv) {
    double x = argc;
    for (unsigned long i = strtoul(argv[1], NULL, 10); i; i--) {
        x *= 1.0000001;
        __asm__ volatile("" : "+x"(x));
    }
    return x < 0;
}
"""
SLOWER, MS = 1.02, 13.0
RIGHT, WRONG, OPEN = "right", "wrong", "not told"


def quiet(*words: object) -> str:
    return subprocess.run([*map(str, words)], capture_output=True, text=True, check=True, cwd=ROOT).stdout


def stepwise(first: str, second: str, folder: Path) -> tuple[float | None, float, float]:
    """Measures as all tools here: time of the second over the first, None where it does not tell them
    apart, and the interval that it gives."""
    said = quiet("scripts/stepwise", "time", "--json", "--results", folder, "--", first, ":::", second)
    row = json.loads(said)["result"]["rows"][1]
    ratio = row["ratio"]
    told = row["verdict"] in ("faster", "slower") or row["verdict"].startswith("the same")
    if row["verdict"].startswith("the same"):
        return 1.0, 1 / ratio["high"], 1 / ratio["low"]
    if ratio["low"] is None:
        return None, math.nan, math.nan
    return (1 / ratio["value"] if told else None), 1 / ratio["high"], 1 / ratio["low"]


def hyperfine(first: str, second: str, folder: Path) -> tuple[float | None, float, float]:
    """It names the faster one whatever the deviation, which it prints: one standard deviation."""
    quiet("hyperfine", "-N", "--style", "none", "--export-json", folder / "h.json", first, second)
    one, two = json.loads((folder / "h.json").read_text())["results"]
    ratio = two["mean"] / one["mean"]
    wide = ratio * math.hypot(one["stddev"] / one["mean"], two["stddev"] / two["mean"])
    return ratio, ratio - wide, ratio + wide


def pyperf(python: str):
    def compare(first: str, second: str, folder: Path) -> tuple[float | None, float, float]:
        """Significant by its t-test, or not; of the means it prints one standard deviation."""
        files = [folder / "1.json", folder / "2.json"]
        for file, command in zip(files, (first, second), strict=True):
            file.unlink(missing_ok=True)
            quiet(python, "-m", "pyperf", "command", "-q", "-o", file, "--", *command.split())
        said = quiet(python, "-m", "pyperf", "compare_to", *files)
        means, deviations = [], []
        for file in files:
            values = [
                v
                for run in json.loads(file.read_text())["benchmarks"][0]["runs"]
                for v in run.get("values", [])
            ]
            means.append(statistics.mean(values))
            deviations.append(statistics.stdev(values) / means[-1])
        ratio, wide = means[1] / means[0], math.hypot(*deviations)
        return (
            (None if re.search("not significant", said, re.I) else ratio),
            ratio * (1 - wide),
            ratio * (1 + wide),
        )

    return compare


def neighbour(spin: Path, after: float, over: threading.Event) -> None:
    """Spins on every CPU that is ours from `after` seconds on, until the tool is over."""
    if over.wait(after):
        return
    busy = [subprocess.Popen([spin, str(10**15)]) for _ in os.sched_getaffinity(0)]
    over.wait()
    for one in busy:
        one.kill()
        one.wait()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--pyperf", metavar="PYTHON")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", action="store_true", help="stepwise time without the others")
    args = parser.parse_args()
    tools = {"stepwise time": stepwise} | ({} if args.alone else {"hyperfine": hyperfine})
    tools |= {"pyperf": pyperf(args.pyperf)} if args.pyperf else {}
    dice, found = random.Random(args.seed), collections.defaultdict(list)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "spin.c").write_text(SPIN)
        quiet("gcc", "-O2", "-static", folder / "spin.c", "-o", folder / "spin")
        begun = time.monotonic()
        quiet(folder / "spin", 10**7)
        count = round(MS / 1000 / (time.monotonic() - begun) * 10**7)
        programs = {f"{folder}/spin {count}": 1.0, f"{folder}/spin {round(SLOWER * count)}": SLOWER}
        usual = {name: 5.0 for name in tools}  # s, of the last trial without a neighbour
        for trial in range(args.trials):
            first, second = dice.sample(list(programs), 2)
            truth = programs[second] / programs[first]
            for name, tool in tools.items():
                disturbed = trial % 2 == 1
                over = threading.Event()
                after = usual[name] * dice.uniform(0.2, 0.8) if disturbed else math.inf
                beside = threading.Thread(target=neighbour, args=(folder / "spin", after, over))
                if disturbed:
                    beside.start()
                begun = time.monotonic()
                try:
                    told, low, high = tool(first, second, folder)
                    took = time.monotonic() - begun
                finally:
                    over.set()
                    if disturbed:
                        beside.join()
                if not disturbed:
                    usual[name] = took
                verdict = OPEN if told is None else RIGHT if (told - 1) * (truth - 1) > 0 else WRONG
                found[name, disturbed].append((verdict, low, high, truth, took))
            print(
                f"trial {trial + 1} of {args.trials}",
                {n: found[n, trial % 2 == 1][-1] for n in tools},
                file=sys.stderr,
            )
    print("| tool | neighbour | trials | right | not told | wrong | interval ± % | holds 2 % | s a trial |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for (name, disturbed), some in sorted(found.items()):
        counts = collections.Counter(one[0] for one in some)
        widths = [100 * (high - low) / 2 for _, low, high, _, _ in some if high > low]
        held = statistics.mean(low <= truth <= high for _, low, high, truth, _ in some)
        cells = [
            name,
            "in mid-run" if disturbed else "none",
            len(some),
            counts[RIGHT],
            counts[OPEN],
            counts[WRONG],
        ]
        cells += [f"{statistics.median(widths):.2g}" if widths else "–", f"{100 * held:.0f} %"]
        print("|", " | ".join(map(str, [*cells, f"{statistics.median(one[4] for one in some):.1f}"])), "|")


if __name__ == "__main__":
    main()
