#!/usr/bin/env bash
# Opens every page that onecycle writes in a real Chromium, as wide as a desk and as narrow as a phone, and looks at
# what a reader would: plots, margins, the theme, paper. Status 1 when something is not right.
#   --screenshots DIR     also saves what was seen
#   --picture FILE.png    also makes the README's picture
# PYTHON names an interpreter that has the packages of requirements.txt; without it they are installed into a
# virtual environment that is removed again. CHROMIUM names the browser [default: chromium].
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo build --quiet --release --locked --manifest-path "$root/Cargo.toml" --package onecycle-cli --target-dir "$target"
if [[ -z ${PYTHON:-} ]]; then
    python3 -m venv "$scratch/venv"
    PYTHON=$scratch/venv/bin/python
    "$PYTHON" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt"
fi
"$PYTHON" "$here/pages.py" "$target/release/onecycle" "$root/examples" "$scratch" "$@"
