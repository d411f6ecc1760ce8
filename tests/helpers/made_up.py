"""Results of the systems as a published run has them, for tests of tables, figures and pages."""

from __future__ import annotations

from typing import Any

from study.core import store
from study.core.registry import ROOT

RUN = ROOT / "results" / "reference" / "zen5-2026-11-25"


def published(name: str) -> dict[str, Any]:
    """The content of its file, without where it was made."""
    return {key: value for key, value in store.read_json(RUN / name).items() if key != "context"}
