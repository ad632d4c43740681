# Two commands set everything up on a fresh machine: `make race` and `make test`.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
TOOLS  := .venv-release
LOCK   := $(TOOLS)/bin/uv pip compile --quiet --universal --python-version 3.11 --constraint constraints.txt --generate-hashes --no-annotate --no-header

# The page that browsers show, and what it is made of.
PAGE   := race_server/live/gateway/page/index.html
WEB    := $(shell find web -type f -not -path 'web/node_modules/*' 2>/dev/null)
NODE_IS_THERE := node -e 'process.exit(+(parseInt(process.versions.node) < 20))' 2>/dev/null && command -v npm >/dev/null

# Tests start hundreds of programs: each would compile its modules again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: race page check-page test test-live test-slow test-space test-libraries check lint docs pictures hooks setup schemas limits dist lock sbom audit clean

race: $(VENV)/.installed
	@$(MAKE) --no-print-directory page || echo 'The page could not be built; the race goes on without it.'
	@$(BIN)/race start

page:
	@if $(NODE_IS_THERE); then $(MAKE) --no-print-directory $(PAGE); \
	else echo 'To watch races in a browser install Node 20 or newer (https://nodejs.org) and run `make page`.'; fi

$(PAGE): $(WEB)
	cd web && npm ci --no-audit --no-fund --loglevel=error && npm run --silent build -- --logLevel=error
	@touch $@

check-page: page
	@if $(NODE_IS_THERE); then cd web && npm run --silent check && npm test --silent && npm run --silent size; fi

# Files of tests side by side, in the order of tests/conftest.py. Whole servers, drivers and browsers are `test-live`; what
# takes minutes is `test-slow`: pages run, sites built, trainings compared. A process that dies is not replaced: the test in
# which it died fails by its name, where with another one in its place pytest waits without end.
PYTEST := $(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder \
  --max-worker-restart 0

test: $(VENV)/.installed-test
	@$(PYTEST) -m 'not live and not slow and not space'

test-live: $(VENV)/.installed-test
	@$(PYTEST) -m 'live and not slow and not space'

test-slow: $(VENV)/.installed-test
	@$(PYTEST) -m slow

lint: $(VENV)/.installed-test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/codespell

# The race in three dimensions and the emulated headset, drawn by the processor: minutes, one test after the other.
test-space: $(VENV)/.installed-test page
	@$(BIN)/python -m pytest -m space

# A script for each library of others, in environments of their own; writes the table of docs/libraries.md.
test-libraries: $(VENV)/.installed-test
	@$(BIN)/python tests/libraries/run.py

check: lint check-page test test-live test-slow

# The pictures of the page in README and docs; needs Chromium. Minutes without a graphics card.
pictures: $(VENV)/.installed-test page
	@PYTHONPATH=docs $(BIN)/python -m race_docs.pictures

# Warnings are errors. Nothing is read again from an earlier build: what pages name may have changed.
docs: $(VENV)/.installed-test
	$(BIN)/python -m sphinx --fresh-env --nitpicky --fail-on-warning --keep-going --quiet -b html docs docs/_build
	@PYTHONPATH=docs RACE_SERVER_INTERPRET=1 $(BIN)/python -m race_docs.blocks
	@echo 'The site is docs/_build/index.html.'

hooks:
	git config core.hooksPath .ci/hooks

setup: $(VENV)/.installed-test

schemas: $(VENV)/.installed-test
	$(BIN)/python -m race_server.net.wire.generate

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(VENV)/bin/python
	# torch first and by itself: as a dependency it may come with gigabytes for graphics cards.
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt torch
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test,lint,docs]"
	@touch $@ $(VENV)/.installed

limits: $(VENV)/.installed-test
	$(BIN)/python -m race_server.scenario.raceline.export

# A release: wheel and sdist with the page, tracks, schemas and policies.
dist: $(VENV)/.installed-test page
	$(BIN)/python -m hatchling build -d dist

# Tools of maintainers, apart from what a release needs.
$(TOOLS)/.installed: Makefile
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check uv==0.13.9 cyclonedx-bom==7.5.0 pip-audit==2.10.1
	@touch $@

# The versions of constraints.txt with the hashes of their files, for `pip install --require-hashes`.
lock: $(TOOLS)/.installed
	$(LOCK) pyproject.toml --extra keys --extra results -o deploy/requirements.txt
	$(LOCK) deploy/requirements-build.in -o deploy/requirements-build.txt

# What a release consists of, as CycloneDX documents.
sbom: $(TOOLS)/.installed
	@mkdir -p dist
	$(TOOLS)/bin/cyclonedx-py requirements deploy/requirements.txt --pyproject pyproject.toml --output-reproducible -o dist/race-server.cdx.json
	cd web && npm sbom --package-lock-only --sbom-format=cyclonedx > ../dist/page.cdx.json

# Asks public registers for known faults of what is pinned; not for the continuous integration, whose result
# would change without a commit.
audit: $(TOOLS)/.installed
	$(TOOLS)/bin/pip-audit --require-hashes --disable-pip -r deploy/requirements.txt
	cd web && npm audit

clean:
	rm -rf $(VENV) $(TOOLS) dist web/node_modules race_server/live/gateway/page docs/_build docs/generated .mypy_cache .ruff_cache .pytest_cache .hypothesis
