# make demo   the crane, driven with anti-sway off and on
# make test   lint, format, types and all tests, those on real SocketCAN included

# make quick   the tests that a change needs first
# make versions   lowest versions of every dependency; newest Python
# make coverage   every line and branch of what decides whether a valve moves (within make test)
# make mutation   does a test notice every small change of it? (mutation-core: within make test)
# make paper   the paper's figures and numbers next to ours, in out/paper
# make soak MINUTES=30   the closed loop on vcan with random faults; everything is counted
# make j1939 MINUTES=10   a drive with J1939; cantools and tshark read every frame
# make docs   the pages as a site that opens without a network: out/site/index.html
# make release   wheel, source distribution, Debian packages, container image, checksums: dist/
# make generate   value tables of the DBC files and the tables of docs/states.md, from the program
# make fuzz FUZZ_S=60   inputs of every kind that reach new code, for so many seconds each kind

.PHONY: demo test quick versions test-others test-drives test-long test-studies test-socketcan drawing test-machines test-faults test-service test-studio lint coverage mutation mutation-core paper fuzz soak j1939 bench bench-realtime docs deb release image lock clean

.venv/demo-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools
	@touch $@

.venv/test-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools,studio,cluster,dev,docs,lint
	@touch $@

.venv/fuzz-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools,dev,fuzz
	@touch $@

.venv/docs-ready: pyproject.toml tools/venv.sh
	tools/venv.sh docs
	@touch $@

demo: .venv/demo-ready
	.venv/bin/canshaper demo $(ARGS)

# SocketCAN first and alone: next to other work the loop of a daemon in the emulated machine stands
# still. Then the other parts, so many side by side, each printed when it ends.
JOBS ?= 2
PARTS = test-others coverage test-drives mutation-core test-long test-studio
test: lint
	$(MAKE) --no-print-directory test-socketcan
	$(MAKE) --no-print-directory --output-sync=target --jobs=$(JOBS) $(PARTS)

# Where time counts runs before what only computes.
NICE = nice -n 10
# Rooms of what decides whether a valve moves.
GATE = tests/codec tests/machine tests/shaping tests/inputs tests/guard tests/bus tests/protocols \
	tests/controller tests/daemon

# Every line and branch; `long` tests add none.
coverage: .venv/test-ready
	@mkdir -p out
	$(NICE) .venv/bin/python -m coverage run -m pytest -q -m "not long" $(GATE)
	.venv/bin/python -m coverage report

test-long: .venv/test-ready
	$(NICE) .venv/bin/python -m pytest -q -m long $(GATE)

# What drives simulated cranes.
DRIVES = tests/closed_loop tests/commissioning tests/design tests/faults
test-drives: .venv/test-ready
	$(NICE) .venv/bin/python -m pytest -q -m "not study" $(DRIVES)

test-others: .venv/test-ready
	$(NICE) .venv/bin/python -m pytest -q -m "not study" $(GATE:%=--ignore=%) $(DRIVES:%=--ignore=%)

# Every seed of noise, instant of a fault and combination of a sway sensor, prints the worst; the
# other 7500 drives with faults.
test-studies: .venv/test-ready
	$(NICE) .venv/bin/python -m pytest -q -s -m study tests/closed_loop tests/commissioning/sensor \
		tests/faults

test-socketcan: .venv/test-ready
	.venv/bin/python -m tests.lane.hil --steady tests/hil/test_socketcan.py tests/hil/test_daemon.py \
		tests/hil/test_closed_loop.py tests/hil/test_doctor.py

# What a change needs first: the rooms that differ from main, and the golden drives.
quick: .venv/test-ready
	.venv/bin/python tools/quick.py

# The daemon's rooms with the lowest versions of every dependency, and with the newest Python.
versions:
	tools/versions.sh

# docs/architecture.svg
drawing:
	python3 tools/architecture.py

# J1939, CANopen, CAN FD, a valve being measured, a gateway, a commissioning: foreign counterparts on real SocketCAN.
test-machines: .venv/test-ready
	.venv/bin/python -m tests.lane.hil --steady tests/hil/test_j1939.py tests/hil/test_j1939_read.py \
		tests/hil/test_canopen.py tests/hil/test_canopen_shipped.py tests/hil/test_canfd.py \
		tests/hil/test_calibrate.py tests/hil/test_gateway.py tests/hil/test_gateway_rules.py \
		tests/hil/test_commission.py

# Every fault of docs/safety.md on real SocketCAN: some ten minutes in an emulated machine.
test-faults: .venv/test-ready
	.venv/bin/python -m tests.lane.hil --steady tests/hil/test_faults.py tests/hil/test_process_faults.py \
		tests/hil/test_interface_faults.py

# The package and its units under a real systemd.
test-service: .venv/test-ready
	.venv/bin/python -m tests.lane.services

# The live page in a real browser: Debian's Chromium.
test-studio: .venv/test-ready
	CANSHAPER_BROWSER=1 .venv/bin/python -m pytest tests/studio/test_browser*.py

lint: .venv/test-ready
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/lint-imports

mutation: .venv/test-ready
	.venv/bin/python tools/mutation.py

mutation-core: .venv/test-ready
	$(NICE) .venv/bin/python tools/mutation.py core

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
