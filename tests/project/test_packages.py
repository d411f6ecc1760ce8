"""requirements.in is the one declaration of packages: the scripts import no other than its run-time part."""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

import pytest

from helpers import imports
from study.core.registry import ROOT

SCRIPTS = ROOT / "scripts"
FILES = sorted(path for path in SCRIPTS.rglob("*.py") if "__pycache__" not in path.parts)
# Run by Pythons of their own, which have what they import.
OWN_PYTHON = ("farm/driver.py", "peers/workers/*.py")
ELSEWHERE = [path for path in FILES if any(path.match(one) for one in OWN_PYTHON)]


def declared(section: str) -> list[str]:
    """Distributions below the heading "# section" of requirements.in."""
    found, inside = [], False
    for line in (ROOT / "requirements.in").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            inside = line == f"# {section}"
        elif inside and (name := re.match(r"[\w.-]+", line)):
            found.append(name.group())
    return found


def normal(distribution: str) -> str:
    return re.sub(r"[-_.]+", "-", distribution).lower()


def module(path: Path) -> str:
    return ".".join(path.relative_to(SCRIPTS).with_suffix("").parts).removesuffix(".__init__")


@pytest.fixture(scope="module")
def run_time() -> set[str]:
    found = {normal(name) for name in declared("The study")}
    assert "numpy" in found and "pytest" not in found
    return found


def test_what_a_script_imports_is_declared_by_name(run_time: set[str]) -> None:
    """Not only as what another package happens to need."""
    own = {module(path).partition(".")[0] for path in FILES}
    owners = metadata.packages_distributions()
    wrong = []
    for path in FILES:
        for name in imports.named(path):
            top = name.partition(".")[0]
            if top in own or top in sys.stdlib_module_names or path in ELSEWHERE:
                continue
            if not run_time & {normal(one) for one in owners.get(top, [])}:
                wrong.append(f"{path.relative_to(ROOT)}: {top}")
    assert not wrong, wrong


def test_the_lock_has_what_is_declared() -> None:
    locked = re.findall(
        r"^([\w.-]+)==\S+ (?:.*\n)(?:    --hash.*\n)*    # via((?:.|\n    #)*)",
        (ROOT / "requirements.lock").read_text(),
        re.MULTILINE,
    )
    direct = {normal(name) for name, via in locked if "-r requirements.in" in via}
    sections = ("The study", "Tests and formatting")
    assert direct == {normal(name) for section in sections for name in declared(section)}


def test_what_has_no_wheel_for_arm64_is_asked_for_on_x86_alone() -> None:
    """In the lock as in what it is made from; the scripts run without (study/counting/test_other_machine)."""
    marked = [
        {normal(name) for name in re.findall(pattern, (ROOT / file).read_text(), re.MULTILINE)}
        for file, pattern in (
            ("requirements.in", r'^([\w.-]+); platform_machine == "x86_64"'),
            ("requirements.lock", r'^([\w.-]+)==\S+ ; platform_machine == "x86_64" \\$'),
        )
    ]
    assert marked == [{"flip-evaluator", "iced-x86"}] * 2
