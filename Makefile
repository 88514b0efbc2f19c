# Everything is installed into .venv from pyproject.toml, at the versions in constraints.txt.
# Stamp files remember what .venv holds, so that a second call installs nothing.

# The first candidate that really runs and can make a virtual environment: a version manager may leave
# a python3.13 in the PATH that only prints an error. Override with: make PYTHON=/path/to/python
CHECK := import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3; do \
	$$p -c '$(CHECK)' >/dev/null 2>&1 && { command -v $$p; break; }; done)

BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet -c constraints.txt
DEMO_OUT := out/demo

.PHONY: setup demo test validate validate-crash bench bench-full lint clean

setup: .venv/.installed

demo: .venv/.installed
	$(BIN)/lsm compare-shapes --preset demo --out $(DEMO_OUT) --overwrite

test: .venv/.installed-dev
	$(BIN)/python -m pytest

validate: .venv/.installed-dev
	TI_ADVANCED_OPTIMIZATION=1 $(BIN)/python -m pytest -m validate

validate-crash: .venv/.installed-dev
	$(BIN)/python -m tests.crash.random_kills

bench: .venv/.installed
	$(BIN)/python -m benchmarks.all --install-lammps

bench-full: .venv/.installed
	$(BIN)/python -m benchmarks.all --full --install-lammps

lint: .venv/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/basedpyright --level error
	$(BIN)/typos

clean:
	rm -rf .venv

.venv/pyvenv.cfg:
	@test -n '$(PYTHON)' || { \
		echo 'No usable Python found: install Python 3.11, 3.12 or 3.13 with its venv module'; \
		echo '(Debian, Ubuntu: apt install python3 python3-venv), or name one: make PYTHON=/path/to/python'; \
		exit 1; }
	$(PYTHON) -m venv .venv

.venv/.installed: pyproject.toml constraints.txt | .venv/pyvenv.cfg
	$(PIP) -e .
	@touch $@

.venv/.installed-dev: pyproject.toml constraints.txt | .venv/pyvenv.cfg
	$(PIP) -e '.[dev]'
	@touch $@ .venv/.installed
