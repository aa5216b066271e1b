# `make demo` and `make test` do all set-up on a fresh Debian or Ubuntu with a Rust toolchain.
SHELL := /bin/bash
CARGO ?= cargo
PYTHON := target/venv/bin/python

.PHONY: help setup venv demo test test-all check fmt clippy unit doc deny python browser screenshots thesis rig rig-full bench kills campaigns golden bless excerpts ratchet links pictures docs licences fuzz deb arm64 clean wheel windows

help: ## List these targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

setup: ## Install what building needs, if it is missing
	@scripts/setup build

venv: ## Python environment of the tests (reference MCAP readers, maturin, numpy)
	@scripts/setup python

demo: setup ## Record a virtual drive, replay it bit for bit, draw the report
	$(CARGO) build --profile demo --locked --bin atvrec
	target/demo/atvrec demo

TESTS := setup check python rig

test: export ATVREC_REQUIRE_DATA ?= 0
test: $(TESTS) ## All that needs nothing beside the project

test-all: export STALL_S ?= 60
test-all: $(TESTS) thesis browser ## The same with the recordings in ../shared, make thesis and the browser, as CI runs it

check: setup fmt clippy unit doc deny ratchet links ## Formatting, lints, tests, documentation, licences

fmt:
	$(CARGO) fmt --all --check
	$(CARGO) fmt --manifest-path fuzz/Cargo.toml --check

clippy:
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

unit: ## Rust tests of all crates
	$(CARGO) test --workspace --locked

doc:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

windows: setup ## Does the Python package compile for Windows? (a minute)
	@scripts/setup windows
	$(CARGO) check --locked --target x86_64-pc-windows-gnu -p atvrec-pybind

ratchet: venv ## Listed words, long functions and constants outside Tuning do not rise; packages stay within their budget
	@scripts/ratchet

links: venv
	@scripts/check-links

pictures: setup ## Draw the pictures of docs/rough-ground.md again
	scripts/ground-pictures

docs: setup venv ## The pages of docs/ as a web site, target/book/index.html, with all links checked
	@scripts/setup tool mdbook --no-default-features --features search
	target/tools/bin/mdbook build docs
	@$(PYTHON) scripts/check-links target/book

deny: export PATH := $(CURDIR)/target/tools/bin:$(PATH)
deny:
	@if command -v cargo-deny >/dev/null; then cargo deny --locked check; else echo "deny: cargo-deny is not installed, so that licences and bans are not checked (make licences installs it)"; fi

licences: setup ## Licences, sources and bans of all dependencies; installs cargo-deny into target/tools
	@scripts/setup tool cargo-deny
	@$(MAKE) --no-print-directory deny

python: venv ## Reference readers on our logs, and the Python package's tests
	@scripts/test-python

browser: setup ## The live page and the report in a real browser, and Foxglove's own client (STALL_S: for how long a client is stopped; test-all: 60)
	@scripts/test-browser

screenshots: setup ## Draw the pictures of the live page and of the report again (docs/*.png); look at them
	@scripts/test-browser screenshots

thesis: setup venv ## Figures and tables of the thesis through the measuring chain, with checks: target/thesis/thesis.html
	@scripts/test-python wheel
	@$(PYTHON) scripts/thesis

rig: ## The bounded rig: SocketCAN, SJA1000 and UARTs in a real kernel
	@scripts/test-rig

rig-full: deb ## The whole rig: the service from the Debian package, twenty power cuts
	@scripts/test-rig full

deb: setup ## The Debian packages: target/debian/atvrec_*.deb, and its debug information
	@scripts/deb

arm64: setup ## The Debian package for arm64 (target/debian-arm64), tests under emulation, and whether arm64 gives the same bits (an hour; not a part of test)
	@scripts/test-arm64

wheel: ## The wheel of the Python package for manylinux_2_28, tried in an environment of its own: target/wheels
	@scripts/wheel

kills: venv ## 200 kills of the recorder under load (KILLS, SEED): what each costs, whether all logs open
	@scripts/kills

fuzz: ## Fuzz every decoder for half a minute each (RUNS=50000000 for the whole of it)
	@scripts/fuzz

campaigns: setup windows ## Does Spark read datasets? Seeded drives: do the intervals of calibrate and identify hold, how good is the sideslip of five cars, do random faults upset the estimator? Damage to a log: is all of the rest saved? Forces of all truth runs, seeds 1 to 4 (target/forces.md, target/forces-compact.md, target/forces-second.md, target/forces-second-links.md)
	$(CARGO) test --locked -p atvrec-estimator --test suite -- --ignored --nocapture
	$(CARGO) test --locked -p atvrec --test suite campaign_of -- --ignored --nocapture
	$(CARGO) test --locked -p atvrec-store --test suite campaign_of -- --ignored --nocapture
	$(CARGO) test --locked -p atvrec-engine --lib campaign_of -- --ignored --nocapture
	$(CARGO) build --locked --release -p atvrec
	scripts/score-runs -o target/forces.md --compact target/forces-compact.md ../shared/data/truth/[bcdfh]_*.parquet ../shared/data/truth-rough/*.parquet
	scripts/score-runs --vehicle testdata/second-vehicle-plain.toml --sensors thesis-10bit -o target/forces-second.md ../shared/data/truth-second/[fr]*_a.parquet
	@scripts/setup spark
	@scripts/test-python wheel
	target/venv-spark/bin/python scripts/read-spark.py target/release/atvrec target/venv/bin/atvrec
	scripts/score-runs --vehicle second-vehicle --sensors second-vehicle-10bit,second-vehicle-16bit -o target/forces-second-links.md ../shared/data/truth-second/[fr]*_a.parquet

golden: ## Write the golden estimates again (testdata/golden); review the difference
	ATVREC_BLESS=1 $(CARGO) test --locked --quiet -p atvrec-estimator --test suite golden::

bless: golden ## Write the generated files again: golden estimates, docs/filter-spec.md, docs/*-file.*, crates/store/src/generated
	ATVREC_BLESS=1 $(CARGO) test --locked --quiet -p atvrec-model --lib file::reference
	ATVREC_BLESS=1 $(CARGO) test --locked --quiet -p atvrec-estimator --test suite filter_spec::
	ATVREC_BLESS=1 $(CARGO) test --locked --quiet -p atvrec-store --test suite generated::

excerpts: ## Cut the excerpts of truth runs (testdata/truth) again out of ../shared
	$(CARGO) run --locked -p atvrec-testkit --features truth --example make_excerpts

bench: setup ## Every figure that the README states, beside its peers
	@scripts/bench

clean:
	$(CARGO) clean
