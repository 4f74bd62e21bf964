# make demo   the crane, driven with anti-sway off and on
# make test   style, all quick tests, a drive on real SocketCAN and in a browser: six minutes on two cores

# make test-all   everything: types, coverage, mutants, slow tests, all lanes, studies; some hours
# make test-PART  one part of it: tools/suite.py --list
# make quick   the tests that a change needs first
# make versions   lowest versions of every dependency; newest Python
# make mutation   does a test notice every small change of what decides whether a valve moves?
# make paper   the paper's figures and numbers next to ours, in out/paper
# make soak MINUTES=30   the closed loop on vcan with random faults; everything is counted
# make j1939 MINUTES=10   a drive with J1939; cantools and tshark read every frame
# make docs   the pages as a site that opens without a network: out/site/index.html
# make release   wheel, source distribution, Debian packages, container image, checksums: dist/
# make generate   value tables of the DBC files and the tables of docs/states.md, from the program
# make fuzz FUZZ_S=60   inputs of every kind that reach new code, for so many seconds each kind

.PHONY: demo test test-all quick versions drawing lint mutation paper fuzz soak j1939 bench bench-realtime docs deb release image lock clean

.venv/demo-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools
	@touch $@

.venv/test-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools,studio,cluster,metrics,dev,docs,lint
	@touch $@

.venv/fuzz-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools,dev,fuzz
	@touch $@

.venv/docs-ready: pyproject.toml tools/venv.sh
	tools/venv.sh docs
	@touch $@

demo: .venv/demo-ready
	.venv/bin/canshaper demo $(ARGS)

# Parts, what they run and in which order: tools/suite_parts.py.
test: .venv/test-ready
	@.venv/bin/python tools/suite.py

test-all: .venv/test-ready
	@.venv/bin/python tools/suite.py --all

test-%: .venv/test-ready
	@.venv/bin/python tools/suite.py $*

# What a change needs first: the rooms that differ from main, and the golden drives.
quick: .venv/test-ready
	.venv/bin/python tools/quick.py

# The daemon's rooms with the lowest versions of every dependency, and with the newest Python.
versions:
	tools/versions.sh

# docs/architecture.svg
drawing:
	python3 tools/architecture.py

lint: .venv/test-ready
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/lint-imports

mutation: .venv/test-ready
	.venv/bin/python tools/mutation.py

FUZZ_S ?= 60
fuzz: .venv/fuzz-ready
	set -e; for target in frames ports deployment dbc yaml; do \
		.venv/bin/python -m tests.fuzz $$target --seconds $(FUZZ_S); done

paper: .venv/test-ready
	.venv/bin/python -m studies.paper
	.venv/bin/python -m pytest -q studies

MINUTES ?= 30
soak: .venv/test-ready
	.venv/bin/python -m tests.lane --timeout 0 -- .venv/bin/python -m tests.soak --minutes $(MINUTES)

j1939: .venv/test-ready
	.venv/bin/python -m tests.lane --timeout 0 -- \
		.venv/bin/python -m tests.hil.j1939_drive --minutes $(MINUTES)

# Figures of the pages: measured again, what moved by more than 10 % shown. ARGS=--write writes them.
bench: .venv/test-ready
	.venv/bin/python benchmarks/figures.py $(ARGS)

bench-realtime: .venv/test-ready
	.venv/bin/python benchmarks/figures.py --slow $(ARGS)

# And the manual pages, out/man.
docs: .venv/docs-ready
	.venv/bin/python tools/site/build.py
	.venv/bin/python tools/man.py out/man

# dist/canshaper_VERSION_ARCH.deb: docs/service.md
deb: docs
	tools/deb.sh

# What is released, into dist/, with checksums: RELEASE="trixie/arm64" builds fewer Debian packages.
release: docs
	tools/release.sh $(RELEASE)

# dist/canshaper-VERSION.oci.tar
image: docs
	tools/image.sh

# Newer versions for the package: tools/deb/*requirements.txt
lock:
	tools/lock.sh

.PHONY: generate
generate: .venv/test-ready
	.venv/bin/python tools/generate.py

clean:
	rm -rf .venv out dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
