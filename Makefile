# turnscan: `make help` lists what there is.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.ready
COMPILED := $(VENV)/.compiled
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

# Images of build machines often set it: then every process that a test starts compiles the sources again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup system drivers demo test test-fast test-interpreters check frontend frontend-check \
	format bench bench-libraries bench-app accuracy mutants docs clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | sort | expand -t 22

setup: $(COMPILED) ## make .venv with turnscan, compiled, and everything needed to work on it

# With CI (any value but 0, false, no, off) what `make drivers` adds comes along at once, and must.
IN_CI := $(filter-out 0 false no off,$(CI))
COMMA := ,
EXTRAS := dev$(if $(IN_CI),$(COMMA)genicam$(COMMA)cad$(COMMA)gige)

# pip would compile on one processor; some packages hold files that are no Python. Their own tests,
# a fifth of it all, nobody runs; of tools that run by themselves Python loads little or nothing.
$(STAMP): pyproject.toml constraints.txt | $(if $(IN_CI),system)
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --no-compile -e '.[$(EXTRAS)]'
	@$(BIN)/python -m compileall -q -j 0 -x '/(tests|pip|setuptools|mypyc?|fontTools|tornado)/' $(VENV)/lib >/dev/null || :
	touch $@

# It compiles what the sources of the kernels say, and takes a second where these did not change.
$(COMPILED): $(STAMP) $(shell find src/turnscan -name '*.py')
	$(BIN)/turnscan precompile
	touch $@

# What the tests compare with and drive: independent readers of our files, the GigE Vision library
# with its fake camera, a C compiler and a browser. Without CI the tests of what is missing are
# skipped, and pytest's summary says so; with CI they fail.
PROGRAMS := assimp dxf2vrml ogr2ogr arv-fake-gv-camera-0.8 cc
SYSTEM_PACKAGES := assimp-utils dime gdal-bin \
	aravis-tools aravis-tools-cli gir1.2-aravis-0.8 \
	gcc libc6-dev pkg-config python3-dev libgirepository1.0-dev libcairo2-dev
# Chromium without windows takes a quarter of the processor time for a page. Debian has it.
HEADLESS := chromium-headless-shell
GIGE_HEADERS := pkg-config --exists gobject-introspection-1.0 cairo 2>/dev/null
HAS_ALL := for p in $(PROGRAMS); do command -v $$p || exit 1; done; \
	command -v $(HEADLESS) || command -v chromium || command -v chromium-browser || exit 1; \
	$(GIGE_HEADERS)
system: ## install CAD readers, camera libraries and browser that the tests use (Debian, as root)
	@if ($(HAS_ALL)) >/dev/null; then :; elif command -v apt-get >/dev/null && [ "$$(id -u)" = 0 ]; \
	then export DEBIAN_FRONTEND=noninteractive; apt-get update -qq \
	     && apt-get install -y -qq --no-install-recommends $(SYSTEM_PACKAGES) \
	          $$(apt-cache pkgnames $(HEADLESS) | grep -x $(HEADLESS) || echo chromium) >/dev/null; \
	else echo "not root or not Debian: tests may need chromium and some of $(SYSTEM_PACKAGES)"; fi

drivers: setup system ## install the camera drivers, and the STEP library, that this machine can have
	@$(BIN)/python -c 'import genicam, harvesters' 2>/dev/null || $(INSTALL) -e '.[genicam]' \
	     || [ -z "$(IN_CI)" ]
	@$(BIN)/python -c 'import OCP' 2>/dev/null || $(INSTALL) -e '.[cad]' \
	     || [ -z "$(IN_CI)" ]
	@$(BIN)/python -c 'import gi' 2>/dev/null || if $(GIGE_HEADERS); \
	then $(INSTALL) -e '.[gige]' || [ -z "$(IN_CI)" ]; \
	else echo "no GObject headers: GigE cameras cannot be driven here"; [ -z "$(IN_CI)" ]; fi

demo: setup ## the main job from end to end: pictures → mesh → DXF, report and pictures
	$(BIN)/turnscan demo -o demo-output

# More processes than cores: many tests wait for boards, cameras and leases in real time.
WORKERS ?= 3
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadscope --no-loadscope-reorder
test: drivers ## run all tests
	$(PYTEST) --durations=20

# Each process of make test reads all test modules. After this they need not each put pytest's
# own words for what fails into them, which takes longer than to read them.
.PHONY: collect
collect: setup ## whether all test modules can be read
	@$(BIN)/python -m pytest --collect-only -q >$(VENV)/collected \
	     || { cat $(VENV)/collected; exit 1; }

