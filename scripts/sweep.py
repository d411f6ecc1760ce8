#!/usr/bin/env python3
"""The same as `scripts/stepwise sweep`."""

import sys

from study.core import cli, commands

if __name__ == "__main__":
    sys.argv.insert(1, "sweep")
    cli.main(commands.main)
