#!/usr/bin/env bash
# Counts the instructions of a tick of the tuner on x86-64 with valgrind's callgrind, over the flight of run.sh:
# the mean of its 20,000 ticks and the share of each function. The load of the machine does not change the numbers.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$here/../../target}")/board
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$here"

command -v valgrind >/dev/null || { echo "callgrind.sh needs valgrind." >&2 && exit 1; }
CARGO_PROFILE_RELEASE_DEBUG=line-tables-only CARGO_PROFILE_RELEASE_OPT_LEVEL=3 \
    cargo build --quiet --release --locked --bin host --target-dir "$target/callgrind"
valgrind --tool=callgrind --callgrind-out-file="$scratch/out" --toggle-collect='onecycle_flight::step*' \
    "$target/callgrind/release/host" >"$scratch/host" 2>"$scratch/log" ||
    { tail -n 20 "$scratch/log" >&2 && exit 1; }
ticks=$(grep -c '^tick' "$scratch/host")
all=$(awk '$1 == "summary:" || $1 == "totals:" { print $2 }' "$scratch/out" | tail -n 1)
echo "instructions on x86-64: $all in $ticks ticks, $((all / ticks)) a tick on average"
callgrind_annotate "$scratch/out" 2>/dev/null |
    awk '/^ *[0-9,]+ \(/ && !/PROGRAM TOTALS/ { print "  " $0; if (++n == 8) exit }'
