"""Commands for who takes or gives a course (docs/labs)."""
