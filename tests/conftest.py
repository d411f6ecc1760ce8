"""For all tests: opt10_scene compiles nothing and no driver measures its clocks unless a test says so.

A kernel takes seconds to compile, and the suites have hundreds of scenes. They run its general kernels, which
are the same sources; phases/test_scene_kernel.py holds generated ones to these. Clocks are 25 ms of each of
the thousands of pictures; what the scripts time (study.core.run) has them all the same.

Hypothesis draws the same examples at every run: all of them (profile `whole`), or a fifth (`quick`), as
`make test` does.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

from drawn import WHOLE
from fixtures import blank, disc, miss, refused, write_exr  # noqa: F401  (fixtures of every suite)
from study.core import registry

os.environ.setdefault("STEPWISE_CC", "none")
os.environ.setdefault("STEPWISE_UNTIMED", "1")

settings.register_profile("whole", max_examples=WHOLE, derandomize=True, deadline=None)
settings.register_profile("quick", max_examples=WHOLE // 5, derandomize=True, deadline=None)
settings.load_profile("whole")
# It would draw numbers of the modules that are loaded, too, and which those are differs with the worker.
providers._get_local_constants = providers.Constants

# Folders whose tests share nothing. Elsewhere tests of a file share what the first of them made.
ALONE = {Path(__file__).parent / name for name in ("arm64", "c", "conformance", "hard")}
SHARING = "test_measuring.py"  # of arm64: seconds of an emulator's work for all of its tests


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--phase", help="of the tests of every phase, those of this one")


SLOW = re.compile(r"mark\.slow|hypothesis")
WHOLLY_SLOW = re.compile(r"^pytestmark = \[?pytest\.mark\.slow|^    pytest\.mark\.slow,$", re.MULTILINE)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Files without a test of the half that is asked for (run.py): importing them takes each worker seconds.
    The conformance suite marks its tests as they are collected."""
    marked = collection_path.suffix == ".py" and collection_path.parent.name != "conformance"
    text = collection_path.read_text(encoding="utf-8") if marked else "mark.slow"
    halves = {"not slow": WHOLLY_SLOW.search(text), "slow or hypothesis": not SLOW.search(text)}
    return bool(halves.get(config.option.markexpr)) or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first, then the single tests: no worker waits for the last of the others. Of one
    phase: its own of the tests ALONE, and elsewhere all but those that name others alone."""
    if phase := config.getoption("phase"):
        named = re.compile(rf"\b{re.escape(phase)}\b")
        others = re.compile(rf"\b({'|'.join(map(re.escape, registry.phases()))})\b")
        other = [
            item
            for item in items
            if not named.search(item.name) and (item.path.parent in ALONE or others.search(item.name))
        ]
        config.hook.pytest_deselected(items=other)
        items[:] = [item for item in items if item not in other]
    sizes = {path: path.stat().st_size for path in {item.path for item in items}}
    items.sort(key=lambda item: (item.path.parent in ALONE, -sizes[item.path], item.path))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """pytest-xdist's scheduler by files, but tests of the folders ALONE one by one."""
    from xdist.scheduler import LoadScopeScheduling

    root = config.rootpath

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            path = nodeid.partition("::")[0]
            return nodeid if (root / path).parent in ALONE and not path.endswith(SHARING) else path

    config.option.loadscopereorder = False
    return ByFile(config, log)


def pytest_runtest_setup() -> None:
    """A process keeps the scenes that its command was given as files; here many share a process."""
    registry._given.clear()
