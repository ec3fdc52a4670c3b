# What a person types here. `make help` lists it.
#
# The environment is made once per content of a lock file and reused until that changes.

SHELL := /bin/bash
.DEFAULT_GOAL := help
MAKEFLAGS += --no-print-directory

VENV ?= .venv
HOST ?= 127.0.0.1
PORT ?= 8000
PY := $(VENV)/bin/python

# A stamp is named by the checksum of what it stands for.
checksum = $(firstword $(shell cat $(1) pyproject.toml | cksum))
SERVER_STAMP := $(VENV)/.installed-server-$(call checksum,requirements.lock)
DEV_STAMP := $(VENV)/.installed-dev-$(call checksum,requirements-dev.lock)
TORCH_VENV := $(VENV)-torch
TORCH_STAMP := $(TORCH_VENV)/.installed-$(firstword $(shell cat requirements-torch.txt requirements-dev.lock | cksum))
# The development environment has everything that the server needs, in the same versions.
READY := $(or $(wildcard $(DEV_STAMP)),$(SERVER_STAMP))

# A process of the test run for each processor; the tests of one file stay together, with what they share.
SPREAD := -n auto --dist loadfile --no-loadscope-reorder
# So numpy has no threads of its own, which would only wait for each other. It reads this when it is imported.
export OPENBLAS_NUM_THREADS := 1

.PHONY: help demo demo-runs test test-fast test-torch chaos validation bench mutants lint format screenshots release lock echarts clean

help: ## list these commands
	@awk -F ' ## ' '/^[a-z-]+:.* ## / { sub(/:.*/, "", $$1); printf "make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(READY) ## the leaderboard with simulated data on http://127.0.0.1:8000 (PORT=… for another port)
	@exec $(PY) manage.py demo --host $(HOST) --port $(PORT)

demo-runs: $(DEV_STAMP) ## run the demo's baselines again on rendered frames (RUNS="tracking pixel-mse" for some)
	PATH="$(abspath $(VENV))/bin:$$PATH" nice -n 10 $(PY) -m leaderboard.demo.runs build/demo-runs $(RUNS)

test: lint ## lint, then all tests; says which services are missing
	@$(PY) -m tests.everything

test-fast: $(DEV_STAMP) ## tests of about a minute: no services, no browser, nothing slow
	$(PY) -m pytest -q $(SPREAD) -m "not slow and not services and not browser"

test-torch: $(DEV_STAMP) $(TORCH_STAMP) ## the tests that need torch, in an environment of their own (.venv-torch)
	@$(TORCH_VENV)/bin/python -c 'import lightning, torch, torchmetrics; print("torch", torch.__version__)'
	OMP_NUM_THREADS=1 $(TORCH_VENV)/bin/python -m pytest -q $(SPREAD) -m torch tests/evaluator tests/tsttc_baselines

chaos: $(DEV_STAMP) ## 200 uploads while services fail; counts lost, doubly scored and stuck files
	@$(PY) -m tests.chaos

validation: $(DEV_STAMP) ## print the tables of docs/validation.md and the figures of docs/uncertainty.md; hours
	$(PY) -m tests.validity
	$(PY) -m tests.security.hidden_differences

bench: $(DEV_STAMP) ## measure the figures of docs/capacity.md and compare them with their targets
	@$(PY) -m benchmarks

ROOM ?= boards
SEED ?= 1
N ?= 60

mutants: $(DEV_STAMP) ## plant small faults in the last commit and list those that no test notices (ROOM=… SEED=… N=… AT=file:line)
	@$(PY) -m tests.mutants $(ROOM) --seed $(SEED) --number $(N) --at "$(AT)"

# PyPI has Biome for Linux on x86_64 alone; CI runs there.
BIOME := $(if $(filter Linux-x86_64,$(shell uname -sm | tr ' ' -)),$(VENV)/bin/biome,@echo "styles and scripts are not looked at here: biome")

lint: $(DEV_STAMP) ## check style, types, import layers and migrations
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(BIOME) format static
	$(VENV)/bin/djangofmt --check templates
	$(PY) -m mypy .
	$(VENV)/bin/lint-imports
	$(PY) manage.py makemigrations --check --dry-run

format: $(DEV_STAMP) ## format the code
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .
	$(BIOME) format --write static
	$(VENV)/bin/djangofmt --quiet templates

