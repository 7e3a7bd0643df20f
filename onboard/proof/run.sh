#!/usr/bin/env bash
# Proves that onecycle-onboard needs no std, no heap and no libc: links src/lib.rs and start.c with nothing else,
# runs the program, and shows that the build fails as soon as the program uses a heap or std.
# Prints the memory that the program takes. On failure it prints one sentence and exits with status 1.
set -euo pipefail

# Limits in bytes: weights of the network, all code and tables, memory for one axis.
most_weights=14000
most_code=96000
most_memory=24000

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$here"
what="onboard proof"
source ../common.sh

build() { # LOG OPTION...
    cargo build --locked --target-dir "$target" "${@:2}" >"$1" 2>&1
}

link() { # PROFILE PROGRAM LOG
    gcc -nostdlib -static -O2 -Wall -Wextra -Werror -ffreestanding -ffunction-sections \
        -fno-stack-protector -mno-red-zone -Wl,--gc-sections start.c \
        "$target/$1/libonecycle_onboard_proof.a" -o "$2" >"$3" 2>&1
}

[[ $(uname -sm) == "Linux x86_64" ]] || fail "it runs on x86-64 Linux only, not on $(uname -sm)."
for tool in cargo gcc nm size; do
    command -v "$tool" >/dev/null || fail "the command $tool is missing."
done
same_libm

build "$scratch/log" --release || fail "it does not build without std." "$scratch/log"
link release "$scratch/proof" "$scratch/log" || fail "it does not link without libc." "$scratch/log"

nm "$scratch/proof" >"$scratch/symbols"
nm --undefined-only "$scratch/proof" >"$scratch/undefined"
[[ ! -s $scratch/undefined ]] || fail "the program has undefined symbols." "$scratch/undefined"
grep -q ' onecycle_proof$' "$scratch/symbols" || fail "the program does not contain the test."
if grep -E '[ _](malloc|calloc|realloc|free|posix_memalign|mmap|brk|sbrk)$|__r(ust|dl|g)_?.*alloc' \
    "$scratch/symbols" >"$scratch/heap"; then
    fail "the program has a heap." "$scratch/heap"
fi

status=0
said=$("$scratch/proof") || status=$?
[[ $status -eq 0 && ${said%%$'\n'*} == ok ]] ||
    fail "the program says '${said%%$'\n'*}' (status $status)."
echo "$said" >"$scratch/said"

bytes_of() { # NAME: as the program says
    awk -v name="$1" '$1 == name { print $2 }' "$scratch/said"
}

read -r text data bss < <(size "$scratch/proof" | awk 'NR == 2 { print $1, $2, $3 }')
weights=$(bytes_of weights) stack=$(bytes_of stack)
code=$((text + data)) memory=$((data + bss + stack))
within() { # WHAT BYTES MOST
    [[ $2 -gt 0 && $2 -le $3 ]] || fail "$1 take $2 bytes, more than the $3 that they may."
}
within "the weights" "$weights" "$most_weights"
within "code and tables" "$code" "$most_code"
within "data and stack" "$memory" "$most_memory"

# The proof must be able to fail, and for the intended reason.
if build "$scratch/log" --release --features use-alloc; then
    fail "it builds although it uses a heap: the check shows nothing."
fi
grep -q 'no global memory allocator found' "$scratch/log" ||
    fail "the control with a heap fails for another reason than its heap." "$scratch/log"
# Unoptimised: the references to libc are the same, and std takes long to optimise.
build "$scratch/log" --features use-std || fail "the control with std does not build." "$scratch/log"
if link debug "$scratch/control" "$scratch/log"; then
    fail "it links although it uses std: the check shows nothing."
fi
grep -q 'undefined reference to .malloc' "$scratch/log" ||
    fail "the control with std fails for another reason than libc." "$scratch/log"

# Stack frames on x86-64 are larger than on a Cortex-M, because pointers are; arrays are the same.
cat <<END
onboard proof: ok; no std, no heap, no libc; one relay test from rest to the gains of the controller
  weights          $weights bytes of $most_weights
  code and tables  $code bytes of $most_code, the pack's $(bytes_of pack) with its card's $(bytes_of card) in them
  memory           $memory bytes of $most_memory: data $data, bss $bss, stack $stack
    of the stack   windows $(bytes_of windows), pack's reader $(bytes_of pack_reader), relay $(bytes_of relay), \
cycles $(bytes_of cycles), past $(bytes_of past), classification $(bytes_of classification); one after the other \
classifier $(bytes_of classifier), refiner $(bytes_of refiner)
END
