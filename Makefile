# Each target works on an empty clone with only python3 >= 3.11 and make; .venv is made when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Test processes: one more than cores, as some tests wait for servers and disks.
JOBS ?= $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')
READY := $(VENV)/.ready
# With what tests, lint and benchmarks need besides.
TESTED := $(VENV)/.tested
# Tools that only a release needs.
RELEASE := .venv-release
# Tools that only the documentation site needs.
DOCS := .venv-docs

.PHONY: install demo pictures test check lint docs bench campaign pins release clean

install: $(READY)

PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps
INSTALLED := $(BIN)/python flows/deploy/install.py
# Compiled is what commands import, on all cores; half of the files are tests of their packages.
$(READY): flows/deploy/runtime.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "aerodb needs python3 >= 3.11"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(INSTALLED) flows/deploy/runtime.txt
	$(PIP) --no-build-isolation -e .
	-$(BIN)/python -m compileall -qq -j 0 -x '/(tests|pip)/' $(VENV)/lib aerodb flows tasks storage
	$(BIN)/python -m aerodb.flows.compile_kernels
	@touch $(READY)

$(TESTED): requirements-hashed.txt $(READY)
	$(INSTALLED) requirements-hashed.txt
	@touch $(TESTED)

demo: install
	$(BIN)/aerodb --workspace demo-workspace demo --seed 5

pictures: demo $(TESTED)
	$(BIN)/python -m tests.support.demo_pictures demo-workspace docs/pictures

# What is imported is compiled once, not again by each of the hundreds of processes.
install demo test check campaign: export PYTHONDONTWRITEBYTECODE =
test: $(TESTED)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# What the change (against origin/main, or HEAD) reaches, the nearest first, for a minute and a half.
check: $(TESTED)
	files=`$(BIN)/python -m tests.support.reached`; test -z "$$files" || $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --within 90 $$files

lint: $(TESTED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/vulture
	$(BIN)/mypy
	PYTHONPATH=. $(BIN)/lint-imports
	$(BIN)/python -m tests.support.prose

# The documentation site in dist/docs, with the notebooks as they run now; nothing of it is fetched from anywhere when it is read.
docs: install $(DOCS)/.ready
	rm -rf $(DOCS)/pages dist/docs
	$(BIN)/python docs/site/pages.py $(DOCS)
	cd $(DOCS) && NO_MKDOCS_2_WARNING=1 bin/mkdocs build --quiet --strict

$(DOCS)/.ready: flows/deploy/docs-tools.txt
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r $<
	cd $(DOCS)/lib/python*/site-packages && echo "import site; site.addsitedir('`echo $(CURDIR)/$(VENV)/lib/python*/site-packages`')" > aerodb.pth
	@touch $@

bench: $(TESTED)
	$(BIN)/python -m tests.bench

campaign: $(TESTED)
	$(BIN)/python -m pytest -n $(JOBS) -m "heavy or campaign" --full-campaign

# The hashes of all pins: of everything, and of what production needs (the tools of the tests stay out).
PINS := $(VENV)/uv/bin/uv pip compile --quiet --generate-hashes --python-version 3.11 --no-annotate --no-header
pins: $(READY)
	$(PINS) --universal --no-deps requirements.txt -o requirements-hashed.txt
	$(PINS) --python-platform linux --extra jsbsim --constraint requirements.txt pyproject.toml flows/deploy/build.in -o flows/deploy/runtime.txt
	$(PINS) flows/deploy/release-tools.in -o flows/deploy/release-tools.txt
	$(PINS) flows/deploy/docs-tools.in -o flows/deploy/docs-tools.txt
	$(PINS) flows/deploy/uv.in -o flows/deploy/uv.txt

# What a release consists of: the wheel, its bill of materials (CycloneDX) and the licences of all that it needs.
release: install $(RELEASE)/.ready
	rm -rf dist
	$(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation -w dist .
	$(PYTHON) -m venv dist/runtime
	dist/runtime/bin/python -m pip install --quiet --no-deps --require-hashes -r flows/deploy/runtime.txt
	dist/runtime/bin/python -m pip install --quiet --no-deps dist/aerodb-*.whl
	$(RELEASE)/bin/cyclonedx-py environment dist/runtime/bin/python --output-reproducible --output-format JSON -o dist/sbom.cdx.json
	$(RELEASE)/bin/pip-licenses --python=dist/runtime/bin/python --format=markdown --with-urls --output-file=dist/licences.md
	rm -rf dist/runtime

$(RELEASE)/.ready: flows/deploy/release-tools.txt
	$(PYTHON) -m venv $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r $<
	@touch $@

clean:
	rm -rf $(VENV) $(RELEASE) $(DOCS) demo-workspace dist
