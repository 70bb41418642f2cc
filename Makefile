# Two commands do all the set-up: `make demo` goes from a measured table to a picture, `make test` passes the tests;
# `make quick` passes those that are fast.
# Both make a virtual environment in .venv and install what they need. Needed: Python ≥ 3.11 and make.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
TEST_STAMP := $(VENV)/.installed-dev
DOCS_STAMP := $(VENV)/.installed-docs
# one process a core: threads of NumPy's linear algebra beside them would wait for each other
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal

.PHONY: demo test quick lint docs benchmark fuzz clean

demo: $(STAMP)
	$(BIN)/pbrdf demo --output demo

test: lint
	$(PYTEST) $(PYTEST_ARGS)

quick: lint
	$(PYTEST) -m 'not slow' $(PYTEST_ARGS)

lint: $(TEST_STAMP)
	$(BIN)/ruff check src tests benchmarks scripts docs/examples docs/_ext docs/conf.py
	$(BIN)/ruff format --check src tests benchmarks scripts docs/examples docs/_ext docs/conf.py
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy

# the manual as a site: docs/_build/html/index.html; the tutorials run, warnings are errors, nothing is fetched but packages
docs: $(DOCS_STAMP)
	$(BIN)/python -m sphinx -E -W --keep-going --quiet -b html -d docs/_build/doctrees docs docs/_build/html
	@echo "Written: docs/_build/html/index.html"

benchmark: $(TEST_STAMP)
	$(BIN)/python benchmarks/evaluation.py
	$(BIN)/python benchmarks/fit.py
	$(BIN)/python benchmarks/maps.py
	$(BIN)/python benchmarks/dense_fit.py
	$(BIN)/python benchmarks/virtual_experiments.py
	$(BIN)/python benchmarks/coverage.py
	$(BIN)/python benchmarks/rendering.py
	$(BIN)/python benchmarks/memory.py
	$(BIN)/python benchmarks/domain.py
	$(BIN)/python benchmarks/domain.py --single
	$(BIN)/python benchmarks/read_csv.py
	$(BIN)/python benchmarks/map_store.py

# 20 000 damaged inputs of every kind: none may end in anything but data or a sentence (about a quarter of an hour)
fuzz: $(TEST_STAMP)
	$(BIN)/python tests/fuzz/fuzz_run.py --count 20000

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "pbrdf needs Python 3.11 or newer; name one with: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(STAMP): pyproject.toml src/pbrdf/version.py | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(TEST_STAMP): pyproject.toml src/pbrdf/version.py | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@ $(STAMP)

$(DOCS_STAMP): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@ $(STAMP)

clean:
	rm -rf $(VENV) demo build dist docs/_build docs/generated .pytest_cache .hypothesis .mypy_cache .ruff_cache
