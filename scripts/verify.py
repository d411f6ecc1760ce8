#!/usr/bin/env python3
"""The same as `scripts/stepwise verify`."""

import sys

from study.core import cli, commands

if __name__ == "__main__":
    sys.argv.insert(1, "verify")
    cli.main(commands.main)
