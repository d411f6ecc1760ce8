"""Commands of scripts/stepwise that are no experiments: what makes pages, tables and phases."""
