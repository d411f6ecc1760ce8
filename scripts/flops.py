#!/usr/bin/env python3
"""The same as `scripts/stepwise flops`."""

import sys

from study.core import cli, commands

if __name__ == "__main__":
    sys.argv.insert(1, "flops")
    cli.main(commands.main)
