#!/usr/bin/env bash
# Tunes vehicle models of other simulators with the tuner for firmware, called through its C interface: JSBSim's
# F450, and with --rotorpy also rotorpy's quadrotors (minutes). Each axis is tuned without disturbances and with noise
# and a bias; the step that follows must overshoot and settle as predicted, otherwise the status is 1.
# PYTHON names an interpreter that has the packages of requirements.txt; without it they are installed into a
# temporary virtual environment.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$here/../../target}")/board
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo build --quiet --release --locked --manifest-path "$here/../../onboard/c/Cargo.toml" --target-dir "$target"
if [[ -z ${PYTHON:-} ]]; then
    requirements=requirements.txt
    [[ " $* " != *" --rotorpy "* ]] || requirements=requirements-rotorpy.txt
    PYTHON=$scratch/venv/bin/python
    # A pip of its own would take seconds to install; the one of the machine will do, where there is one.
    if python3 -m pip --python "$(command -v python3)" --version >/dev/null 2>&1; then
        python3 -m venv --without-pip "$scratch/venv"
        pip=(python3 -m pip --python "$PYTHON")
    else
        python3 -m venv "$scratch/venv"
        pip=("$PYTHON" -m pip)
    fi
    "${pip[@]}" install --quiet --disable-pip-version-check --no-compile -r "$here/$requirements"
fi
# JSBSim prints messages about its own aircraft files to both outputs.
status=0
"$PYTHON" "$here/run.py" "$target/release/libonecycle.a" "$@" >"$scratch/said" 2>"$scratch/errors" || status=$?
grep -a ' tuned in ' "$scratch/said" || true
[[ $status -eq 0 ]] || grep -a -v 'Failed to tie property' "$scratch/errors" | tail -n 20 >&2
exit "$status"
