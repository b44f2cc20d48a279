# One command each; the environment is .venv and is made on first use.
# Needs Python 3.11 or newer, make, and a package index; no root, no compiler.

SHELL := /bin/bash
# processes start from byte code here as they do with users; a test machine may forbid to write it
unexport PYTHONDONTWRITEBYTECODE
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
UV_INSTALL := $(BIN)/uv pip install --quiet --python $(BIN)/python -c constraints.txt

# some targets at once, all to their ends, each target's output in one piece where this make can do that
AT_ONCE = $(MAKE) --no-print-directory --keep-going $(if $(filter output-sync,$(.FEATURES)),--output-sync=target)
SIDE_BY_SIDE = $(AT_ONCE) --jobs=2

# a found `python3.11` may be a version manager's empty shim, so each candidate is asked to run
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3 python; do \
	$$p -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo $$p; break; }; done)

.PHONY: help setup demo gallery serve test test-api test-library test-command test-services test-slow slow-services slow-library slow-timed test-extended faults faults-postgres faults-others faults-timed conformance bench check check-types check-rest openapi locked format clean

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

$(VENV)/.stamp-uv:
	@test -n "$(PYTHON)" || { echo "MorphID needs Python 3.11 or newer with the venv module; none was found."; \
		echo "Install it (Debian: apt install python3 python3-venv) or say where: make PYTHON=/path/to/python"; exit 1; }
	@echo "setup: making $(VENV) with $(PYTHON)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@test -x $(BIN)/uv || $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt uv
	@touch $@

# what the service needs: enough for `make demo` and `make serve`
$(VENV)/.stamp-server: $(VENV)/.stamp-uv pyproject.toml constraints.txt
	@test -e $(VENV)/.stamp-full || { echo "setup: installing the service"; $(UV_INSTALL) -e '.[server]'; }
	@touch $@

# and what its developers need
$(VENV)/.stamp-full: $(VENV)/.stamp-uv pyproject.toml constraints.txt
	@echo "setup: installing the service, the oracles and the development tools"
	@$(UV_INSTALL) -e '.[server,oracles,dev]'
	@touch $@ $(VENV)/.stamp-server

setup: $(VENV)/.stamp-full  ## make .venv with everything in it
	@:

demo: $(VENV)/.stamp-server  ## identify a model from the example flights through the running service
	@$(BIN)/python examples/demo.py

gallery: $(VENV)/.stamp-server  ## identify the aircraft of examples/aircraft, and print how well
	@$(BIN)/python examples/gallery.py

serve: $(VENV)/.stamp-server  ## API, worker and broker on this machine
	@exec $(BIN)/morphid serve

# all suites at once, on two cores too: tests of services wait for processes, sockets and limits of time while
# the library calculates, and no core is idle at the end
test: setup  ## the tests (a quarter of an hour on two cores)
	@$(call timed,$(AT_ONCE) --jobs=4 test-api test-library test-command test-services)

API_TESTS := tests/app tests/conformance
LIBRARY_TESTS := $(wildcard tests/test_*.py) $(addprefix tests/, aero benchmarks docs export geometry identify \
	models morphdata multibody optimise paper search simulate)
# the command, and whatever else uses the one live service of a test run
COMMAND_TESTS := tests/morphid tests/clients tests/browser/test_page.py tests/worker/spread/test_live.py

# runs a command and says afterwards how long it took
timed = began=$$SECONDS; $(1); ended=$$?; echo "$@: $$((SECONDS - began)) s"; exit $$ended

test-api: setup
	@$(call timed,$(BIN)/pytest -q $(API_TESTS))

test-library: setup
	@$(call timed,$(BIN)/pytest -q $(LIBRARY_TESTS))

test-command: setup
	@$(call timed,$(BIN)/pytest -q $(COMMAND_TESTS))

test-services: setup
	@$(call timed,$(BIN)/pytest -q $(addprefix --ignore=,$(API_TESTS) $(LIBRARY_TESTS) $(COMMAND_TESTS)))

SLOW_TESTS := $(BIN)/pytest -q --timeout 1800
IN_COMPANY := slow and not timed and not extended

test-slow: setup  ## the long proofs
	@$(call timed,$(SIDE_BY_SIDE) slow-services slow-library && $(MAKE) --no-print-directory slow-timed)

slow-services: setup
	@$(call timed,$(SLOW_TESTS) -m "$(IN_COMPANY)" $(addprefix --ignore=,$(LIBRARY_TESTS)))

slow-library: setup
	@$(call timed,$(SLOW_TESTS) -m "$(IN_COMPANY)" $(LIBRARY_TESTS))

# tests of response times and of speed run alone
slow-timed: setup
	@$(call timed,$(SLOW_TESTS) -m "slow and timed")

test-extended: setup  ## laws over hundreds of fits (hours)
	@$(BIN)/pytest -q -s --timeout 36000 -m extended

faults: setup  ## kill, stop, fill and mislead every process, on both pairs of database and broker
	@# both pairs run at the same time, because most of the time they wait; tests of response times run alone
	@$(call timed,$(SIDE_BY_SIDE) faults-postgres faults-others && $(MAKE) --no-print-directory faults-timed)

SPREAD_KILL := tests/worker/spread/test_spread_swarm.py::test_a_killed_process_costs_its_chunk
FAULT_TESTS := $(BIN)/pytest -q -s tests/faults $(SPREAD_KILL) --timeout 900

faults-postgres: setup
	@$(call timed,$(FAULT_TESTS) -m "not timed" -k postgres)

faults-others: setup
	@$(call timed,$(FAULT_TESTS) -m "not timed" -k "not postgres")

faults-timed: setup
	@$(call timed,$(FAULT_TESTS) -m timed)

conformance: setup  ## one behaviour on SQLite and Postgres, embedded broker and Redis URL (MORPHID_TEST_*_URL)
	@$(BIN)/pytest -q tests/conformance tests/app/jobs tests/app/test_database.py

bench: setup  ## the benchmark figures of this machine
	@$(BIN)/morphid bench

check: setup  ## formatting, lint, types, import contracts, OpenAPI document, migrations
	@$(SIDE_BY_SIDE) check-types check-rest

check-types: setup
	$(BIN)/mypy

check-rest: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/python .ci/gates.py

openapi: setup  ## write docs/openapi.json from the code
	@$(BIN)/python -m app.openapi

locked: setup  ## write requirements-server.txt: the service's packages of constraints.txt with their hashes
	@{ echo "# Every package of the service with its hashes, for \`pip install --require-hashes -r\`: what the image is made of."; \
		echo "# Made from pyproject.toml and constraints.txt by \`make locked\`."; \
		echo setuptools | $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra server \
			-c constraints.txt --generate-hashes --no-header --no-annotate --no-emit-index-url \
			--no-emit-find-links pyproject.toml -; } > requirements-server.txt.new
	@mv requirements-server.txt.new requirements-server.txt

format: setup  ## let ruff format and repair
	@$(BIN)/ruff check --fix-only -q . ; $(BIN)/ruff format .

clean:  ## forget caches and outputs (not .venv, not var/)
	@rm -rf build dist demo-output .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	@find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
