# make demo: see it work. make test: check it as the continuous integration does. make bench: measure its speed.

PYTHON := .venv/bin/python
SHARE := not slow
UNITS := tests/tasks/algorithms tests/tasks/engine/test_parameters.py tests/storage
# Processes that share the tests, a file at a time.
JOBS := 2
# As in Glint's own workers: threads of libraries in each of these would wait for each other.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1

.PHONY: demo test test-unit test-all bench lint format setup requirements clean tests kernels

demo: .venv/ready
	.venv/bin/glint demo

# Tests run even where lint fails, and beside it: it keeps one processor busy.
test: .venv/ready
	$(MAKE) --no-print-directory --keep-going --jobs=2 lint tests

tests: .venv/ready kernels
	$(ONE_THREAD) $(PYTHON) -m pytest -q -m "$(SHARE)" --numprocesses=$(JOBS) --dist=loadfile --durations=10 --durations-min=5

# Compiled once: processes that begin together would each compile the same.
kernels: .venv/ready
	$(PYTHON) -c "from glint.tasks.warm_up import load_kernels; load_kernels()"

# The inner loop, in under a minute: algorithms and storage, without servers, whole captures and long tests.
test-unit: .venv/ready
	$(PYTHON) -m pytest -q -m "not slow and not server and not long" $(UNITS)

test-all: .venv/ready
	$(MAKE) --no-print-directory test SHARE=

# Ratios within one run, each beside its bar and the last release's; minutes on a quiet machine.
bench: .venv/ready
	$(PYTHON) -m tests.benchmarks.startup --repeat 1
	$(PYTHON) -m tests.benchmarks.pipeline_speed --repeat 1
	$(PYTHON) -m tests.benchmarks.orchestration --captures 8 --frames 500

lint: .venv/ready
	$(PYTHON) -m ruff check
	$(PYTHON) -m ruff format --check
	$(PYTHON) -m mypy

format: .venv/ready
	$(PYTHON) -m ruff check --fix
	$(PYTHON) -m ruff format

setup: .venv/ready

.venv/ready: requirements.txt pyproject.toml .python-version setup.sh
	./setup.sh

# Pin anew what pyproject.toml asks for; needs uv. Addresses of package indexes stay out of the file.
requirements:
	uv pip compile pyproject.toml --all-extras --python $(PYTHON) --generate-hashes --no-emit-index-url --no-header \
		-o requirements.txt

clean:
	rm -rf .venv build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
