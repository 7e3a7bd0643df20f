#!/usr/bin/env bash
# Flies a simulated axis through the whole tuner on an emulated Cortex-M4F and compares every output and every number
# found with the host's, bit by bit. Prints the bytes and the instructions per tick that the tuner takes there.
# Instructions, not cycles: the emulator does not count cycles, and a load or a division takes more than one.
# When something differs or exceeds its limit it prints one sentence and exits with status 1. Where the machine lacks
# qemu-system-arm or a way to compile for the target it prints "skipped: ..." and exits with status 0.

# Where rustup has the target installed, its library is used. Otherwise Debian's packages of a Rust compiler and of its
# library's source are downloaded for this run; nothing is fetched with rustup.
set -euo pipefail

# Limits: what the tuner takes now and a little more, so that it does not grow. Beside them the goals: 96 kB of code
# and tables, 24 kB of memory; in a tick what leaves a tenth of a 1 kHz loop at 168 MHz to the rest of the board.
most_flash=115500 wanted_flash=96000
most_memory=38500 wanted_memory=24000
most_step_stack=1500
most_relay_tick=33000 wanted_relay_tick=150000
most_control_tick=3400 wanted_control_tick=150000
most_first_tick=90000 wanted_first_tick=150000
most_identify_tick=180000 wanted_identify_tick=150000

# The oldest compiler of Debian that builds this.
oldest=1.95
# An instruction takes 2^7 ns of the emulated time: src/bin/board.rs counts with a timer of 25 MHz.
shift=7

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
triple=thumbv7em-none-eabihf
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$here"
what="the tuner on an emulated Cortex-M4F"
source ../common.sh

skip() {
    echo "$what: skipped: $1"
    exit 0
}

# Whether the toolchain of the repository compiles for the target.
has_target() {
    command -v rustup >/dev/null || return 1
    rustup target list --installed 2>/dev/null | grep -qx "$triple"
}

