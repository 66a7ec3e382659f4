# Each target works on an empty clone with only python3 >= 3.11 and make; .venv is made when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Test processes: one more than cores, as some tests wait for servers and disks.
JOBS ?= $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')
READY := $(VENV)/.ready
# aerodb with flows, tasks and storage in it, as it is installed: what mypy and lint-imports read.
WHOLE := $(VENV)/whole

.PHONY: install demo pictures test lint bench campaign clean

install: $(READY)

$(READY): requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "aerodb needs python3 >= 3.11"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	$(BIN)/python -m aerodb.flows.compile_kernels
	@touch $(READY)

demo: install
	$(BIN)/aerodb --workspace demo-workspace demo --seed 5

pictures: demo
	$(BIN)/python -m tests.support.demo_pictures demo-workspace docs/pictures

test: install
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/vulture
	rm -rf $(WHOLE)/aerodb && mkdir -p $(WHOLE)/aerodb
	ln -s $(CURDIR)/aerodb/__init__.py $(CURDIR)/aerodb/[a-z]* $(addprefix $(CURDIR)/,flows tasks storage) $(WHOLE)/aerodb
	cd $(WHOLE) && ../bin/mypy --config-file ../../pyproject.toml
	cd $(WHOLE) && PYTHONPATH=$(CURDIR) ../bin/lint-imports --config ../../pyproject.toml

bench: install
	$(BIN)/python -m tests.bench

campaign: install
	$(BIN)/python -m pytest -n $(JOBS) -m "heavy or campaign" --full-campaign

clean:
	rm -rf $(VENV) demo-workspace
