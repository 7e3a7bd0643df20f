# Sourced by the scripts in the folders beside it. `what` names the check, `here` is the script's folder.

# One target folder for all of them: they compile onecycle-onboard with the same options, so it is compiled once.
target=$(realpath -m "${CARGO_TARGET_DIR:-$here/../../target}")/board

fail() { # SENTENCE [LOG]
    echo "$what failed: $1" >&2
    if [[ -s ${2:-} ]]; then
        tail -n 20 "$2" >&2
    fi
    exit 1
}

# The lock file here and that of the workspace must name the same libm, by version and checksum.
same_libm() {
    [[ $(grep -A 3 '^name = "libm"' Cargo.lock) == "$(grep -A 3 '^name = "libm"' ../../Cargo.lock)" ]] ||
        fail "its Cargo.lock names another libm than the workspace's: run 'cargo update -p libm' in both."
}
