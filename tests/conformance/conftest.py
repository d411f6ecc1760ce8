"""What ends a test early: a scene that the phase properly refuses (passed, and listed at the end), and a CPU
that lacks the phase's instruction set (skipped, with its name)."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest

from conformance.harness import REDUCED, Unsupported
from study.core import registry

# What an approximate phase (phase.json) is asked: its form. Its pictures have tests of their own.
FORM = (
    "test_same_call_same_bits",
    "test_threads",
    "test_record",
    "test_missing_instruction_set",
    "test_bad_scene",
    "test_random_scenes",
    "test_shape",
)
# Of the scenes and not of how a phase was compiled: asked of the default build alone. A sanitized one draws
# each of these scenes in test_feature, and larger pictures than these in test_threads.
ONCE = ("test_features_show",)


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out what holds a picture that is meant to be near against one that it is not meant to be, and
    what one build answers for all."""
    kept, left = [], []
    for item in items:
        mine = item.path.parent == Path(__file__).parent
        near = mine and registry.phases()[item.callspec.params["phase"]].approximate
        once = mine and REDUCED and item.originalname in ONCE
        (left if once or (near and item.originalname not in FORM) else kept).append(item)
    items[:] = kept
    if left:
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
