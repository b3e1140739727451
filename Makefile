# Two commands need nothing but Python (3.10 or newer, with venv), git and make: `make demo` and `make test`.

PYTHON := .venv/bin/python
INSTALLED := .venv/installed
# one process a core; neighbours stay together, so that fixtures of a file are seldom made twice
PARALLEL := -n logical --dist worksteal
# what people wait for does not count the lines that it runs; CI runs the same tests and counts them
COVERAGE := $(if $(CI),--cov --cov-report=term:skip-covered --cov-fail-under=90)
# without files of bytecode each process would compile all tests again
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help .venv wheel test slow coverage browser-test ros-test docs pictures demo match examples figures bench-check clean

help:
	@echo "make demo      evaluate the sample datasets and write out/omni_ssl_2001/report.html, out/goal_four_legged/report.html"
	@echo "make test      ruff, mypy and pytest"
	@echo "make slow      the tests that take longer than a few seconds each"
	@echo "make coverage  make test as CI runs it: at least 90 % of the lines are run"
	@echo "make ros-test  the tests of the ROS 2 node with rclpy, in an environment of its own (.venv-ros), on loopback alone"
	@echo "make browser-test  open the live page and a report in a headless Chromium, which is installed first"
	@echo "make wheel     dist/robocup_vision-...-cp*.whl with all loops compiled, for robots like this machine"
	@echo "make docs      the documentation: out/docs/index.html"
	@echo "make pictures  draw the pictures of the guides anew, into docs/"
	@echo "make match     play a simulated match of 60 s, 2 against 2, and write out/match/report.html"
	@echo "make examples  run every program in examples/"
	@echo "make figures   render the tables of README.md and benchmarks/README.md from benchmarks/figures"
	@echo "make bench-check  run all benchmarks in quick size and compare their figures with the last ones"
	@echo "make clean     remove what the above have made"

.venv: $(INSTALLED)

$(INSTALLED): pyproject.toml
	@set -e; \
	for python in python3.13 python3.12 python3.11 python3.10 python3; do \
		if $$python -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then \
			found=$$python; \
			if $$python -c 'import ensurepip, venv' 2>/dev/null; then chosen=$$python; break; fi; \
		fi; \
	done; \
	if [ -z "$$found" ]; then echo "make: no Python 3.10 or newer was found" >&2; exit 1; fi; \
	if [ -z "$$chosen" ]; then echo "make: $$found cannot make virtual environments; install python3-venv (apt install python3-venv)" >&2; exit 1; fi; \
	if [ ! -x $(PYTHON) ]; then echo "making .venv with $$chosen"; $$chosen -m venv .venv; fi; \
	echo "installing into .venv"; \
	$(PYTHON) -m pip install -qq --disable-pip-version-check --editable '.[test]'; \
	touch $@

# loops are compiled before the tests, whose processes would compile the same ones side by side
test: $(INSTALLED)
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/lint-imports --no-cache
	@echo ".venv/bin/mypy, and robocup-vision warm-up beside it"; \
	.venv/bin/mypy & types=$$!; .venv/bin/robocup-vision warm-up --jobs 2 || exit 1; wait $$types
	$(PYTHON) -m pytest $(PARALLEL) -m "not slow" $(COVERAGE)

slow: $(INSTALLED)
	$(PYTHON) -m pytest $(PARALLEL) -m "slow and not browser"

coverage:
	$(MAKE) --no-print-directory test CI=true

# rclpy from wheels pins packages that the rest need not share. Without a network but loopback no other machine hears it
ros-test: $(INSTALLED)
	@$(MAKE) --no-print-directory .venv-ros/installed || echo "not run: rclpy cannot be installed here"
	@if [ ! -e .venv-ros/installed ]; then exit 0; fi; \
	if unshare --map-root-user --net true 2>/dev/null; then apart="unshare --map-root-user --net"; \
	else apart=""; echo "no network namespaces here: discovery is limited to this machine alone"; fi; \
	$$apart sh -c 'if [ -n "$$1" ]; then ip link set lo up; fi; exec env RMW_IMPLEMENTATION=rmw_fastrtps_cpp \
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST .venv-ros/bin/python -m pytest tests/ros -s' sh "$$apart"

.venv-ros/installed: $(INSTALLED)
	$(PYTHON) -m venv .venv-ros
	.venv-ros/bin/python -m pip install -qq --disable-pip-version-check --editable '.[ros,report]' pytest hypothesis evo \
		'ros-kilted-rclpy[fastrtps]' ros-sensor-msgs ros-nav-msgs ros-geometry-msgs ros-diagnostic-msgs
	touch $@

# npm's Chromium, or else Debian's; where neither can be had the test says "not run"
browser-test: $(INSTALLED)
	mkdir -p .venv/browser && cp tests/browser/package.json tests/browser/launch.mjs .venv/browser
	-cd .venv/browser && npm install --no-audit --no-fund --loglevel=error
	-node .venv/browser/launch.mjs || { apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium; }
	$(PYTHON) -m pytest tests/browser -rs

wheel: $(INSTALLED)
	rm -rf dist
	$(PYTHON) -m pip wheel -qq --disable-pip-version-check --no-deps --wheel-dir dist .
	.venv/bin/robocup-vision warm-up --wheel dist/*-py3-none-any.whl

docs: .venv/installed-docs
	$(PYTHON) -m sphinx -W --keep-going -q -b html docs out/docs
	@echo "out/docs/index.html"

.venv/installed-docs: $(INSTALLED)
	$(PYTHON) -m pip install -qq --disable-pip-version-check --editable '.[docs]'
	touch $@

pictures: $(INSTALLED)
	$(PYTHON) docs/pictures.py

demo: $(INSTALLED)
	.venv/bin/robocup-vision evaluate images/omni_ssl_2001 --out out/omni_ssl_2001
	.venv/bin/robocup-vision evaluate images/goal_four_legged --out out/goal_four_legged

match: $(INSTALLED)
	.venv/bin/robocup-vision match --seconds 60 --out out/match

examples: $(INSTALLED)
	@set -e; for program in examples/*.py; do \
		if [ -e "$$program" ]; then echo "== $$program"; $(PYTHON) "$$program"; fi; \
	done

figures: $(INSTALLED)
	$(PYTHON) -m benchmarks --render

bench-check: $(INSTALLED)
	$(PYTHON) -m benchmarks --quick --check --jobs 2

clean:
	rm -rf .venv .venv-ros out build dist .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
