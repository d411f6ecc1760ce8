"""The papers' statements, held against a run."""
