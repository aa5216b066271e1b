# `make demo` and `make test` do all set-up on a fresh Debian or Ubuntu with a Rust toolchain.
SHELL := /bin/bash
CARGO ?= cargo
PYTHON := target/venv/bin/python

.PHONY: help setup venv demo test check fmt clippy unit doc deny python rig rig-full bench kills campaigns bless ratchet links docs fuzz deb clean

help: ## List these targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

setup: ## Install what building needs, if it is missing
	@scripts/setup build

venv: ## Python environment of the tests (reference MCAP readers, maturin, numpy)
	@scripts/setup python

demo: setup ## Record a virtual drive, replay it bit for bit, draw the report
	$(CARGO) build --profile demo --locked --bin atvrec
	target/demo/atvrec demo

test: setup check python rig ## Everything that CI runs

check: fmt clippy unit doc deny ratchet links ## Formatting, lints, tests, documentation, licences

fmt:
	$(CARGO) fmt --all --check
	$(CARGO) fmt --manifest-path fuzz/Cargo.toml --check

clippy:
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

unit: ## Rust tests of all crates
	$(CARGO) test --workspace --locked

doc:
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

ratchet: venv ## Listed words, long functions and constants outside Tuning may fall and not rise
	@scripts/ratchet

links: venv
	@scripts/check-links

docs: setup venv ## The pages of docs/ as a web site, target/book/index.html, with all links checked
	@scripts/setup tool mdbook --no-default-features --features search
	target/tools/bin/mdbook build docs
	@$(PYTHON) scripts/check-links target/book

deny:
	@if command -v cargo-deny >/dev/null; then cargo deny --locked check; else echo "deny: cargo-deny is not installed; licences and bans not checked (cargo install cargo-deny)"; fi

python: venv ## Reference readers on our logs, and the Python package's tests
	@scripts/test-python

rig: ## The bounded rig: SocketCAN, SJA1000 and UARTs in a real kernel
	@scripts/test-rig

rig-full: deb ## The whole rig: the service from the Debian package, twenty power cuts
	@scripts/test-rig full

deb: setup ## The Debian package, target/debian/atvrec_*.deb
	@scripts/deb

kills: venv ## 200 kills of the recorder under load (KILLS, SEED): what each costs, whether all logs open
	@scripts/kills

fuzz: ## Fuzz every decoder for half a minute each (RUNS=50000000 for the whole of it)
	@scripts/fuzz

campaigns: setup ## Seeded drives: do the intervals of calibrate and identify hold, how good is the sideslip of five cars, do random faults upset the estimator? Damage to a log: is all of the rest saved?
	$(CARGO) test --locked -p atvrec-estimator --test calibration --test identification --test campaign --test motion_faults --test car --test sensitivity -- --ignored --nocapture
	$(CARGO) test --locked -p atvrec --test cli campaign_of -- --ignored --nocapture
	$(CARGO) test --locked -p atvrec-store --test damage campaign_of -- --ignored --nocapture

bless: ## Write the generated documents again: docs/filter-spec.md
	$(CARGO) run --locked --quiet -p atvrec-estimator --example filter_spec

bench: setup ## Every figure that the README states, beside its peers
	@scripts/bench

clean:
	$(CARGO) clean
