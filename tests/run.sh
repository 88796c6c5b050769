#!/usr/bin/env bash
# Everything that must hold before a change lands: style, lints, documentation, tests of the
# core, the command line and the Python package, recordings under independent readers.
# One profile throughout, so that dependencies compile once.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
# Building the Python package needs an interpreter; everything else does not.
rust=(--release --workspace --exclude fabrig-py --all-features)

step() { printf '\n== %s\n' "$*"; }

step style
cargo fmt --all --check

step lints
cargo clippy "${rust[@]}" --all-targets -- -D warnings
cargo clippy --release -p fabrig-py -- -D warnings

step documentation
RUSTDOCFLAGS="-D warnings" cargo doc "${rust[@]}" --no-deps

step tests
cargo test "${rust[@]}"
# Tests build the examples too; this one writes what independent readers are given to read.
"$target/release/examples/record_synthetic" "$target/synthetic.mcap" 2 24

step python
python3 -m venv "$target/venv"
python="$target/venv/bin/python"
"$python" -m pip install -q --disable-pip-version-check -r tests/requirements.txt
rm -rf "$target/wheels"
"$python" -m maturin build --release -m crates/fabrig-py/Cargo.toml --out "$target/wheels"
"$python" -m pip install -q --disable-pip-version-check --force-reinstall --no-deps "$target"/wheels/*.whl
# Khronos' glTF validator is a package of Node's, which requirements.txt brings.
"$target/venv/bin/npm" install --silent --no-fund --prefix "$target/gltf-validator" gltf-validator@2.0.0-dev.3.10
export FABRIG_GLTF_VALIDATOR FABRIG_RECORDING FABRIG_WHEEL
FABRIG_RECORDING=$(realpath "$target/synthetic.mcap")
FABRIG_WHEEL=$(realpath "$target"/wheels/*.whl)
FABRIG_GLTF_VALIDATOR=$(realpath "$target/gltf-validator")
"$python" -W error -m pdoc -o "$target/python-docs" fabrig
"$python" -m pytest -q crates/fabrig-py/tests tests
"$python" benches/peers/run.py --smoke --json "$target/peers.json"