screenshots: $(DEV_STAMP) ## take the README's screenshots of the demo, into docs/screenshots/
	$(PY) -m tests.browser.screenshots

release: ## build wheel and sdist of REF (default HEAD), check them, print their digests
	@deploy/release.sh $(REF)

# Universal: one file for every platform and Python; hashes, and no index host. Existing pins stay unless
# `make lock UPGRADE=--upgrade` asks for newer ones.
LOCK := $(VENV)-lock/bin/uv pip compile pyproject.toml --extra pandas --group server --group build \
	--universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate --quiet $(UPGRADE)

lock: ## update the lock files from pyproject.toml
	@$(call find_python) && "$$python" -m venv $(VENV)-lock && $(VENV)-lock/bin/python -m pip install --quiet uv
	$(LOCK) --output-file requirements.lock
	$(LOCK) --extra baselines --extra plots --extra parquet --group dev --constraint requirements.lock --output-file requirements-dev.lock

# The parts of Apache ECharts that the charts use. Needs node and the npm registry; the digest of what comes out
# stands in static/vendored/README.md.
ECHARTS := 6.1.0
ESBUILD := 0.28.2

echarts: ## rebuild static/vendored/echarts.min.js (ECHARTS=… for another version)
	@folder=$$(mktemp -d) && trap 'rm -rf "$$folder"' EXIT && \
	npm install --prefix "$$folder" --ignore-scripts --no-audit --no-fund --silent echarts@$(ECHARTS) esbuild@$(ESBUILD) && \
	cp static/vendored/echarts.entry.txt "$$folder/entry.mjs" && \
	"$$folder/node_modules/.bin/esbuild" "$$folder/entry.mjs" --bundle --minify --format=iife --global-name=echarts \
		--target=es2020 --legal-comments=none '--define:process.env.NODE_ENV="production"' --log-level=error \
		--outfile=static/vendored/echarts.min.js && \
	cd "$$folder/node_modules" && cat echarts/LICENSE echarts/NOTICE echarts/licenses/LICENSE-d3 zrender/LICENSE \
		tslib/LICENSE.txt > "$(CURDIR)/static/vendored/echarts.LICENSE" && \
	cd "$(CURDIR)" && sha256sum static/vendored/echarts.*

clean: ## remove the environment and everything generated, but not var/ (the demo's data)
	rm -rf $(VENV) $(VENV)-lock $(TORCH_VENV) staticfiles build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis

# --- the environment -------------------------------------------------------------------------------------

# Sets `python` to the first interpreter that is new enough and can make environments.
define find_python
python=; for candidate in $(PYTHON) python3.11 python3.12 python3.13 python3 /usr/bin/python3; do \
	if "$$candidate" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
		python="$$candidate"; break; \
	fi; \
done; \
if [ -z "$$python" ]; then \
	echo "No Python 3.11 or newer with venv was found (on Debian: apt install python3-venv);" >&2; \
	echo "name one with: make PYTHON=/path/to/python3" >&2; exit 1; \
fi
endef

# Installs lock file $(1) and then the package itself, without fetching anything that is not pinned; stamps $@.
define install
@$(call find_python); \
if ! $(PY) -m pip --version >/dev/null 2>&1; then echo "Making $(VENV) with $$python"; "$$python" -m venv --clear $(VENV); fi
@echo "Installing $(1)"
@$(PY) -m pip install --quiet --disable-pip-version-check --require-hashes -r $(1)
@$(PY) -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
@rm -f $(VENV)/.installed-$(2)-*
@touch $@
endef

$(SERVER_STAMP):
	$(call install,requirements.lock,server)

$(DEV_STAMP):
	$(call install,requirements-dev.lock,dev)

# What torch needs lies on top of the development environment, which stays without it.
$(TORCH_STAMP): $(DEV_STAMP)
	@echo "Installing requirements-torch.txt"
	@$(PY) -m venv --clear $(TORCH_VENV)
	@$(PY) -c 'import sysconfig; print("import site; site.addsitedir(" + repr(sysconfig.get_path("purelib")) + ")")' \
		> $$($(TORCH_VENV)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/development.pth
	@$(TORCH_VENV)/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-torch.txt
	@touch $@
