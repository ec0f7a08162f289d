# make plan    plan the paper's target, with pictures, into out/prostate-2003
# make test    lint, types, verification, tests
# make help    everything else

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
OUT ?= out
PAPER := cases/prostate-2003/case.toml
RESOLVED := cases/prostate/case.toml
TRAIN := cases/prostate-train/case.toml
DEBIAN := libegl1 libgl1 libgl1-mesa-dri libxrender1
DRAWS := $(BIN)/python -c "from needlefem.plotting.images import renderer; renderer()"

# what a bare Debian lacks: python3-venv for the environment, Mesa for pictures
# dense products are small here: threads only cost
export OPENBLAS_NUM_THREADS ?= 1

AS_ROOT := $(shell [ "$$(id -u)" = 0 ] || command -v sudo)
APT := $(AS_ROOT) env DEBIAN_FRONTEND=noninteractive apt-get -qq

.PHONY: help install plan test verify quick lint types unit studies calibrate bench figures docs tables newcomer commands mutants dependencies dist clean

help:
	@echo "make plan       plan the paper's target, with pictures and JSON, into $(OUT)/prostate-2003"
	@echo "make test       lint, types, verification and tests"
	@echo "make verify     all reference problems, with a report in $(OUT)/verification"
	@echo "make quick      the reference problems on coarse meshes"
	@echo "make lint       ruff"
	@echo "make types      mypy"
	@echo "make studies    every study behind the documentation's tables (half an hour)"
	@echo "make calibrate  calibrate the paper's scene anew (an hour)"
	@echo "make bench      what a plan, a time step and an accuracy cost"
	@echo "make figures    the paper's figures beside its numbers, and the pages' other pictures, into docs"
	@echo "make docs       the documentation site in $(OUT)/docs/index.html; warnings are errors"
	@echo "make tables     the tables of docs that the package prints, anew"
	@echo "make commands   every command of README and docs that takes long (an hour)"
	@echo "make newcomer   what README and docs tell a newcomer, with an installed package and no source"
	@echo "make mutants    which wrong changes to the core the tests detect (hours)"
	@echo "make dependencies  unit tests with the oldest and with the newest dependencies that are allowed"
	@echo "make dist       wheel and source distribution in dist, checked"
	@echo "make install    the environment in $(VENV), which all others make when it is missing"
	@echo "make clean      remove $(VENV) and $(OUT)"

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV) || { $(APT) update && $(APT) install -y python3-venv && $(PYTHON) -m venv --clear $(VENV); }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[all]"
	$(BIN)/python -m compileall -q needlefem
	$(DRAWS) 2>/dev/null || { $(APT) update && $(APT) install -y --no-install-recommends $(DEBIAN) && $(DRAWS); }
	@touch $@

plan: install
	$(BIN)/needlefem plan $(PAPER) --out $(OUT)/prostate-2003

test: lint types quick unit

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: install
	$(BIN)/mypy

verify: install
	$(BIN)/needlefem verify --report $(OUT)/verification

quick: install
	$(BIN)/needlefem verify --quick

unit: install
	$(BIN)/pytest -n auto --dist worksteal

studies: install
	$(BIN)/needlefem study targets $(PAPER)
	$(BIN)/needlefem study robust $(PAPER) --against $(RESOLVED)
	$(BIN)/needlefem study paper $(PAPER) --against $(RESOLVED)
	$(BIN)/needlefem study dynamics $(PAPER)
	$(BIN)/needlefem study energy $(PAPER)
	$(BIN)/needlefem study energy $(RESOLVED)
	$(BIN)/needlefem study smoothness $(PAPER)
	$(BIN)/needlefem study smoothness $(RESOLVED)
	$(BIN)/needlefem study independence $(RESOLVED)
	$(BIN)/needlefem study stability $(RESOLVED)
	$(BIN)/needlefem study accuracy $(RESOLVED)
	$(BIN)/needlefem study stated_error $(RESOLVED)
	$(BIN)/needlefem study convergence $(RESOLVED)
	$(BIN)/needlefem study elements $(RESOLVED)
	$(BIN)/needlefem study extremes $(RESOLVED)
	$(BIN)/needlefem study friction $(RESOLVED)
	$(BIN)/needlefem study trains $(RESOLVED)
	$(BIN)/needlefem study cycles $(PAPER)
	$(BIN)/needlefem study steps $(PAPER)

calibrate: install
	$(BIN)/python cases/prostate-2003/calibrate.py --draws 512 --write

