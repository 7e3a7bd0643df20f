#!/usr/bin/env bash
# Builds what is published, into dist/:
#   studio.html                     the studio: one page, for any browser
#   onecycle-VERSION-linux-MACHINE  the program with the studio inside, static where the musl target can be had
#   onecycle-VERSION-*.whl          the Python package with the program inside, for Python 3.10 and later (maturin from the registry)
#   onecycle-c-VERSION-MACHINE.tar.gz  library and header for firmware and programs in C
#   onecycle-VERSION.pack           the trained identifier, for boards and for --pack
#   onecycle-VERSION.cdx.json       what the program is made of (SBOM): every crate with version, licence and checksum, in CycloneDX
#   SHA256SUMS                      their checksums
# Needs Rust, a C linker, git, Python 3.10 with venv and, unless all crates are there, the network.
# It builds the last commit in a clone of its own, always at the same place, so that everybody gets the same bytes.
# ./release.sh --twice builds it twice and fails unless every file has the same bytes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
case "$*" in
"" | --twice) ;;
*) echo "release.sh: its only option is --twice" >&2; exit 2 ;;
esac
for command in cargo git python3 sha256sum strip tar; do
    command -v "$command" >/dev/null || { echo "release.sh: $command is missing" >&2; exit 1; }
done

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
place=/tmp/onecycle-$version
if [[ $PWD != "$place" ]]; then
    build() {
        mkdir "$place" || { echo "release.sh: is another release under way? If not, remove $place" >&2; exit 1; }
        trap 'rm -rf "$place"' EXIT
        git clone --quiet . "$place"
        env -u CARGO_TARGET_DIR "$place/release.sh"
        rm -rf dist
        mv "$place/dist" dist
        rm -rf "$place"
    }
    build
    if [[ "$*" == --twice ]]; then
        first=$(cat dist/SHA256SUMS)
        build
        diff <(echo "$first") dist/SHA256SUMS
        echo "both builds have the same bytes"
    fi
    exit
fi

target=$place/target
machine=$(uname -m)
mkdir dist

# No path of the user in a message, and no time but that of the commit.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
cargo_home=$(realpath -m "${CARGO_HOME:-$HOME/.cargo}")
export RUSTFLAGS="${RUSTFLAGS:-} --remap-path-prefix=$cargo_home=/cargo"

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
tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -cf - -C dist "$name" | gzip -n >"dist/$name.tar.gz"
rm -r "dist/${name:?}"

echo "== identifier"
cp onboard/packs/default.pack "dist/onecycle-$version.pack"

echo "== what the program is made of"
CYCLONEDX_VERSION=0.5.9
tools=$target/release-tools
[[ $("$tools/bin/cargo-cyclonedx" cyclonedx --version 2>/dev/null) == *" $CYCLONEDX_VERSION" ]] ||
    RUSTFLAGS='' cargo install --quiet --locked --debug --force --root "$tools" cargo-cyclonedx --version "$CYCLONEDX_VERSION"
"$tools/bin/cargo-cyclonedx" cyclonedx --quiet --manifest-path cli/Cargo.toml --features studio --format json --spec-version 1.5 --override-filename sbom
mv cli/sbom.json "dist/onecycle-$version.cdx.json"
find . -name sbom.json -not -path "./target/*" -delete

(cd dist && sha256sum -- * >SHA256SUMS)
ls -l dist
