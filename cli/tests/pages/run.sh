#!/usr/bin/env bash
# Opens every page that onecycle and onecycle-lab write in a real Chromium, on a desktop and on a phone of 360 pixels, and checks plots,
# labels, margins, themes and print. Status 1 at the first fault.
#   --screenshots DIR     also saves screenshots
#   --picture FILE.png    also makes the README's picture
# ONECYCLE_LAB names the program onecycle-lab; by default it is built here. PYTHON names an interpreter with the packages of
# requirements.txt; by default they are installed into a temporary virtual environment. CHROMIUM names the browser
# [default: chromium].
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo build --quiet --release --locked --manifest-path "$root/Cargo.toml" --bin onecycle --target-dir "$target"
if [[ -z ${ONECYCLE_LAB:-} ]]; then
    cargo build --quiet --release --locked --manifest-path "$root/research/Cargo.toml" --bin onecycle-lab --target-dir "$target"
    ONECYCLE_LAB=$target/release/onecycle-lab
fi
if [[ -z ${PYTHON:-} ]]; then
    python3 -m venv "$scratch/venv"
    PYTHON=$scratch/venv/bin/python
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt"
fi
"$PYTHON" "$here/pages.py" "$target/release/onecycle" "$ONECYCLE_LAB" "$root/examples" "$scratch" "$@"
