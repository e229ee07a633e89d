# Every target sets the workspace up first, from nothing if need be; `make help` lists them.

VENV := $(CURDIR)/.venv
VENV_PYTHON := $(VENV)/bin/python
# The Python to make .venv with. Once it is there it stays with its Python, unless PYTHON names another.
PYTHON ?= $(or $(wildcard $(VENV_PYTHON)),python3)

# Nodes talk on this machine only, and no ROS that the shell has sourced shows through.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export AMENT_PREFIX_PATH := $(VENV)
unexport PYTHONPATH LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo run test lint typecheck soak bench bench-compare papers clean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: setup  ## Show what the suite answers, on the example robots
	$(VENV_PYTHON) tools/demo.py

run: setup  ## Start the nodes of one robot
	$(VENV_PYTHON) tools/run_robot.py

test: lint typecheck  ## Check style and types, then run every test, two at a time
	$(VENV_PYTHON) -m pytest -n 2 --dist loadfile

lint: setup  ## Check style and format
	$(VENV_PYTHON) -m ruff check
	$(VENV_PYTHON) -m ruff format --check

typecheck: setup  ## Check types
	$(VENV_PYTHON) -m mypy

soak: setup  ## Record a minute at 1 kHz for six legs and count what is lost
	$(VENV_PYTHON) -m pytest -s tests/soak_recorder.py

bench: setup  ## Measure speed through the public interfaces, and that of other software
	@echo "Installing what to compare with, unless it is there ..."
	@$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile --no-deps \
		--require-hashes --requirement benchmarks/requirements.txt
	$(VENV_PYTHON) benchmarks/run.py $(BENCH)

bench-compare: setup  ## Show what changed since the saved baseline
	$(VENV_PYTHON) benchmarks/compare.py

papers: setup  ## Recompute the published tables and show them side by side
	$(VENV_PYTHON) tools/papers.py

clean:  ## Remove the environment and all caches
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

setup:
	@$(PYTHON) tools/setup_workspace.py
