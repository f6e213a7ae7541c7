# The first of these that is there, is new enough and can make a virtual environment. CI tests with 3.11.
PYTHON ?= $(shell for python in python3.11 python3.12 python3.13 python3.14 python3; do \
	$$python -c "import sys, ensurepip; sys.exit(sys.version_info < (3, 11))" 2>/dev/null && echo $$python && break; done)
BIN := .venv/bin
INSTALL := $(BIN)/uv pip install --quiet --python $(BIN)/python
ITSELF := $(INSTALL) --no-deps --no-build-isolation --editable .
COMPILE := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes pyproject.toml

# Some images set it: every process that starts, and tests start hundreds, would compile all its libraries anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup demo test lint lint-pages docs gallery lock lowest release

demo: .venv/base
	$(BIN)/nathlon demo

setup: .venv/all

# What a selection and the environments need.
.venv/base: requirements-base.lock pyproject.toml
	$(if $(PYTHON),,$(error no Python of 3.11 or newer that can make a virtual environment: install python3.11-venv, or name one with PYTHON=))
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet uv==0.13.9
	$(INSTALL) --require-hashes --requirements requirements-base.lock
	$(ITSELF)
	touch $@

# The rest: training, other people's checkpoints, tests.
.venv/all: .venv/base requirements.lock
	$(BIN)/uv pip sync --quiet --python $(BIN)/python --require-hashes requirements.lock
	$(ITSELF)
	touch $@

test: setup
	$(BIN)/pytest

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	@$(MAKE) --no-print-directory lint-pages

# The scripts of pages. Biome and TypeScript run on the Node that pip has installed.
NODE := PATH="$(CURDIR)/$(BIN):$$PATH"
TYPES := build/types/page.d.ts build/types/summary.d.ts

lint-pages: .venv/all node_modules/.made $(TYPES)
	$(NODE) node_modules/.bin/biome lint --error-on-warnings
	$(NODE) node_modules/.bin/tsc

node_modules/.made: package.json package-lock.json .venv/all
	@$(NODE) npm ci --silent || { echo "npm could not install what checks the scripts of pages: it needs a registry the first time."; exit 1; }
	touch $@

build/types/page.d.ts: tests/support/page_types.py arena/results.py reports/payload.py
	mkdir -p $(@D)
	$(BIN)/python -m tests.support.page_types > $@

build/types/summary.d.ts: docs/schema/summary.json node_modules/.made
	mkdir -p $(@D)
	$(NODE) node_modules/.bin/json2ts --unknownAny=false --additionalProperties=false $< $@

docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

gallery: setup
	$(BIN)/python -m benchmarks.gallery runs/demo

# The second has the same versions as the first.
lock:
	$(COMPILE) --extra all --extra dev --output-file requirements.lock
	$(COMPILE) --extra build --constraint requirements.lock --output-file requirements-base.lock

# The core at the lower bounds of pyproject.toml, in an environment of its own.
CORE := $(addprefix tests/, sim/test_physics.py sim/test_rules.py policies/test_checkpoint.py \
	policies/test_onnx.py sim/test_parallel_env.py nathlon/test_pareto.py nathlon/test_battery.py \
	tournament/test_points.py tournament/test_ratings.py arena/test_store.py arena/test_recording.py \
	reports/test_replay_picture.py reports/test_spreadsheet.py nathlon/test_track_cli.py reports/test_video.py)

lowest: .venv/base
	$(PYTHON) -m venv --clear build/lowest
	$(BIN)/uv pip install --quiet --python build/lowest/bin/python --resolution lowest-direct \
		--editable ".[postgres,video]" "hypothesis>=6.120" "openpyxl>=3.1" "pytest>=8.3"
	build/lowest/bin/python -m pytest --noconftest --override-ini addopts=-q $(CORE)

# What is to be published: built and checked, but neither tagged nor sent anywhere.
VERSION := $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)

release: setup
	@git diff --quiet HEAD || { echo "there are changes that are not committed"; exit 1; }
	@grep -qE '^## \[$(VERSION)\] - [0-9-]+$$' CHANGELOG.md || { echo "CHANGELOG.md: expected $(VERSION) with its date"; exit 1; }
	@! git rev-parse --quiet --verify "refs/tags/v$(VERSION)" || { echo "v$(VERSION) is tagged already"; exit 1; }
	rm -rf dist
	$(BIN)/python -m hatchling build --directory dist
	$(BIN)/uvx twine==7.0.0 check --strict dist/*
