#!/usr/bin/env python3
"""The same as `scripts/stepwise plots`."""

import sys

from study.core import cli, commands

if __name__ == "__main__":
    sys.argv.insert(1, "plots")
    cli.main(commands.main)
