"""Every enclosure that truth calls proved holds: random and adversarial rays, judged in rational numbers.

STEPWISE_RAYS is the number of rays a shape: 4,000 when not given, and 100,000 for the full count.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import enclosures
import numpy as np
import oracle
import pytest

from study.core.build import build

pytestmark = pytest.mark.slow

COUNT = int(os.environ.get("STEPWISE_RAYS", "4000"))
CHUNK = 1000
FRAMES = {  # share of the rays, the shape's frame
    "plain": (0.65, {}),
    "rotated": (0.3, {"rotation_degrees": enclosures.ROTATION, "position": enclosures.POSITION}),
    "roomy": (0.025, {"repeat": enclosures.CELLS["roomy"]}),
    "tight": (0.025, {"repeat": enclosures.CELLS["tight"]}),
}
EASY = ("_random", "_far")  # of these few may stay undecided


def chunk(program, path, kind, frame, count, seed):
    """Counts, faults and the share of easy rays left undecided of a lot of rays, in a process of its own."""
    local, which = enclosures.rays(kind, count, seed)
    data = json.loads(path.read_text())
    # From outside the bounds a march's first step decides: test_known_rays.py.
    near = np.linalg.norm(local[:, :3], axis=1) < data["march"]["bounds_radius"]
    rays, which = (enclosures.moved(local) if frame == "rotated" else local)[near], which[near]
    claims = enclosures.claimed(program, path, rays)
    counts, faults = enclosures.judge(data, rays, claims)
    easy = np.isin(which, [i for i, make in enumerate(enclosures.MAKERS) if make.__name__ in EASY])
    counts["easy"] += int(easy.sum())
    counts["easy undecided"] += int((easy & (claims[:, 0] == 0)).sum())
    hit = (claims[:, 0] == 2) & (claims[:, 1] >= 0)
    wide = (claims[hit, 3] - claims[hit, 2]) / np.maximum(1, claims[hit, 3])
    return counts, faults, float(wide.max(initial=0))


@pytest.mark.parametrize("kind", enclosures.SHAPES)
def test_enclosures_hold(kind, tmp_path):
    program = build("truth", "rays")
    tasks = []
    for number, (frame, (share, extra)) in enumerate(FRAMES.items()):
        path = tmp_path / f"{kind}-{frame}.json"
        path.write_text(json.dumps(enclosures.scene(kind, **extra)))
        left, seed = round(share * COUNT), 10_000 * number
        while left > 0:
            tasks.append((program, path, kind, frame, min(left, CHUNK), seed))
            left, seed = left - CHUNK, seed + 1
    total, faults, widest = Counter(), [], 0.0
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for task, (counts, wrong, wide) in zip(
            tasks, pool.map(chunk, *zip(*tasks, strict=True)), strict=True
        ):
            total += counts
            faults += [f"{task[1].name}: {line}" for line in wrong]
            widest = max(widest, wide)
    print(f"{kind}: {dict(total)}, widest {widest:.1e}")
    assert not faults, f"{len(faults)} violations, the first of them:\n" + "\n".join(faults[:5])
    judged = total["hit"] + total["miss"] + total["undecided"]
    assert judged > 0.98 * COUNT
    assert total["hit"] > 0.5 * judged and total["miss"] > 0.05 * judged
    assert total["easy undecided"] <= 0.02 * total["easy"]
    assert widest <= 1e-8


@pytest.mark.parametrize("kind", enclosures.SHAPES)
def test_a_wrong_claim_is_noticed(kind):
    """Claims made from the oracle's own answers pass; each of them falsified is a violation."""
    data = enclosures.scene(kind)
    rays = enclosures.rays(kind, 60, 1)[0]
    claims = np.empty((len(rays), 5))
    for ray, claim in zip(rays.tolist(), claims, strict=True):
        found = oracle.first_hit(data, ray)
        s, shape = (np.inf, -1) if found is None else (float(found), 0)
        claim[:] = 2, shape, np.nextafter(s, -np.inf), np.nextafter(s, np.inf), 0
    claims[:, 2:4] = np.maximum(claims[:, 2:4], 0)
    counts, faults = enclosures.judge(data, rays, claims)
    assert not faults and counts["hit"] > 20 and counts["miss"] > 2
    hit = claims[:, 1] >= 0
    early, late, void, turned, whose = (claims.copy() for _ in range(5))
    early[hit, 3] = claims[hit, 2] * (1 - 1e-13) - 1e-300
    early[hit, 2] = 0
    late[hit, 2] = claims[hit, 3] + 1e-13 * (1 + claims[hit, 3])
    late[hit, 3] = late[hit, 2] + 1
    void[hit, 2:4] = np.nan
    turned[hit, 1], turned[~hit, 1] = -1, 0
    whose[hit, 1] = 1
    for wrong in (early, late, void, whose):
        assert len(enclosures.judge(data, rays, wrong)[1]) == hit.sum()
    assert len(enclosures.judge(data, rays, turned)[1]) == len(rays)
    silent = claims.copy()
    silent[:, 0] = 0
    assert enclosures.judge(data, rays, silent)[0] == {"undecided": len(rays)}