# The pure rooms, the contracts and one look through each door: scan file, command line, browser's
# server, browser, boards, guard.
FAST := tests/contracts tests/rig tests/stripes tests/calibrate tests/points tests/surface tests/shapes \
	tests/poses tests/edit tests/mesh tests/formats tests/drawings tests/scanner tests/acquire tests/test_errors.py \
	tests/scan/test_pictures.py tests/cli/test_door.py tests/app/test_protocol.py \
	tests/web/test_rooms.py::test_a_scan_with_the_simulated_bench \
	tests/app/e2e/test_frame.py::test_one_browser_invites_another \
	tests/devices/test_conformance_boards.py tests/safety/test_removed.py
test-fast: setup ## the inner loop, two to three minutes: pure rooms, contracts, one look through each door
	$(PYTEST) -q -m 'not slow' $(FAST)

test-interpreters: setup ## pure rooms, scan and cli on every other Python from 3.11 that is here
	$(BIN)/python tests/interpreters.py

check: frontend-check lint docs-check collect ## format, lint, types, import contract, module sizes, front end, docs, test modules

# It needs no kernel: with -j it goes on while these are compiled.
.PHONY: lint
lint: $(STAMP) ## what of check looks at the Python sources
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tests/contracts/module_sizes.py

# The front end's bundle is tracked, so that only those who change it need Node.
NODE_READY := frontend/node_modules/.package-lock.json
NODE_20 := node -e 'process.exit(process.versions.node.split(".")[0] >= 20 ? 0 : 1)' 2>/dev/null

$(NODE_READY): frontend/package-lock.json
	cd frontend && npm ci --no-audit --no-fund --loglevel=error
	touch $@

frontend: $(NODE_READY) ## build the browser's front end into src/turnscan/app/static (needs Node 20)
	cd frontend && npm run --silent build

frontend-check: ## format, lint, types and tests of the front end, and whether its bundle is what the sources give
	@if $(NODE_20); then $(MAKE) --no-print-directory frontend-compare; \
	else echo "no Node 20 (nodejs.org, or Debian 13's nodejs and npm): front end not checked"; \
	     [ -z "$(IN_CI)" ]; fi

.PHONY: frontend-compare
frontend-compare: $(NODE_READY) ## the same, where Node is known to be there
	cd frontend && npm run --silent check && npm run --silent test
	cd frontend && npm run --silent build -- --logLevel error --outDir ../build/static
	diff -rq build/static src/turnscan/app/static || { echo "run make frontend, and commit"; exit 1; }

format: setup ## let ruff put the sources in order, and Biome those of the front end where Node is
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	@if $(NODE_20); then $(MAKE) --no-print-directory frontend-format; fi

.PHONY: frontend-format
frontend-format: $(NODE_READY) ## let Biome put the front end in order
	cd frontend && npm run --silent format

# A file for each machine and commit in build/bench; what became slower than its noise is named.
SPEEDS := history stripes surface reconstruct scale acquire batch startup simulated_frames
bench: setup ## speeds beside what is wanted of them, and what became slower since the last time
	$(BIN)/python -m bench $(SPEEDS)

# In an environment of its own: half a gigabyte of libraries, and a pytest plug-in that Open3D brings.
bench-libraries: ## our own parts beside libraries that offer the same; writes the decision pages
	test -x .bench/bin/python || $(PYTHON) -m venv .bench
	.bench/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,bench]'
	.bench/bin/python -m bench libraries --quick --write

bench-app: setup ## how long a person waits for the browser workshop, to a million triangles
	$(BIN)/python -m bench.app --full

accuracy: setup ## accuracy against truth, short version (by hand: python -m bench.accuracy --full)
	$(BIN)/python -m bench.accuracy

mutants: setup ## put faults into copies of the sources and say which no test notices (an hour)
	$(BIN)/python -m bench.mutants

# The tests run all notebooks; with -j it goes on while kernels are compiled.
.PHONY: docs-check
docs-check: $(STAMP) ## whether the documentation can be built, but for what the cells of notebooks show
	$(BIN)/sphinx-build -j auto -q -W -D run_cells=0 -b html docs docs/_build/check

docs: setup ## build the documentation into docs/_build/html
	$(BIN)/sphinx-build -j auto -q -W -b html docs docs/_build/html

clean: ## remove what the other targets made
	rm -rf $(VENV) .bench .interpreters demo-output docs/_build
