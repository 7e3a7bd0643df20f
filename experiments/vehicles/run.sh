#!/usr/bin/env bash
# Tunes vehicles that others have written, the tuner for firmware in the loop through its C interface: JSBSim's
# F450, and with --rotorpy also rotorpy's quadrotors (minutes). Each axis clean and with noise and a bias: the
# step that follows must overshoot and settle as predicted. Status 1 when one does not.
# PYTHON names an interpreter that has the packages of requirements.txt; without it they are installed into a
# virtual environment that is removed again.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$here/../../target}")/c
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo build --quiet --release --locked --manifest-path "$here/../../onboard/c/Cargo.toml" --target-dir "$target"
if [[ -z ${PYTHON:-} ]]; then
    python3 -m venv "$scratch/venv"
    PYTHON=$scratch/venv/bin/python
    requirements=requirements.txt
    [[ " $* " != *" --rotorpy "* ]] || requirements=requirements-rotorpy.txt
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r "$here/$requirements"
fi
# JSBSim prints what it thinks of its own aircraft's files, to both outputs.
status=0
"$PYTHON" "$here/run.py" "$target/release/libonecycle.a" "$@" >"$scratch/said" 2>"$scratch/errors" || status=$?
grep -a ' tuned in ' "$scratch/said" || true
[[ $status -eq 0 ]] || grep -a -v 'Failed to tie property' "$scratch/errors" | tail -n 20 >&2
exit "$status"