figures: install
	$(BIN)/needlefem figures $(PAPER) --out docs
	$(BIN)/needlefem render $(PAPER) --setup --out docs/pictures/setup.png
	$(BIN)/needlefem render $(TRAIN) --size 800x450 --frames 48 --out docs/pictures/train.webp
	$(BIN)/needlefem plan $(PAPER) --out $(OUT)/prostate-2003
	$(BIN)/needlefem plan $(RESOLVED) --out $(OUT)/prostate
	$(BIN)/needlefem run $(TRAIN) --out $(OUT)/prostate-train
	cp $(OUT)/prostate-2003/stages.png docs/pictures/stages.png
	cp $(OUT)/prostate/stages.png docs/pictures/stages-resolved.png
	cp $(OUT)/prostate-train/forces.png docs/pictures/forces-train.png
	cp $(OUT)/prostate-train/sticking.png docs/pictures/sticking-train.png
	for case in breast liver; do \
		$(BIN)/needlefem render cases/$$case/case.toml --setup --out docs/pictures/$$case-setup.png && \
		$(BIN)/needlefem plan cases/$$case/case.toml --out $(OUT)/$$case --no-pictures && \
		$(BIN)/needlefem render $(OUT)/$$case --out docs/pictures/$$case.png || exit 1; done
	$(BIN)/needlefem render cases/gel/case.toml --field displacement --depth "3.2 cm" --out docs/pictures/gel.png
	$(BIN)/needlefem render cases/layers/case.toml --setup --out docs/pictures/layers-setup.png
	$(BIN)/needlefem run cases/layers/case.toml --out $(OUT)/layers
	cp $(OUT)/layers/forces.png docs/pictures/layers-forces.png
	$(BIN)/python docs/site/pages.py docs/tutorial/first-insertion.md $(OUT)/first-insertion
	cp $(OUT)/first-insertion/first.png docs/pictures/tutorial-first.png
	$(BIN)/python docs/site/pages.py docs/tutorial/own-anatomy.md $(OUT)/own-anatomy
	cp $(OUT)/own-anatomy/setup.png docs/pictures/tutorial-setup.png
	cp $(OUT)/own-anatomy/strain.png docs/pictures/tutorial-strain.png

docs: $(VENV)/docs-installed
	$(BIN)/needlefem verify --quick --report $(OUT)/docs-verification
	$(BIN)/sphinx-build -W --keep-going -q -c docs . $(OUT)/docs

$(VENV)/docs-installed: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[docs]"
	@touch $@

commands: install
	$(BIN)/pytest -m long

mutants: install
	$(BIN)/python -m tests.mutation --count 80 --seed 11

dependencies:
	rm -rf $(OUT)/oldest $(OUT)/newest
	$(PYTHON) -m venv $(OUT)/oldest
	$(OUT)/oldest/bin/python -m pip install --quiet --disable-pip-version-check --requirement tests/oldest.txt --editable ".[all]"
	$(OUT)/oldest/bin/pytest -n auto
	$(PYTHON) -m venv $(OUT)/newest
	$(OUT)/newest/bin/python -m pip install --quiet --disable-pip-version-check --upgrade --upgrade-strategy eager --editable ".[all]"
	$(OUT)/newest/bin/pytest -n auto

dist: install
	$(BIN)/python -m pip install --quiet --disable-pip-version-check build twine
	rm -rf dist
	$(BIN)/python -m build --outdir dist
	$(BIN)/twine check --strict dist/*

newcomer:
	rm -rf $(OUT)/newcomer
	$(PYTHON) -m venv $(OUT)/newcomer/venv
	$(OUT)/newcomer/venv/bin/python -m pip install --quiet --disable-pip-version-check ".[image,render]"
	$(OUT)/newcomer/venv/bin/python docs/site/newcomer.py $(OUT)/newcomer/work

tables: install
	$(BIN)/python docs/site/tables.py

bench: install
	$(BIN)/needlefem bench render $(PAPER)
	$(BIN)/needlefem bench imports $(PAPER)
	$(BIN)/needlefem bench plan $(PAPER)
	$(BIN)/needlefem bench plan $(RESOLVED)
	$(BIN)/needlefem bench insertion $(PAPER) --out $(OUT)/bench
	$(BIN)/needlefem bench scaling $(RESOLVED) --out $(OUT)/bench
	$(BIN)/needlefem bench skips $(PAPER)
	$(BIN)/needlefem bench solvers $(RESOLVED)
	$(BIN)/needlefem bench tissue $(RESOLVED)
	$(BIN)/needlefem bench stepping $(PAPER)
	$(BIN)/needlefem bench accuracy $(RESOLVED) --out $(OUT)/bench
	$(BIN)/needlefem bench elements verification --out $(OUT)/bench
	$(BIN)/needlefem bench integrators verification --out $(OUT)/bench

clean:
	rm -rf $(VENV) $(OUT) dist docs/examples
