"""What ends a test early: a scene that the phase properly refuses (passed, and listed at the end), and a CPU
that lacks the phase's instruction set (skipped, with its name)."""

from __future__ import annotations

import re
import zlib
from collections.abc import Generator
from pathlib import Path

import pytest

from conformance.harness import REDUCED, REFERENCE, Unsupported
from study.core import registry

# What an approximate phase (phase.json) is asked: its form. Its pictures have tests of their own.
FORM = (
    "test_same_call_same_bits",
    "test_threads",
    "test_threads_of_many_tiles",
    "test_record",
    "test_missing_instruction_set",
    "test_bad_scene",
    "test_random_scenes",
    "test_shape",
)
# Asked of the reference alone: whether its pictures are what the words say, and show each feature. The others
# are held against its pictures.
OF_THE_REFERENCE = ("test_features_show", "test_picture_is_what_the_words_say", "test_slope", "test_bounds")
OF_THE_REFERENCE += ("test_slope_reaches_one",)
# The quick half: of these, each phase takes another one in so many; the rest is slow.
SHARES = {
    "test_feature": 8,
    "test_group": 4,
    "test_group_scene": 3,
    "test_shape": 3,
    "test_special_points": 3,
    "test_placed": 3,
    "test_many_shapes": 3,
}
SHARES |= {"test_mandelbulb": 3, "test_mandelbox": 3, "test_mandelbulb_at_its_poles": 3}
SHARES |= {"test_random_scenes": 2, "test_hits_are_where_geometry_says": 6}
# Tests of truth, whose pixels take milliseconds, and in NumPy.
SLOW = re.compile(
    r"test_(hits_are_where_geometry_says|what_is_displayed_is_the_picture|same_call_same_bits)\[truth\]|"
    r"test_feature\[everything-truth\]|"
    r"test_picture_is_what_the_words_say\[(everything|mirrors_3|mirrors_fog_sky)-|"
    r"test_mandelbulb\[7-256-|test_mandelbox\[shrinking-"
)
# What a sanitized build is asked: each feature that has code of its own once, cut tiles, threads, any scene.
SANITIZED = ("test_feature", "test_sizes", "test_threads", "test_threads_of_many_tiles", "test_random_scenes")
SANITIZED += ("test_many_shapes", "test_group", "test_field")
SANITIZED_FEATURES = re.compile(
    r"everything|shapes_64$|shadows_(hard|ideal)|mirrors_facing_2|mandelbox_(plane|bulb)|rounded_soft|camera_within|"
    r"nothing_to_see|crowd|hits_in_one_column|bounds_radius_large|repeated_all|max_steps_1$|bulb_within"
)


def asked(item: pytest.Item) -> bool:
    """Whether the test is of use for its phase and this build."""
    phase, name = item.callspec.params["phase"], item.originalname
    if REDUCED and name not in SANITIZED:
        return False
    if REDUCED and name == "test_feature" and not SANITIZED_FEATURES.search(item.callspec.params["name"]):
        return False
    if name in OF_THE_REFERENCE:
        return phase == REFERENCE
    return name in FORM or not registry.phases()[phase].approximate


def in_its_share(item: pytest.Item) -> bool:
    """Whether the quick half has it: all of them if a phase alone is asked."""
    share = SHARES.get(item.originalname, 1)
    return zlib.crc32(item.name.encode()) % share == 0


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    mine = [item for item in items if item.path.parent == Path(__file__).parent]
    left = [item for item in mine if not asked(item)]
    for item in mine:
        if not config.getoption("phase") and (not in_its_share(item) or SLOW.match(item.name)):
            item.add_marker(pytest.mark.slow)
    if left:
        dropped = set(left)
        items[:] = [item for item in items if item not in dropped]
        config.hook.pytest_deselected(items=left)


@pytest.fixture(autouse=True)
def cpu_for_phase(request: pytest.FixtureRequest) -> None:
    phase = request.node.callspec.params["phase"]
    if lacking := registry.missing_isa(registry.phases()[phase]):
        pytest.skip(f"this CPU lacks {', '.join(lacking)}, which {phase} needs")


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    try:
        return (yield)
    except Unsupported as refusal:
        pyfuncitem.user_properties.append(("unsupported", f"{pyfuncitem.name}: {refusal}"))
        return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    refusals = [
        text
        for report in terminalreporter.getreports("passed")
        for key, text in report.user_properties
        if key == "unsupported" and report.when == "call"
    ]
    if refusals:
        terminalreporter.section(f"{len(refusals)} scenes refused as unsupported (status 4)")
        terminalreporter.write_line("\n".join(refusals))
