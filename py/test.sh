#!/bin/sh
# Builds the package into an environment of its own and runs its tests. Needs Python 3.10 or later and the network.
# ONECYCLE and ONECYCLE_LAB name the programs whose results the package's are compared with; by default they are built here.
set -eu
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
export CARGO_TARGET_DIR="$target"
python3 -m venv "$target/py-venv"
python="$target/py-venv/bin/python"
"$python" -m pip install -q -r py/requirements-test.txt
if [ -z "${ONECYCLE:-}" ]; then
    cargo build -q --release --bin onecycle
    ONECYCLE="$target/release/onecycle"
fi
if [ -z "${ONECYCLE_LAB:-}" ]; then
    cargo build -q --release --manifest-path research/Cargo.toml --bin onecycle-lab
    ONECYCLE_LAB="$target/release/onecycle-lab"
fi
wheels="$target/py-wheels"
rm -rf "$wheels"
PYTHON="$python" py/wheel.sh py "$ONECYCLE" "$wheels" --release -q
PYTHON="$python" py/wheel.sh research/py "$ONECYCLE_LAB" "$wheels" --release -q
"$python" -m pip install -q --force-reinstall --no-deps "$wheels"/*.whl
ONECYCLE_WHEELS="$wheels" ONECYCLE="$ONECYCLE" ONECYCLE_LAB="$ONECYCLE_LAB" "$python" -m pytest -q -n auto --dist loadfile py/tests "$@"
