# Everything runs through ./env: on this machine if it has dolfinx, otherwise in the image of the Dockerfile.
# DEBIAN=sid make TARGET uses the image of that release.
.DEFAULT_GOAL := help
.PHONY: help demo test golden nightly test-core test-slow test-two test-three test-wheel test-report test-sid golden-two lint format paper bench oracle oracle-today mutants-drawn docs dist clean
DEMOS := example1_tresca example1_coulomb
REPORTS := $(addprefix demos/scenes/,example1_coulomb press_and_slide bracket) tests/data/three_feet
SIDE_BY_SIDE := ./env python3 -m pytest -q -n auto --maxprocesses 8 --dist worksteal
ON_RANKS := ./env mpirun -n $$n python3 -m pytest -q --color=no $$(grep -l mark.mpi tests/*/test_*.py)
RUFF := build/ruff-0.17.5
SPHINX := build/sphinx-9.0.4
BUILD := build/build-1.6.1
COSMIC_RAY := build/cosmic-ray-8.7.0
COSMIC := PYTHONPATH=$(COSMIC_RAY) $(COSMIC_RAY)/bin
SINCE := HEAD~1
TESTS := tests/verification

# A registry that does not answer at once is asked for minutes.
PIP := python3 -m pip install --retries 9

help:       ## list the targets
	@sed -nE 's/^([a-z-]+):.*## /\1\t/p' Makefile | expand -t 12

demo:       ## solve Example 1 of the paper with Tresca and with Coulomb friction on two ranks (results/)
	for d in $(DEMOS); do ./env mpirun -n 2 python3 -m signorini_fx solve demos/scenes/$$d.toml --out results/$$d || exit; done

test:       ## run the quick tests on one rank, side by side, and those marked mpi also on two
	$(SIDE_BY_SIDE)
	n=2; $(ON_RANKS) -m "mpi and not slow"

golden:     ## compare the answers of hundreds of problems with those recorded, on one rank (tests/golden)
	./env python3 -m tests.golden

nightly:    ## run what .ci/run leaves out: hours; it goes on after a failure
	$(MAKE) -k test-slow test-two test-three golden golden-two test-sid test-wheel oracle-today

golden-two: ## compare the same answers on two ranks
	./env python3 -m tests.golden --ranks 2 --jobs 1

test-sid:   ## run the quick tests in the image of Debian sid
	DEBIAN=sid $(MAKE) test

test-slow:  ## run the slow tests on one rank, side by side
	$(SIDE_BY_SIDE) -m "slow"

test-two:   ## run the slow tests marked mpi on two ranks
	n=2; $(ON_RANKS) -m "mpi and slow"

test-three: ## run all tests marked mpi on three ranks
	n=3; $(ON_RANKS) -m "mpi"

test-core:  ## run the quick tests with no add-on installed; those that ask for one are skipped
	SFX_WITHOUT_ADD_ONS=1 $(SIDE_BY_SIDE)

test-wheel: ## run the quick tests of one rank with wheels of FEniCSx from PyPI, in a virtual environment
	SFX_WHEELS=1 $(SIDE_BY_SIDE)

test-report:  ## open reports in Chromium at two widths and print them (results/report); installs it where it may
	for d in $(REPORTS); do out=results/report/$${d##*/}; \
	  ./env signorini-fx solve $$d.toml --no-fields --quiet --out $$out && ./env signorini-fx report $$out || exit; done
	python3 tests/support/in_chromium.py $(patsubst %,results/report/%/report.html,$(notdir $(REPORTS)))

lint: $(RUFF)  ## check style (ruff) and types (mypy)
	$(RUFF) check
	$(RUFF) format --check
	./env mypy

format: $(RUFF)  ## let ruff rewrite the files
	$(RUFF) check --fix
	$(RUFF) format

paper:      ## recompute the tables and figures of the paper (results/paper)
	./env python3 demos/paper.py

bench:      ## measure time and memory (results/bench.csv)
	./env python3 benchmarks/costs/run.py

oracle:     ## check 5,000 random scenes with a program that shares no code with the package (results/oracle, half an hour)
	./env python3 -m benchmarks.stability.oracle --jobs 2

oracle-today: ## check 300 random scenes in the same way, others each day (results/oracle)
	./env python3 -m benchmarks.stability.oracle --jobs 2 --first $$(date +%y%j0) \
	  --plane 100 --space 60 --bodies 60 --effects 50 --space-effects 30

mutants-drawn: $(COSMIC_RAY)  ## let cosmic-ray spoil lines that changed since SINCE, and print what TESTS do not notice
	printf '%s\n' '[cosmic-ray]' 'timeout = 600.0' 'test-command = "./env python3 -m pytest -x -q $(TESTS)"' \
	  "module-path = [$$(git diff --name-only --diff-filter=d $(SINCE) -- 'signorini_fx/*.py' | sed 's/.*/"&",/' | tr -d '\n')]" \
	  '[cosmic-ray.distributor]' 'name = "local"' '[cosmic-ray.filters.git-filter]' 'branch = "$(SINCE)"' > build/mutants.toml
	rm -f build/mutants.sqlite
	$(COSMIC)/cosmic-ray init build/mutants.toml build/mutants.sqlite
	$(COSMIC)/cr-filter-git --config build/mutants.toml build/mutants.sqlite
	$(COSMIC)/cosmic-ray exec build/mutants.toml build/mutants.sqlite
	$(COSMIC)/cr-report --surviving-only --show-diff build/mutants.sqlite

docs: $(SPHINX)  ## build README, docs/, demos and docstrings as a site; warnings are errors (build/docs/docs/index.html)
	$(SPHINX)/bin/python -m sphinx -q -E -n -W --keep-going -c docs . build/docs

dist: $(BUILD)  ## make an archive of the sources and a wheel, and check them (dist/)
	rm -rf dist build/installed
	PYTHONPATH=$(BUILD) python3 -m build -o dist .
	PYTHONPATH=$(BUILD) python3 -m twine check --strict dist/*
	$(PIP) -qq --no-deps --target build/installed dist/*.whl
	! grep -nP '!\[|\]\((?!https:)' build/installed/*.dist-info/METADATA
	cd build/installed && for name in $$(cd ../..; git ls-files signorini_fx meshes ':!*README*'); do \
	  test -e $$name || test -e signorini_fx/$$name || { echo "$$name is not in the wheel"; exit 1; }; done

clean:      ## remove everything that these targets made, except the image
	rm -rf results build dist *.egg-info .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

# Debian stable has no ruff; the formatting depends on its version, so the version is pinned.
$(RUFF):
	rm -rf $@.d
	$(PIP) -qq --no-deps --target $@.d ruff==$(@:build/ruff-%=%)
	mv $@.d/bin/ruff $@
	rm -rf $@.d

$(COSMIC_RAY):
	rm -rf $@.d
	$(PIP) -qq --target $@.d cosmic-ray==$(@:build/cosmic-ray-%=%)
	mv $@.d $@

# An environment of its own: what else is installed on this machine has no say in which versions fit.
$(SPHINX):
	rm -rf $@.d
	python3 -m venv --without-pip $@.d
	python3 -m pip --python $@.d/bin/python install --retries 9 -qq sphinx==$(@:build/sphinx-%=%) \
		myst-parser==5.2.0 furo==2025.12.19 numpy==2.4.2 pydantic==2.12.5
	mv $@.d $@

$(BUILD):
	rm -rf $@.d
	$(PIP) -qq --target $@.d build==$(@:build/build-%=%) twine==7.0.0
	mv $@.d $@