# Debian's compiler and the source of its library: unpacked into $scratch/usr.
debian_compiler() {
    local tool version release llvm package
    for tool in apt-get apt-cache dpkg dpkg-deb; do
        command -v "$tool" >/dev/null || skip "rustup has no target $triple and the machine no $tool."
    done
    version=$(apt-cache madison rustc-web | awk '{ print $3 }' | sort --version-sort | tail -n 1)
    dpkg --compare-versions "${version:-0}" ge "$oldest" ||
        skip "there is no package rustc-web of $oldest or later."
    release=$(cut -d . -f 1,2 <<<"$version")
    llvm=$(apt-cache show "libstd-rust-web-$release=$version" |
        awk 'match($0, /libllvm[0-9]+/) { name = substr($0, RSTART, RLENGTH) } END { print name }')
    (cd "$scratch" && apt-get -qq download "rustc-web=$version" "rust-web-src=$version" \
        "libstd-rust-web-$release=$version" "libstd-rust-web-dev=$version" "$llvm") \
        >"$scratch/log" 2>&1 ||
        skip "the packages of rustc-web $version cannot be downloaded."
    for package in "$scratch"/*.deb; do
        # Of the sources, which are ten times as large as the rest, only the library.
        dpkg-deb --fsys-tarfile "$package" | tar -x -C "$scratch" --wildcards \
            './usr/bin/*' './usr/lib/*' './usr/src/*/library/*' 2>/dev/null || true
        rm "$package"
    done
    [[ $(with_compiler "$scratch/usr/bin/rustc" --version) == "rustc $release"* ]] ||
        fail "the compiler that was downloaded does not run."
}

with_compiler() { # COMMAND...
    LD_LIBRARY_PATH=$(echo "$scratch"/usr/lib/*-linux-gnu) "$@"
}

build() { # COMMAND...: before cargo's own arguments
    local upper
    upper=$(tr 'a-z-' 'A-Z_' <<<"$triple")
    env --unset RUSTFLAGS "CARGO_TARGET_${upper}_LINKER=$linker" \
        "CARGO_TARGET_${upper}_RUSTFLAGS=-C link-arg=-Tmps2-an386.ld" \
        "$@" --release --locked --target-dir "$target" --target "$triple" --bin board --features board \
        >"$scratch/log" 2>&1
}

build_board() {
    if has_target; then
        build cargo build
    else
        debian_compiler
        # A stable compiler builds the library of a target only with RUSTC_BOOTSTRAP.
        with_compiler build env RUSTC="$scratch/usr/bin/rustc" RUSTC_BOOTSTRAP=1 cargo build -Zbuild-std=core
    fi
}

emulate() { # PROGRAM LINES
    timeout 300 qemu-system-arm -M mps2-an386 -nographic -monitor none -serial none \
        -icount "shift=$shift,sleep=off,align=off" -chardev "file,id=said,path=$2" \
        -semihosting-config enable=on,target=native,chardev=said -kernel "$1" >"$scratch/log" 2>&1
}

# Lines that must be the same on both machines: all but instructions and bytes.
comparable() { # LINES
    awk '$1 == "tick" { print $1, $2, $3, $4, $5 } $1 == "found"' "$1"
}

within() { # WHAT NUMBER MOST
    [[ $2 -gt 0 && $2 -le $3 ]] || fail "$1: $2, more than the $3 that it may be."
}

command -v qemu-system-arm >/dev/null || skip "qemu-system-arm is not installed."
linker=$(find "$(rustc --print sysroot)" -type f -name rust-lld -print -quit)
[[ -n $linker ]] || skip "the Rust toolchain comes without rust-lld."
same_libm

cargo test --quiet --locked --lib --target-dir "$target" >"$scratch/log" 2>&1 ||
    fail "its own tests fail." "$scratch/log"
cargo build --quiet --release --locked --bin host --target-dir "$target" >"$scratch/log" 2>&1 ||
    fail "it does not build for the host." "$scratch/log"
"$target/release/host" >"$scratch/host" 2>"$scratch/words" || fail "the host finds no controller."
build_board || fail "it does not build for $triple." "$scratch/log"
status=0
emulate "$target/$triple/release/board" "$scratch/board" || status=$?
[[ $status -eq 0 && $(tail -n 1 "$scratch/board") == ok ]] ||
    fail "the board says '$(tail -n 1 "$scratch/board")' (status $status)." "$scratch/log"

comparable "$scratch/host" >"$scratch/there"
comparable "$scratch/board" >"$scratch/here"
cmp -s "$scratch/there" "$scratch/here" || {
    diff "$scratch/there" "$scratch/here" | head -n 6 >"$scratch/log" || true
    fail "the board's bits are not the host's:" "$scratch/log"
}
ticks=$(grep -c '^tick' "$scratch/here")
found=$(grep -c '^found' "$scratch/here")

number() { # NAME: found, in figures
    awk -v name="$1" -v factor="${2:-1}" '$1 == name { printf "%.4g", factor * $2 }' "$scratch/words"
}
bytes() { # NAME
    awk -v name="$1" '$1 == "bytes" && $2 == name { print $3 }' "$scratch/board"
}
# Instructions of the ticks that began and ended in these phases, sorted.
instructions() { # BEFORE AFTER
    awk -v before="$1" -v after="$2" '$1 == "tick" && $3 == before && $4 == after { print $6 }' \
        "$scratch/board" | sort -n
}
median() { awk '{ all[NR] = $1 } END { print all[int((NR + 1) / 2)] }'; }

# The tick that ends the collection already begins the signature. The ticks after it begin in identification: their
# instructions with the name of the stage.
first=$(instructions relay identify | tail -n 1)
awk '$1 == "tick" && $3 == "identify" { print $6, $7 }' "$scratch/board" | sort -n >"$scratch/slices"
read -r identify worst < <(tail -n 1 "$scratch/slices")
slices=$(wc -l <"$scratch/slices")
stages() {
    local stage
    for stage in classify refine judge gains design; do
        awk -v stage="$stage" '$2 == stage { all[++n] = $1 }
            END { printf "      %-9s %d ticks, %d, %d\n", stage, n, all[int((n + 1) / 2)], all[n] }' "$scratch/slices"
    done
}

flash=$(bytes flash) memory=$(($(bytes static) + $(bytes stack)))
relay=$(instructions relay relay | tail -n 1) control=$(instructions control control | tail -n 1)
within "bytes of flash" "$flash" "$most_flash"
within "bytes of stack of a step without the analysis" "$(bytes step)" "$most_step_stack"
within "bytes of memory" "$memory" "$most_memory"
within "instructions of the worst tick of the relay" "$relay" "$most_relay_tick"
within "instructions of the worst tick in control" "$control" "$most_control_tick"
within "instructions of the first tick of identification" "$first" "$most_first_tick"
within "instructions of the worst later tick of identification" "$identify" "$most_identify_tick"

cat <<END
the tuner on an emulated Cortex-M4F: ok; $ticks outputs and $found numbers found, the host's bits \
(checksum $(cksum "$scratch/here" | cut -d ' ' -f 1))
  found         K/T_body $(number k_over_t_body), T_prop $(number t_prop_s 1000) ms, tau $(number tau_s 1000) ms; \
Kp $(number kp), Kd $(number kd)
  flash         $flash bytes of $most_flash (wanted: $wanted_flash): code, tables, pack, the axis
  memory        $memory bytes of $most_memory (wanted: $wanted_memory): static $(bytes static), \
a tuner $(bytes tuner) of it; stack $(bytes stack), to make the tuner $(bytes beginning); \
of a step without the analysis $(bytes step) of $most_step_stack
  instructions  of a tick: median, worst
    safe        $(instructions idle idle | median), $(instructions idle idle | tail -n 1)
    relay       $(instructions relay relay | median), $relay of $most_relay_tick (wanted: $wanted_relay_tick)
    control     $(instructions control control | median), $control of $most_control_tick \
(wanted: $wanted_control_tick)
    signature   $first of $most_first_tick (wanted: $wanted_first_tick)
    identify    $(median <"$scratch/slices"), $identify of $most_identify_tick \
(wanted: $wanted_identify_tick) in $worst; $slices ticks
$(stages)
END
