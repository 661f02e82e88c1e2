# Everything runs in .venv, installed with the pinned versions of constraints.txt.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Python compiles what is imported, and pip all that there is: half of its time.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt

# An editable install links the modules that exist: a new one, or new metadata, calls for another.
MODULES := $(shell find kinarm policies evaluation data -name __pycache__ -prune -o -type f -print | sort | cksum | cut -d' ' -f1)
INSTALLED = $(VENV)/.installed-$(1)-$(MODULES)

.PHONY: eval test test-slow test-rare coverage campaign mutants lint docs package aarch64 clean

eval: $(call INSTALLED,core) ## evaluate what ships for the three tasks on 200 trials each
	$(BIN)/kinarm-eval --trials 200

PYTEST := $(BIN)/python -m pytest --dist loadfile --no-loadscope-reorder --durations=25

WORKERS ?= auto
QUICK := "not slow and not rare"

test: $(call INSTALLED,test) ## run the tests, but for the slow ones
	$(PYTEST) -n $(WORKERS) -m $(QUICK)

test-slow: $(call INSTALLED,all) ## run the slow tests, and what make test skipped for want of a library
	$(PYTEST) -n $(WORKERS) -m "not rare" --rest

test-rare: $(call INSTALLED,all) ## run the tests that CI leaves out
	$(PYTEST) -n $(WORKERS) -m rare

coverage: $(call INSTALLED,all) ## see which lines make test runs with all extras: half as long again
	$(PYTEST) -n $(WORKERS) -m $(QUICK) --cov --cov-report=term --cov-fail-under=90

CAMPAIGN := loaders disturbances

campaign: $(call INSTALLED,all) ## damaged files, kills, signals, failing writes: hours
	set -e; for module in $(CAMPAIGN); do \
		$(BIN)/python -m tests.campaign.$$module --out data/results/campaign/$$module.json; done

mutants: $(call INSTALLED,all) ## change the code in a copy, and see whether the tests notice: hours
	$(BIN)/python tests/mutants.py --out mutants.json

lint: $(call INSTALLED,dev) ## check style, format and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Most of the time goes into what a few pages run: four at a time, they share two cores evenly.
docs: $(call INSTALLED,docs) ## build the site into docs/_build/html
	$(BIN)/sphinx-build -n -W --keep-going --jobs 4 -b html docs docs/_build/html

PYTHONS ?= python3.11 python3.12 python3.13 python3.14

package: $(call INSTALLED,package) ## build, check and install what is published, with all PYTHONS
	$(BIN)/python tests/packaging/everywhere.py $(PYTHONS)

aarch64: $(call INSTALLED,dev) ## compute the same on an emulated AArch64, and see what macOS lacks
	$(BIN)/mypy --platform darwin
	$(BIN)/python tests/packaging/aarch64.py

clean: ## remove what the other targets made
	rm -rf $(VENV) build dist *.egg-info .coverage .mypy_cache .pytest_cache .ruff_cache .hypothesis
	rm -rf docs/_build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed-core-%: pyproject.toml setup.cfg constraints.txt | $(BIN)/python
	$(PIP_INSTALL) -e .
	touch $@

# $* is the extra and the checksum of the module list.
$(VENV)/.installed-%: pyproject.toml setup.cfg constraints.txt | $(BIN)/python
	$(PIP_INSTALL) -e '.[$(firstword $(subst -, ,$*))]'
	touch $@
