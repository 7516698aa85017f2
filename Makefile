# Everything runs from .venv, which `setup` keeps ready; nothing needs to be installed before `make`.
.DEFAULT_GOAL := help
.PHONY: help setup demo view test test-slow test-all lint docs site published wheel clean

# `make test PYTHON=python3.13` tests that Python, in an environment beside the usual one.
ifeq ($(origin PYTHON),command line)
venv := .venv-$(notdir $(PYTHON))
else
venv := .venv
override PYTHON :=
endif
bin := $(venv)/bin
setup := VENV=$(venv) PYTHON=$(PYTHON) sh tools/setup.sh
gl_4_1 := MESA_GL_VERSION_OVERRIDE=4.1FC MESA_GLSL_VERSION_OVERRIDE=410
# With it in the environment, each of the many processes that tests start would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE
# Of two cores: many tests wait for a process to end or to hang, and a third worker uses that time. Files of --junit-xml
# have the seconds of each test.
workers := -n 3 --dist worksteal
# What another version of OpenGL may break: state and targets, shaders, and what every technique must keep.
of_4_1 := tests/gl tests/techniques/test_contract.py
# What depends on how Embree works on other processors.
of_isa := tests/truths
# Packets of 4 rays, and of 8 where this processor has 16; else 8 are its own, with which `make test` traces.
other_isa = sse4.2 $(shell grep -q avx512vl /proc/cpuinfo && echo avx2)

# A browser for the report and for engines; a checker of memory; a virtual display with mouse and keyboard for the window;
# the installer of engines for the web.
for_slow := chromium valgrind Xvfb xdotool window npm

help:
	@echo "make demo       every technique on four scenes: what is good enough at which cost, and report.html"
	@echo "make view       a window on a built-in scene: techniques beside the ray-traced truth"
	@echo "make test       lint and the fast tests"
	@echo "make test-slow  the slow tests, benchmarks at small sizes; as OpenGL 4.1, and truths as on other processors"
	@echo "make test-all   both, with every value of what test-slow takes samples of, and all GL tests as OpenGL 4.1"
	@echo "make lint       format, ruff, mypy, the arrows between the packages, the ledger of lines"
	@echo "make docs       the documentation into build/docs/, a warning or a broken link being an error"
	@echo "make site       the documentation and the reports of results/published/, build/site/index.html"
	@echo "make published  measure what results/published/ lacks of benchmarks/published/: some minutes for all of it"
	@echo "make wheel      sdist and wheel into dist/, once the wheel has run in an empty environment"
	@echo "make setup      what the others do first: system packages and .venv"
	@echo "make clean      remove .venv, caches, and the folders that commands write into results/"
	@echo "With PYTHON=python3.12 behind it, each uses that Python, in an environment of its own."

setup:
	@$(setup) +test

demo:
	@$(setup)
	@$(bin)/python benchmarks/demo.py
	@echo; echo "What to try next:"
	@echo "$(bin)/shadowbench recommend stairs  # the cheapest technique for it, or for your .glb or .obj"
	@echo "$(bin)/shadowbench needs stairs      # the map size, the cascades and the bias that it needs"
	@echo "$(bin)/shadowbench run stairs -t shadow-map:bias=none -t shadow-map  # settings of your choice"
	@echo "$(bin)/shadowbench run -s everything -o results/everything  # every technique on every scene with hard light"

view:
	@$(setup) +viewer window
	$(bin)/shadowbench view sphere-and-torus -t shadow-map -t shadow-map:preset=course

test: lint
	$(bin)/pytest -q -m "not slow" $(workers) --junit-xml=build/test.xml

test-slow:
	@$(setup) +test $(for_slow)
	$(bin)/pytest -q -m "slow and not exhaustive" $(workers) --junit-xml=build/test-slow.xml
	$(bin)/pytest -q --benchmark-disable $(workers) benchmarks
	$(gl_4_1) $(bin)/pytest -q -m "not slow" $(workers) $(of_4_1)
	for isa in $(other_isa); do SHADOWBENCH_ISA=$$isa $(bin)/pytest -q -m "not slow" $(workers) $(of_isa) || exit; done

test-all: test
	@$(setup) +test $(for_slow)
	$(bin)/pytest -q -m slow $(workers)
	$(gl_4_1) $(bin)/pytest -q -m "not slow" $(workers) tests/gl tests/maps tests/techniques tests/laws

lint: setup
	$(bin)/ruff format --check
	$(bin)/ruff check
	$(bin)/mypy --num-workers 2 --no-error-summary
	$(bin)/lint-imports --no-cache
	$(bin)/python tools/ledger.py

docs:
	@$(setup) +docs
	$(bin)/sphinx-build -W --keep-going -n -q -d build/doctrees docs build/docs
	@echo "Documentation: build/docs/index.html"

published := $(patsubst results/published/%/,%,$(wildcard results/published/*/))
site:
	@$(setup) +docs
	$(bin)/sphinx-build -A "reports=$(published)" -W --keep-going -n -q -d build/site-doctrees docs build/site
	for name in $(published); do $(bin)/shadowbench report results/published/$$name -o build/site/$$name.html -q; done
	@echo "Site: build/site/index.html"

published:
	@$(setup)
	$(bin)/python tools/publish.py

wheel:
	@$(setup)
	rm -rf dist
	$(bin)/uv build --quiet --out-dir dist
	cd dist && UV_CONSTRAINT=../constraints.txt ../$(bin)/uv run --quiet --isolated --no-project --with ./*.whl shadowbench run stairs -t shadow-map --map-size 512 --view-size 64 --rounds 0

clean:
	rm -rf .venv .venv-* .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks build dist results/demo results/latest results/stress results/recommend results/recommend-check results/tune
	find shadowbench tests benchmarks examples tools -name __pycache__ -prune -exec rm -rf {} +
