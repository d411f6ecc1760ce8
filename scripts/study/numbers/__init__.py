"""Statistics, verdicts, and what is read from a run or from the paper."""
