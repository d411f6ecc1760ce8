"""Each idea taken out of its phase: gain, change of the picture, lines."""

from __future__ import annotations

import sys

from study.experiments.ablations import command


def main() -> int:
    sys.argv.insert(1, "--ideas")
    return command.main()
