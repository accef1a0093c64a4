# Two commands for a fresh machine: `make demo` and `make test`. Each does all of its own set-up.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
PYTHON ?= python3
BIN := .venv/bin
# As many processes as there are cores, for the tests.
JOBS ?= $(shell nproc 2>/dev/null || echo 2)

.PHONY: demo test lint format types check wheel benchmark clean help

help:
	@echo "make demo       install into .venv and run the demonstration"
	@echo "make test       install into .venv, check style and types, and pass the tests"
	@echo "make benchmark  measure speed against pytest, in the same run"
	@echo "make wheel      build the wheel into dist/"

demo: .venv/installed
	$(BIN)/rtf demo

test: .venv/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal
	@echo "TESTS PASSED  style, types and tests are in order"

benchmark: .venv/installed
	$(BIN)/python tests/benchmarks/run_benchmarks.py

wheel: .venv/installed
	$(BIN)/python -m build --wheel --outdir dist

format: .venv/installed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The stamp is older than what decides the installation exactly when something must be installed again.
.venv/installed: pyproject.toml packages.apt
	@bash tools/system-packages packages.apt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch .venv/installed

clean:
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache
