# make demo   the crane, driven with anti-sway off and on
# make test   lint, format, types and all tests, those on real SocketCAN included

.PHONY: demo test lint bench clean

.venv/demo-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools
	@touch $@

.venv/test-ready: pyproject.toml tools/venv.sh
	tools/venv.sh tools,dev
	@touch $@

demo: .venv/demo-ready
	.venv/bin/canshaper demo

test: lint
	.venv/bin/python -m pytest
	.venv/bin/python -m tests.lane.hil

lint: .venv/test-ready
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy

bench: .venv/test-ready
	.venv/bin/python benchmarks/tick.py
	.venv/bin/python benchmarks/startup.py
	.venv/bin/python benchmarks/lockstep.py
	.venv/bin/python benchmarks/tune.py

clean:
	rm -rf .venv out dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
