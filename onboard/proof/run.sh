#!/usr/bin/env bash
# Proves that onecycle-onboard needs neither std, a heap nor libc: builds the program of src/lib.rs
# and start.c with nothing else, runs it, and shows that the same build fails as soon as it asks for
# a heap or for std. Prints the size of the program; one sentence and status 1 when the proof fails.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
target=$(realpath -m "${CARGO_TARGET_DIR:-$here/../../target}")/onboard-proof
library=$target/release/libonecycle_onboard_proof.a
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$here"

fail() {
    echo "onboard proof failed: $1" >&2
    if [[ -s ${2:-} ]]; then
        tail -n 20 "$2" >&2
    fi
    exit 1
}

build() { # FEATURES LOG
    rm -f "$library"
    cargo build --release --locked --target-dir "$target" --features "$1" >"$2" 2>&1
}

link() { # PROGRAM LOG
    gcc -nostdlib -static -O2 -Wall -Wextra -Werror -ffreestanding -ffunction-sections \
        -fno-stack-protector -Wl,--gc-sections start.c "$library" -o "$1" >"$2" 2>&1
}

libm() { # LOCK FILE: version and checksum
    grep -A 3 '^name = "libm"' "$1"
}

[[ $(uname -sm) == "Linux x86_64" ]] || fail "it runs on x86-64 Linux only, not on $(uname -sm)."
for tool in cargo gcc nm size; do
    command -v "$tool" >/dev/null || fail "the command $tool is missing."
done
[[ $(libm Cargo.lock) == "$(libm ../../Cargo.lock)" ]] ||
    fail "its Cargo.lock names another libm than the workspace's: run 'cargo update -p libm' in both."

build "" "$scratch/log" || fail "it does not build without std." "$scratch/log"
link "$scratch/proof" "$scratch/log" || fail "it does not link without libc." "$scratch/log"

nm "$scratch/proof" >"$scratch/symbols"
nm --undefined-only "$scratch/proof" >"$scratch/undefined"
[[ ! -s $scratch/undefined ]] || fail "the program has undefined symbols." "$scratch/undefined"
grep -q ' onecycle_proof$' "$scratch/symbols" || fail "the program has lost what it is to run."
if grep -E '[ _](malloc|calloc|realloc|free|posix_memalign|mmap|brk|sbrk)$|__r(ust|dl|g)_?.*alloc' \
    "$scratch/symbols" >"$scratch/heap"; then
    fail "the program has a heap." "$scratch/heap"
fi

status=0
said=$("$scratch/proof") || status=$?
[[ $status -eq 0 && $said == ok ]] || fail "the program says '$said' (status $status)."

# The proof must be able to fail, and for the reason meant.
if build use-alloc "$scratch/log"; then
    fail "it builds although it asks for a heap: the check shows nothing."
fi
grep -q 'no global memory allocator found' "$scratch/log" ||
    fail "the control with a heap fails for another reason than its heap." "$scratch/log"
build use-std "$scratch/log" || fail "the control with std does not build." "$scratch/log"
if link "$scratch/control" "$scratch/log"; then
    fail "it links although it asks for std: the check shows nothing."
fi
grep -q 'undefined reference to .malloc' "$scratch/log" ||
    fail "the control with std fails for another reason than libc." "$scratch/log"
rm -f "$library"

size "$scratch/proof" | awk 'NR == 2 {
    printf "onboard proof: ok; no std, no heap, no libc; text %d, data %d, bss %d bytes\n", $1, $2, $3
}'
