# Two commands for a fresh machine: `make demo` and `make test`. Each does all of its own set-up.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
PYTHON ?= python3
BIN := .venv/bin
# Processes for the tests: more than there are cores, for many tests wait, for an end or for a limit to pass.
JOBS ?= $(shell echo $$(( $$(nproc 2>/dev/null || echo 2) * 3 )))

.PHONY: demo test test-long benchmark wheel format clean help

help:
	@echo "make demo       install into .venv and run the demonstration"
	@echo "make test       install into .venv, check style and types, and pass the tests"
	@echo "make test-long  the tests that make test leaves out, because they repeat others at length; at night"
	@echo "make benchmark  measure speed against pytest, in the same run"
	@echo "make wheel      build the wheel into dist/"

demo: .venv/installed
	$(BIN)/rtf demo

# A file goes to one process, for its tests share robots and programs; tests/conftest.py has the order. The tests start
# thousands of processes, and where modules may not be kept compiled, each would compile them anew. What the processes of
# pytest compile for themselves is compiled once before. Meanwhile, and beside the first tests, types are checked.
test: .venv/installed-for-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	export PYTHONDONTWRITEBYTECODE=; $(BIN)/mypy & types=$$!; \
	$(BIN)/python -m pytest --collect-only -q > /dev/null || true; \
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder; wait $$types
	@echo "TESTS PASSED  style, types and tests are in order"

test-long: .venv/installed-for-tests
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -m long -n $(JOBS) --dist loadfile --no-loadscope-reorder
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -m hypothesis --hypothesis-profile night -n $(JOBS)
	@echo "LONG TESTS PASSED"

benchmark: .venv/installed-for-tests
	$(BIN)/python tests/benchmarks/run_benchmarks.py
	$(BIN)/python tests/benchmarks/run_page_benchmarks.py
	$(BIN)/python tests/benchmarks/run_browser_benchmarks.py
	$(BIN)/python tests/benchmarks/run_codec_benchmarks.py
	$(BIN)/python tests/benchmarks/run_middleware_benchmarks.py
	$(BIN)/python tests/benchmarks/run_burst_benchmarks.py
	$(BIN)/python tests/benchmarks/run_hostile_benchmarks.py
	$(BIN)/python tests/benchmarks/run_applications_benchmarks.py
	$(BIN)/python tests/benchmarks/run_can_benchmarks.py
	$(BIN)/python tests/benchmarks/run_simulator_benchmarks.py
	$(BIN)/python tests/benchmarks/run_red_ball_benchmarks.py
	$(BIN)/python tests/benchmarks/run_robot_test_benchmarks.py

wheel: .venv/installed-for-tests
	$(BIN)/python -m build --wheel --outdir dist

format: .venv/installed-for-tests
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# A stamp is older than what decides the installation exactly when something must be installed again.
.venv/installed: pyproject.toml packages.apt
	@bash tools/system-packages packages.apt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[can,kinematics,lua,sim]'
	@touch .venv/installed

.venv/installed-for-tests: .venv/installed packages-test.apt tests/browser/package.json
	@bash tools/system-packages packages-test.apt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@mkdir -p .venv/npm
	@cp tests/browser/package.json .venv/npm/
	npm install --prefix .venv/npm --ignore-scripts --no-audit --no-fund --loglevel=error
	@touch .venv/installed-for-tests

clean:
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache
