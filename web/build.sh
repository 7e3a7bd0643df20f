#!/usr/bin/env bash
# Builds the studio: web/target/studio.html, one file with the library as WebAssembly inside.
#
# Uses rustup's target wasm32-unknown-unknown where it is installed; otherwise Debian's packages rustc-web and
# rust-web-src, whose standard library it builds too, with the rust-lld of the toolchain of `cargo` as linker.
set -euo pipefail
cd "$(dirname "$0")"
sysroot=$(rustc --print sysroot)
triple=wasm32-unknown-unknown
if [ -d "$sysroot/lib/rustlib/$triple/lib" ]; then
    cargo build --release --locked --lib --target $triple
elif [ -d /usr/lib/rustlib/src/rust/library ] && [ -x /usr/bin/rustc ]; then
    linker=$(find "$sysroot/lib/rustlib" -path '*/bin/rust-lld' | head -n 1)
    [ -n "$linker" ] || { echo "build.sh: no rust-lld in $sysroot" >&2; exit 1; }
    RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker \
        cargo build --release --locked --lib --target $triple -Zbuild-std=std,panic_abort
else
    echo "build.sh: no $triple: run \`rustup target add $triple\`, or install Debian's rustc-web and rust-web-src" >&2
    exit 1
fi
python3 page/pack.py "target/$triple/release/onecycle_web.wasm" ../examples target/studio.html
