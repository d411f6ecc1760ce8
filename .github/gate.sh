#!/usr/bin/env bash
# Is any phase of this checkout slower than at commit BASE, or its picture wrong?
#   .github/gate.sh BASE FOLDER     FOLDER gets both runs, the comparison and the export
# GATE_PHASES, GATE_HEIGHT, GATE_LAUNCHES choose what is timed; GATE_LEAST, GATE_BY the verdict (docs/gate.md).
set -euo pipefail
shopt -s inherit_errexit # a failed setup or sweep ends the job, in $(…) too
unset CDPATH # with it `cd` prints, and may go elsewhere
if [ $# -ne 2 ]; then
    echo "gate.sh: two arguments are required: a commit to compare with, and a folder for the runs" >&2
    exit 2
fi
here=$(cd -- "$(dirname -- "$0")/.." && pwd -P)
mkdir -p -- "$2"
out=$(cd -- "$2" && pwd -P)
read -ra phases <<<"baseline ${GATE_PHASES:-opt1 opt2 opt3 opt4 opt5_threads opt6_wide opt7_tiles opt8_streams opt9_convex}"
scenes=(scene0 mandelbulb)
by=${GATE_BY:-baseline} least=${GATE_LEAST:-2%}
if ! [[ $by =~ ^(baseline|time|cycles|instructions)$ && $least =~ ^[0-9]*\.?[0-9]+%$ ]]; then
    echo "gate.sh: GATE_BY=$by GATE_LEAST=$least: baseline, time, cycles or instructions; a percentage like 2%" >&2
    exit 2
fi

# What a job left behind that was killed: a worktree, locked if it was being made, or its entry alone. A folder
# of anything else is not touched.
rid() {
    git -C "$here" worktree remove --force --force "$out/base" 2>/dev/null || git -C "$here" worktree prune
    [ -e "$out/base" ] || return 0
    owner=$(sed -n 's/^gitdir: //p' "$out/base/.git" 2>/dev/null) || owner=
    if [ -z "$owner" ] || [ -e "$owner" ]; then
        echo "gate.sh: $out/base is in the way and no worktree of $here; move it, or name another folder" >&2
        exit 2
    fi
    rm -rf -- "$out/base" # of a clone that is gone
}
rid
trap rid EXIT
git -C "$here" worktree add --force --force --detach "$out/base" "$1"

timed() { # CHECKOUT SIDE: a run of its phases, counted too if that is asked for; prints its folder
    make -C "$1" --no-print-directory setup >&2
    said=$("$1/scripts/stepwise" sweep --phase "${phases[@]}" --scene "${scenes[@]}" -n "${GATE_HEIGHT:-180}" \
        --launches "${GATE_LAUNCHES:-8}" --results "$out/$2" --json)
    run=$("$1/.venv/bin/python" -I -c 'import json, sys; print(json.load(sys.stdin)["run"])' <<<"$said")
    if [ "$by" = instructions ]; then
        "$1/scripts/stepwise" flops --measure --phase "${phases[@]}" --scene "${scenes[@]}" \
            -n "${GATE_HEIGHT:-180}" --run "$run" >/dev/null
    fi
    printf '%s\n' "$run"
}

base=$(timed "$out/base" before)
mine=$(timed "$here" after)
failed=0
"$here/scripts/stepwise" verify --phase "${phases[@]}" --scene "${scenes[@]}" -n 180 --run "$mine" || failed=1
"$here/scripts/stepwise" compare --export github-action-benchmark --by baseline -o "$out/times.json" "$mine"
"$here/scripts/stepwise" compare "$base" "$mine" --by "$by" --least "$least" --confirm "$out/base" \
    --fail-on-slower | tee "$out/comparison.txt" || failed=1
exit $failed
