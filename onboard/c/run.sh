#!/usr/bin/env bash
# Checks the tuner for firmware in C: builds the static library, compares onecycle.h with the source, compiles the
# examples with gcc, tunes a simulated axis with floating-point traps set, and compares every output with the tuner in Rust, bit by bit.
# Prints the memory of a tuner. On failure it prints one sentence and exits with status 1.
# `run.sh header` writes onecycle.h (with the version of cbindgen below).
set -euo pipefail

CBINDGEN_VERSION=0.29.2

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$here"
what="the C interface"
source ../common.sh
library=$target/release/libonecycle.a

header() { # FILE
    [[ $(cbindgen --version 2>/dev/null) == "cbindgen $CBINDGEN_VERSION" ]] ||
        fail "cbindgen is missing or of another version: cargo install --locked --debug cbindgen --version $CBINDGEN_VERSION"
    cbindgen --quiet --config cbindgen.toml --crate onecycle-c --output "$1" . 2>"$scratch/log" ||
        fail "cbindgen cannot read the source." "$scratch/log"
}

if [[ ${1:-} == header ]]; then
    header onecycle.h
    exit
fi

header "$scratch/onecycle.h"
same_libm
cmp -s onecycle.h "$scratch/onecycle.h" ||
    fail "onecycle.h differs from src/: run onboard/c/run.sh header."

cargo build --release --locked --target-dir "$target" >"$scratch/log" 2>&1 ||
    fail "it does not build." "$scratch/log"
for example in axis pid; do
    gcc -std=c99 -O2 -Wall -Wextra -Werror -pedantic -ffp-contract=off "examples/$example.c" traps.c "$library" -lm \
        -o "$scratch/$example" >"$scratch/log" 2>&1 || fail "examples/$example.c does not compile." "$scratch/log"
done
"$scratch/axis" trace >"$scratch/trace" 2>"$scratch/said" ||
    fail "the example finds no controller." "$scratch/said"
"$scratch/pid" 2>>"$scratch/said" || fail "the PID law by itself does not hold its mass." "$scratch/said"
# The same axis, tuned in Rust.
cargo run --quiet --release --locked --manifest-path ../cortex-m/Cargo.toml --target-dir "$target" \
    --bin host >"$scratch/lines" 2>"$scratch/log" || fail "the axis in Rust finds no controller." "$scratch/log"
awk '$1 == "tick" { print $5 }' "$scratch/lines" >"$scratch/there"
cmp -s "$scratch/trace" "$scratch/there" ||
    fail "C and Rust differ first at tick $(cmp "$scratch/trace" "$scratch/there" | sed 's/.*line //')."
ticks=$(wc -l <"$scratch/trace")
[[ $ticks -gt 0 ]] || fail "the example has written no output."

words=$(awk '$2 == "ONECYCLE_TUNER_WORDS" { print $3 }' onecycle.h)
pid_words=$(awk '$2 == "ONECYCLE_PID_WORDS" { print $3 }' onecycle.h)
cat <<END
C interface: ok; a simulated axis tuned from C, $ticks outputs, the same bits as in Rust
$(cat "$scratch/said")
  memory of a tuner   $((8 * words)) bytes, of a PID law $((8 * pid_words)) bytes
END
