"""One folder per experiment: what it measures, its tables, its figures."""
