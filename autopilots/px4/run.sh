#!/usr/bin/env bash
# Builds PX4 with the module onecycle_tune, flies the comparison and the faults in PX4's own simulator (SIH), and prints the tables.
# PX4_DIR is a checkout of PX4 with its submodules; without it there is nothing to fly.
# PYTHON needs what PX4's build needs (Tools/setup/requirements.txt), pymavlink, pyulog and numpy. FLIGHTS: of each tuner (10).
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
python=${PYTHON:-python3}
flights=${FLIGHTS:-10}

if [[ ! -f ${PX4_DIR:-}/src/modules/mc_rate_control/MulticopterRateControl.cpp ]]; then
    echo "PX4: skipped; set PX4_DIR to a checkout of PX4 with its submodules."
    exit
fi
"$python" -c "import pymavlink, pyulog, numpy, kconfiglib" 2>/dev/null ||
    { echo "PX4: $python lacks pymavlink, pyulog, numpy or kconfiglib." >&2; exit 1; }

# Wind and faults for the simulator, off by default.
"$python" "$here/simulator.py" "$PX4_DIR"
cargo build --quiet --release --locked --manifest-path "$root/onboard/c/Cargo.toml"
library=${CARGO_TARGET_DIR:-$root/onboard/c/target}/release/libonecycle.a
build=$PX4_DIR/build/onecycle
cmake -S "$PX4_DIR" -B "$build" -G Ninja -DCONFIG=px4_sitl_default -DPYTHON_EXECUTABLE="$(command -v "$python")" \
    -DEXTERNAL_MODULES_LOCATION="$here" -DONECYCLE_LIBRARY="$library" -DONECYCLE_INCLUDE="$root/onboard/c" >/dev/null
ninja -C "$build" px4

# On a busy machine the simulated sensors fall silent, and PX4 lands: with real-time priority, where it is allowed.
realtime=()
! chrt -r 5 true 2>/dev/null || realtime=(chrt -r 5)

# Each flight has a network and a /tmp of its own, because PX4's ports and files are always the same.
alone() {
    "${realtime[@]}" unshare --net --mount --map-root-user bash -c 'ip link set lo up; mount -t tmpfs tmpfs /tmp; exec "$@"' alone "$python" "$@"
}

out=$build/flights
rm -rf "$out"
mkdir -p "$out"
for ((i = 1; i <= flights; i++)); do
    # Each flight waits for another time, so that it has other noise.
    alone "$here/fly.py" "$build" "$out/stock$i" stock --wait "$i" >"$out/stock$i.json"
    alone "$here/fly.py" "$build" "$out/autotune$i" autotune --wait "$i" >"$out/autotune$i.json"
    alone "$here/fly.py" "$build" "$out/onecycle$i" onecycle --wait "$i" >"$out/onecycle$i.json"
    alone "$here/fly.py" "$build" "$out/paper$i" onecycle --wait "$i" --set OC_STYLE=1 >"$out/paper$i.json"
    alone "$here/fly.py" "$build" "$out/calm$i" onecycle --wait "$i" --set OC_STYLE=2 >"$out/calm$i.json"
    # Wind of 5 m/s with gusts of 1.5 m/s: roll alone, without steps.
    alone "$here/fly.py" "$build" "$out/wind$i" onecycle --wait "$i" --set OC_AXES=1 --hovering SIH_WIND=5 --hovering SIH_GUST=1.5 \
        --no-steps >"$out/wind$i.json"
    echo "flight $i of $flights"
done
cd "$here"
"$python" compare.py "stock gains=$out/stock*.json" "PX4's autotune=$out/autotune*.json" \
    "onecycle, balanced=$out/onecycle*.json" "onecycle, fast=$out/paper*.json" "onecycle, calm=$out/calm*.json" \
    "onecycle, balanced, in wind=$out/wind*.json"
"$python" sih.py
alone "$here/faults.py" "$build" "$out/faults"
program=${ONECYCLE:-$root/target/release/onecycle}
if [[ -x $program ]]; then
    alone "$here/../live.py" px4 "$build" "$out/live" --onecycle "$program"
else
    echo "PX4: onecycle live skipped; $program is missing: cargo build --release, or set ONECYCLE."
fi
