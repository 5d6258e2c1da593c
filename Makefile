# `make demo` and `make test` work from a fresh clone: they make .venv, install into it once, and run. See `make help`.

# The first interpreter that is recent enough and can make virtual environments; or `make PYTHON=/path/to/python3.11 ...`.
PYTHON ?= $(shell for python in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	if $$python -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	then echo $$python; break; fi; done)

BIN := .venv/bin
# The compiled equations and BLAS are fastest on one thread each, and runs replay to the bit.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# Kept bytecode: without it every worker, and every command under test, compiles all sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help docs docs-version pictures workbench-picture commands demo blind test test-python test-slow fuzz lint format clean

help:
	@echo "make demo       gather, adapt, drift, diagnose: one page, runs/demo-.../index.html"
	@echo "make blind      the diagnosis's blind check on a few new cases (BLIND_CASES=200 for the full one)"
	@echo "make test       linters, type checker and tests"
	@echo "make test-python PYTHON=python3.13  the tests under another Python (3.11 to 3.13)"
	@echo "make test-slow  the long checks too"
	@echo "make commands   each command that a page names, in a clean clone: which ones fail (nightly; COMMAND_SECONDS=3600)"
	@echo "make fuzz       malformed inputs of every kind (FUZZ_CASES=10000)"
	@echo "make docs       the documentation, into build/site"
	@echo "make docs-version  the documentation of the newest tag's version, next to those before, onto the branch gh-pages"
	@echo "make pictures   the documentation's drawings, its animation of a diagnosis, its pages as a phone shows them (Chromium)"
	@echo "make workbench-picture  the workbench's page in the documentation, by the test of the whole way (minutes)"
	@echo "make lint       linters of code, spelling and prose, and the type checker, alone"
	@echo "make format     rewrite the sources in the house's format"
	@echo "make clean      remove the virtual environment and all caches"

demo: .venv/installed
	$(BIN)/python -m experiments.demo

BLIND_CASES ?= 12
BLIND_OUT ?= runs/gap_blind-$(shell date +%Y%m%d-%H%M%S)

blind: .venv/installed
	out=$(BLIND_OUT); \
	$(BIN)/python -m experiments.gap.blind make --out $$out --count $(BLIND_CASES) && \
	$(BIN)/python -m experiments.gap.blind answer --out $$out && \
	$(BIN)/python -m experiments.gap.blind score --out $$out

test: lint
	$(BIN)/python -m pytest -n 2 --dist loadgroup --no-loadscope-reorder -m "not slow"

test-slow: lint
	$(BIN)/python -m pytest -n 2 --dist loadgroup --no-loadscope-reorder

# Another Python than .venv's, in an environment of its own: make test-python PYTHON=python3.13
test-python:
	env=.venv-$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])') && \
	{ test -x $$env/bin/python || $(PYTHON) -m venv $$env; } && \
	$$env/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[train,test]" && \
	$$env/bin/python -m pytest -n 2 --dist loadgroup --no-loadscope-reorder -m "not slow"

COMMAND_SECONDS ?= 120
COMMANDS_OUT ?= runs/page_commands-$(shell date +%Y%m%d-%H%M%S)

# Pages whose commands are `drift-drake`'s first, then what `python -m` runs; both go on where the other fails.
commands: .venv/installed-all
	$(BIN)/python -m pytest tests/docs; tested=$$?; \
	$(BIN)/python -m experiments.page_commands --seconds $(COMMAND_SECONDS) --out $(COMMANDS_OUT) && exit $$tested

FUZZ_CASES ?= 10000

fuzz: .venv/installed-all
	FUZZ_CASES=$(FUZZ_CASES) $(BIN)/python -m pytest tests/fuzz

docs: .venv/installed-all
	$(BIN)/mkdocs build --strict

VERSION ?= $(patsubst v%,%,$(shell git describe --tags --abbrev=0 2>/dev/null))

# Commits to the local branch gh-pages; nothing is pushed. `mike serve` shows it.
docs-version: .venv/installed-all
	@test -n "$(VERSION)" || { echo "no tag names a version: make one (git tag v0.1.0), or give make docs-version VERSION=0.1.0"; exit 1; }
	PATH="$(abspath $(BIN)):$$PATH" mike deploy --update-aliases $(VERSION) latest  # which calls mkdocs by its name
	PATH="$(abspath $(BIN)):$$PATH" mike set-default latest

# Without figure_8, whose drives take half an hour of CPU.
PICTURES := car_frames demo diagnosis drive_time_series effects_map framework gap layers loop predictions reliability replay report safe_stop still two_criteria

pictures: .venv/installed-all
	$(BIN)/python -m diagrams.docs_picture
	$(BIN)/python -m experiments.structure --out docs/structure.png
	for name in $(PICTURES); do $(BIN)/python -m experiments.pictures $$name || exit 1; done

# Pages that are written for readers; the results by date stay as they were written.
PROSE := README.md CONTRIBUTING.md CHANGELOG.md docs/*.md docs/how_to/*.md

lint: .venv/installed-all
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell drift_drake tests experiments examples diagrams docs $(PROSE)
	$(BIN)/proselint --config .proselintrc.json check $(PROSE)
	$(BIN)/mypy

workbench-picture: .venv/installed-all
	PICTURE=docs/how_to/workbench.png $(BIN)/python -m pytest tests/app/test_whole_way.py

format: .venv/installed-all
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf .venv .venv-* .mypy_cache .pytest_cache .ruff_cache build *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps let the second run do without pip, and so without the network.
.venv/bin/python:
	@test -n "$(PYTHON)" || { \
		echo "drift_drake needs Python 3.11 or newer with its venv module: install it (Debian, Ubuntu: apt install python3.11-venv), or name it with make PYTHON=/path/to/python3.11"; \
		exit 1; }
	$(PYTHON) -m venv .venv

.venv/installed: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

.venv/installed-all: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[train,parquet,test,fuzz,docs,dev]"
	@touch $@
