# What `make test` does once everything is installed, and each part of it alone. All of them end with the line
# 'N passed, N failed, N skipped' and fail if anything did.
include tests/c/tests.mk

TEST_PYTHON ?= .venv/bin/python
TEST_STEPS := format c builds conformance conformance-asan hard py

.PHONY: check $(addprefix test-,$(TEST_STEPS))
check: ## all tests, without installing anything
	@$(TEST_PYTHON) tests/run.py
$(addprefix test-,$(TEST_STEPS)): test-%: ## one part of the tests
	@$(TEST_PYTHON) tests/run.py $*
