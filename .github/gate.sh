#!/usr/bin/env bash
# Is any phase of this checkout slower than at commit BASE, in units of baseline's time, or its picture wrong?
#   .github/gate.sh BASE FOLDER     FOLDER gets both runs, the comparison and the export
# GATE_PHASES, GATE_HEIGHT, GATE_LAUNCHES choose what is timed. docs/gate.md explains the verdict.
set -euo pipefail
if [ $# -ne 2 ]; then
    echo "gate.sh: two arguments are required: a commit to compare with, and a folder for the runs" >&2
    exit 2
fi
here=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$2"
out=$(cd "$2" && pwd)
read -ra phases <<<"baseline ${GATE_PHASES:-opt1 opt2 opt3 opt4 opt5_threads opt6_wide opt7_tiles opt8_streams opt9_convex}"
git -C "$here" worktree add --force --detach "$out/base" "$1"
trap 'git -C "$here" worktree remove --force "$out/base"' EXIT

timed() { # CHECKOUT SIDE: a run of its phases; prints its folder
    make -C "$1" --no-print-directory setup >&2
    "$1/scripts/stepwise" sweep --phase "${phases[@]}" --scene scene0 mandelbulb -n "${GATE_HEIGHT:-180}" \
        --launches "${GATE_LAUNCHES:-8}" --results "$out/$2" --json |
        "$1/.venv/bin/python" -c 'import json, sys; print(json.load(sys.stdin)["run"])'
}

base=$(timed "$out/base" before)
mine=$(timed "$here" after)
failed=0
"$here/scripts/stepwise" verify --phase "${phases[@]}" --scene scene0 mandelbulb -n 180 --run "$mine" || failed=1
"$here/scripts/stepwise" compare --export github-action-benchmark --by baseline -o "$out/times.json" "$mine"
"$here/scripts/stepwise" compare "$base" "$mine" --by baseline --fail-on-slower | tee "$out/comparison.txt" || failed=1
exit $failed
