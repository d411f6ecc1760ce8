#!/usr/bin/env python3
"""The same as `scripts/stepwise tables`."""

import sys

from study.core import cli, commands

if __name__ == "__main__":
    sys.argv.insert(1, "tables")
    cli.main(commands.main)
