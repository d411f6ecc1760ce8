# What `make test` and `make test-all` do once everything is installed. All of them end with the line 'N passed,
# N failed, N skipped' and fail if anything did. One part alone: make check PART=builds (tests/run.py names them).
include tests/c/tests.mk tests/fuzz/fuzz.mk

TEST_PYTHON ?= .venv/bin/python
PART ?=

.PHONY: check check-rest check-all
check: HALF := quick
check-rest: HALF := rest
check-all: HALF := all
check check-rest check-all:
	@$(TEST_PYTHON) tests/run.py $(HALF) $(PART:%=--part %) $(PHASE:%=--phase %)
