#!/usr/bin/env bash
# Builds the studio and the program, and tests the studio in a real Chromium; the options are those of tests/studio.py.
# PYTHON names an interpreter with the packages of ../cli/tests/pages/requirements.txt; by default they are installed into a
# temporary virtual environment. CHROMIUM names the browser [default: chromium].
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/.." && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

"$here/build.sh"
cargo build --quiet --release --locked --manifest-path "$root/Cargo.toml" --bin onecycle --target-dir "$target"
if [[ -z ${PYTHON:-} ]]; then
    python3 -m venv "$scratch/venv"
    PYTHON=$scratch/venv/bin/python
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r "$root/cli/tests/pages/requirements.txt"
fi
CHROMIUM=$(command -v "${CHROMIUM:-chromium}") "$PYTHON" "$here/tests/studio.py" \
    "$here/target/studio.html" "$target/release/onecycle" "$root" "$scratch" "$@"
