# Commands for developers. `make train` and `make test` work on a machine with Python 3.11 alone.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV   := .venv
BIN    := $(VENV)/bin
ARGS   ?=
CORES  ?= 2
MINUTES ?= 60
# moves every seed of `make test-all`, another one each day; the tests print it
SEED_OFFSET ?= $(shell date +%y%j)

.PHONY: help train test test-all checks lint types kernels format bench fidelity performance soak docs pages wheel clean

help:
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

$(VENV)/bin/python:
	scripts/make_venv.sh "$(PYTHON)" $(VENV)

$(VENV)/installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet --editable .
	@touch $@

$(VENV)/installed-test: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet --editable '.[test]'
	@touch $@ $(VENV)/installed

train: $(VENV)/installed ## train PPO on KickTheBall; more with ARGS="senses/audio=mono seed=1"
	$(BIN)/python -m veca_marl.train +task=KickTheBall $(ARGS)

lint: $(VENV)/installed-test ## style, formatting and the import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(VENV)/installed-test ## mypy --strict on the whole package
	$(BIN)/mypy

kernels: $(VENV)/installed-test ## compile the kernels of the simulator into the user's cache
	$(BIN)/python scripts/compile_kernels.py

checks: $(VENV)/installed-test
	$(MAKE) --jobs $(CORES) lint types kernels

# test processes share compiled modules, also where the environment forbids to write them
test test-all: export PYTHONDONTWRITEBYTECODE :=
# one test process per core: more threads would wait for each other
test test-all: export OMP_NUM_THREADS := 1

test: checks ## lint, types, import contracts and the quick tests
	$(BIN)/pytest -n $(CORES) -m "not slow" --durations=20 $(ARGS)

test-all: checks ## everything, the slow tests too, with the seeds of the day; then what is stored
	$(BIN)/pytest -n $(CORES) --durations=20 --seed-offset=$(SEED_OFFSET) $(ARGS)
	$(BIN)/pytest -n $(CORES) -m golden $(ARGS)

format: $(VENV)/installed-test ## format and fix with ruff
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(VENV)/installed ## agent steps per second, and the time of each part of a step
	$(BIN)/python -m veca_marl.bench +task=KickTheBall $(ARGS)

fidelity: $(VENV)/installed-test ## measure the laws of physics and senses; rewrite docs/reference/fidelity.md
	$(BIN)/python -m tools.fidelity to=docs/reference $(ARGS)

performance: $(VENV)/installed ## measure rates and the cost of training; rewrite docs/performance.md
	$(BIN)/python -m tools.performance to=docs/performance.md $(ARGS)

soak: $(VENV)/installed-test ## play for an hour and look whether anything grows: MINUTES=10; rewrite docs/reliability.md
	OMP_NUM_THREADS=1 $(BIN)/python -m tools.soak minutes=$(MINUTES) to=docs/reliability.md $(ARGS)

docs: $(VENV)/installed-test ## build the documentation site in docs/_build/html
	$(BIN)/python -m sphinx --fail-on-warning --keep-going -b html docs docs/_build/html $(ARGS)

pages: $(VENV)/installed-test ## rewrite the generated pages and pictures of docs/
	$(BIN)/python -m tools.make_docs

WHEEL_BYTES := 4000000
wheel: $(VENV)/installed-test ## build the wheel in dist/; refuse one of more than 4 MB
	rm -rf dist
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .
	@size=$$(stat --format %s dist/*.whl); echo "$$(ls dist) has $$size bytes"; test $$size -le $(WHEEL_BYTES)

clean: ## remove the virtual environment and all caches; runs stay
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache build dist *.egg-info
	find . -name __pycache__ -type d -exec rm -rf {} +
