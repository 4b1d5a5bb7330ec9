# The only list of commands: CI, pre-commit and people call the same targets.
# Everything is installed into .venv of this checkout.

PYTHON ?= python3
BIN := .venv/bin
export PYTHONDONTWRITEBYTECODE ?= 1

.DEFAULT_GOAL := check
.PHONY: help check install demo test unit property e2e doctests lint format bench docs lock clean

## help: what can be made
help:
	@sed -n 's/^## //p' Makefile

## check: format, lint, types, imports and the fast tests (under a minute)
check: format lint unit

## install: everything, pinned, into .venv (system libraries included)
install: .venv/installed

.venv/installed: requirements.lock pyproject.toml docker/system-packages.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "fluentboard needs Python 3.11 or newer; call: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@sh docker/install-system-packages.sh $(BIN)/python
	@touch $@

## demo: the main job, from an empty board to a picture of what was found
demo: .venv/installed
	$(BIN)/fluentboard demo

## test: all tests
test: .venv/installed
	$(BIN)/pytest -n 2

## unit: fast tests, without a network
unit: .venv/installed
	$(BIN)/pytest tests/unit tests/golden

## property: laws that must hold for whatever Hypothesis thinks of
property: .venv/installed
	$(BIN)/pytest tests/property

## e2e: tests with real services, workers and clients
e2e: .venv/installed
	$(BIN)/pytest tests/e2e

## doctests: the documentation against the code
doctests: .venv/installed
	$(BIN)/pytest tests/docs

## lint: style, types and who imports whom
lint: .venv/installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

## format: lays out the code, and mends what can be mended without thinking
format: .venv/installed
	$(BIN)/ruff format --quiet .
	$(BIN)/ruff check --quiet --fix-only .

## bench: the measurements of docs/benchmarks.md
bench: .venv/installed
	$(BIN)/python -m bench --write

## docs: the documentation as a site in site/
docs: .venv/installed
	$(BIN)/mkdocs build --strict

## lock: resolve requirements.lock anew from the ranges of pyproject.toml
lock:
	$(PYTHON) -m venv .venv && $(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
		--no-annotate --no-header --no-emit-index-url --all-extras \
		--group test --group lint --group bench --group docs \
		--no-emit-package fluentboard pyproject.toml --output-file requirements.lock

## clean: removes .venv and all that was made
clean:
	rm -rf .venv build dist site demo-out
