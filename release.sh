#!/usr/bin/env bash
# Builds what is published, into dist/:
#   studio.html                     the studio: one page, for any browser
#   onecycle-VERSION-linux-MACHINE  the program with the studio inside, static where the musl target can be had
#   onecycle-VERSION-*.whl          the Python package with the program inside, for Python 3.10 and later (maturin from the registry)
#   onecycle-c-VERSION-MACHINE.tar.gz  library and header for firmware and programs in C
#   SHA256SUMS                      their checksums
# Needs Rust, a C linker, Python 3.10 with venv and, unless all crates are there, the network. No arguments.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
[[ $# -eq 0 ]] || { echo "release.sh: it has no options" >&2; exit 2; }
for command in cargo python3 sha256sum strip tar; do
    command -v "$command" >/dev/null || { echo "release.sh: $command is missing" >&2; exit 1; }
done

target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
machine=$(uname -m)
rm -rf dist
mkdir dist

# Whether the toolchain has this target; rustup may fetch it.
has_target() {
    [[ -d $(rustc --print sysroot)/lib/rustlib/$1/lib ]] || rustup target add "$1" >/dev/null 2>&1
}

echo "== studio"
has_target wasm32-unknown-unknown || true # build.sh knows another way
web/build.sh
cp web/target/studio.html dist/

echo "== program"
triple=$machine-unknown-linux-musl
if ! has_target "$triple"; then
    triple=$machine-unknown-linux-gnu
    echo "release.sh: no musl target: the program needs the glibc of this system, or a later one" >&2
fi
cargo build --release --locked -p onecycle-cli --features studio --target "$triple" --target-dir "$target"
program=dist/onecycle-$version-linux-$machine
cp "$target/$triple/release/onecycle" "$program"
strip "$program"
"$program" identify examples/simulated_hover.csv >/dev/null

echo "== Python package"
python3 -m venv "$target/release-venv"
python=$target/release-venv/bin/python
"$python" -m pip install --quiet --disable-pip-version-check 'maturin>=1.9,<2'
cp "$program" "$target/onecycle"
CARGO_TARGET_DIR=$target PYTHON=$python py/wheel.sh py "$target/onecycle" dist --release --locked
"$python" -m pip install --quiet --disable-pip-version-check --force-reinstall dist/*.whl
(cd / && "$python" -c 'import onecycle; onecycle.Model("foptd", k=2.0, t_body_s=1.5, tau_s=0.3)')
"$python" -m onecycle identify examples/simulated_hover.csv >/dev/null

echo "== C library"
cargo build --release --locked --manifest-path onboard/c/Cargo.toml --target-dir "$target"
name=onecycle-c-$version-$machine
mkdir "dist/$name"
cp "$target/release/libonecycle.a" onboard/c/onecycle.h onboard/c/examples/*.c LICENSE-* "dist/$name/"
tar -czf "dist/$name.tar.gz" -C dist "$name"
rm -r "dist/${name:?}"

(cd dist && sha256sum -- * >SHA256SUMS)
ls -l dist
