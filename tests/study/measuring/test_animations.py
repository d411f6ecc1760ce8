"""An animation's frames: where they run, how rows of them are compared."""

from __future__ import annotations

import pytest

from study.core import run
from study.measuring import animations
from study.measuring.schema import Animation, Article, Spread


@pytest.mark.parametrize("threads", [1, 2])
def test_frames_are_of_as_many_cpus_as_threads(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lines, seen = run._lines, []
    monkeypatch.setattr(run, "_lines", lambda a, cpus, *rest: seen.append(cpus) or lines(a, cpus, *rest))
    row = animations.animation("fixed", 3, 16, threads)
    assert seen == [run.cpu_set(run.FASTEST, threads)] and len(seen[0]) == min(threads, len(run.USABLE))
    assert len(row.all_ms) == 3 and row.ms.mean == pytest.approx(sum(row.all_ms) / 3)
    assert row.core_ns_per_pixel == pytest.approx(row.ms.mean * 1e6 * threads / (row.width * 16))


def row(**more) -> Animation:
    about = {"phase": "p", "threads": 2, "frames": 900, "width": 1920, "n": 1080, "ms": Spread(mean=95.0)}
    return Animation(**(about | {"core_ns_per_pixel": 190e6 / (1920 * 1080)} | more))


def test_rows_are_compared_by_the_frames_that_all_have() -> None:
    """Later frames are slower: over all of them 50 is no mean of the same thing as 1.5."""
    found = animations.with_common([row(all_ms=[1.0, 2.0]), row(all_ms=[3.0, 4.0, 50.0]), row()])
    assert [(one.common_frames, one.common_ms) for one in found] == [(2, 1.5), (2, 3.5), (None, None)]


def test_a_ratio_to_the_article_is_of_its_frames_and_size() -> None:
    """14.29 ms on 35 cores are 500.15 core·ms a frame; 95 on two are 190."""
    said = {"ms": 14.29, "cores": 35, "width": 1920, "height": 1080, "frames": 900, "spheres": 40, "bits": 20}
    article = Article(**said, cpu="")
    assert animations.per_article(row(), article) == pytest.approx(500.15 / 190)
    assert animations.per_article(row(frames=225), article) is None
    assert animations.per_article(row(n=540, width=960), article) is None
