#!/bin/sh
# Builds the wheel of a Python package with its program inside: py/wheel.sh PACKAGE PROGRAM FOLDER [maturin options], where PACKAGE is
# py or research/py and PROGRAM the compiled onecycle or onecycle-lab. PYTHON names an interpreter with maturin.
set -eu
package="$1" program="$2" folder="$3"
shift 3
name="$(basename "$program" .exe)"
# Where maturin looks for what is installed beside the module.
scripts="$package/$(sed -n 's/^module-name = "\(.*\)"$/\1/p' "$package/pyproject.toml").data/scripts"
trap 'rm -rf "$package"/*.data' EXIT
mkdir -p "$scripts"
cp "$program" "$scripts/"
strip "$scripts/$name" 2>/dev/null || true
"${PYTHON:-python3}" -m maturin build --manifest-path "$package/Cargo.toml" --out "$folder" "$@"
