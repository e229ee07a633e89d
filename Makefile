# Every target sets the workspace up first, from nothing if need be; `make help` lists them.

VENV := $(CURDIR)/.venv
VENV_PYTHON := $(VENV)/bin/python
LOWEST := $(CURDIR)/.venv-lowest
# The Python to make .venv with. Once it is there it stays with its Python, unless PYTHON names another.
PYTHON ?= $(or $(wildcard $(VENV_PYTHON)),python3)

# Nodes talk on this machine only, and no ROS that the shell has sourced shows through.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export AMENT_PREFIX_PATH := $(VENV)
unexport PYTHONPATH LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE PYTHONDONTWRITEBYTECODE

# What `make run` starts and `make view` shows.
ROBOT ?= hexapod
TERRAIN ?= level

.DEFAULT_GOAL := help
.PHONY: help setup demo run view test test-lowest lint typecheck soak stances contacts robots bench bench-compare physics papers docs clean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: setup  ## Show what the suite answers, on the example robots
	$(VENV_PYTHON) tools/demo.py

run: setup  ## Start the nodes of a robot: [ROBOT=hexapod] [NAMESPACE=] [GAIT=yes] [PARAMETERS="name:=value ..."]
	$(VENV_PYTHON) tools/run_robot.py --robot "$(ROBOT)" --namespace "$(NAMESPACE)" \
		$(if $(GAIT),--gait) $(PARAMETERS)

view: setup  ## Show a robot in the browser: [ROBOT=hexapod] [TERRAIN=level]
	$(VENV)/lib/leg_statics/viewer --robot "$(ROBOT)" --terrain "$(TERRAIN)"

test: lint typecheck  ## Check style and types, then run every test, two at a time
	$(VENV_PYTHON) -m pytest -n 2 --dist loadfile

lint: setup  ## Check style and format
	$(VENV_PYTHON) -m ruff check
	$(VENV_PYTHON) -m ruff format --check

typecheck: setup  ## Check types
	$(VENV_PYTHON) -m mypy

test-lowest: $(LOWEST)/COLCON_IGNORE  ## Run the libraries' tests with the oldest supported versions
	PYTHONPATH=leg_kinematics:leg_statics:leg_msgs_py $(LOWEST)/bin/python -m pytest \
		--ignore leg_statics/test/test_judge_findings.py leg_kinematics/test leg_statics/test

# It needs no ROS, and judges no recordings, but a Python that matplotlib of Ubuntu 24.04 has wheels for: 3.10 or 3.11.
$(LOWEST)/COLCON_IGNORE: requirements-lowest.txt
	$(PYTHON) -m venv --clear $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
		--require-hashes --requirement $<
	touch $@

soak: setup  ## Record a minute at 1 kHz for six legs and count what is lost
	$(VENV_PYTHON) -m pytest -s tests/soak_recorder.py

stances: setup  ## Compare the load factors of 10,000 random stances with a conic solver
	$(VENV_PYTHON) leg_statics/test/stance_oracle.py 10000

contacts: setup  ## Compare what 10,000 contacts of their own carry with a conic solver
	cd leg_statics/test && $(VENV_PYTHON) test_mixed_contacts.py 10000

robots: setup  ## Compare legs of public robots with Pinocchio; installs 200 MB
	@$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile --no-deps \
		--require-hashes --requirement tests/robots/requirements.txt
	$(VENV_PYTHON) -m pytest tests/robots/pinocchio_robots.py

bench: setup  ## Measure speed through the public interfaces, and that of other software
	@echo "Installing what to compare with, unless it is there ..."
	@$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile --no-deps \
		--require-hashes --requirement benchmarks/requirements.txt
	$(VENV_PYTHON) benchmarks/run.py $(BENCH)

bench-compare: setup  ## Show what changed since the saved baseline
	$(VENV_PYTHON) benchmarks/compare.py

physics: setup  ## Press legs in MuJoCo until they give way, beside what is predicted
	$(VENV_PYTHON) tools/physics.py

papers: setup  ## Recompute the published tables and show them side by side
	$(VENV_PYTHON) tools/papers.py

docs: setup  ## Build the docs site into build/site
	@echo "Installing what builds it, unless it is there ..."
	@$(VENV_PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile --no-deps \
		--require-hashes --requirement docs/requirements.txt
	$(VENV_PYTHON) tools/make_docs.py

clean:  ## Remove the environment and all caches
	rm -rf .venv .venv-lowest .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

setup:  ## Build the environment .venv, or bring it up to date; then ./leg runs commands in it
	@$(PYTHON) tools/setup_workspace.py
