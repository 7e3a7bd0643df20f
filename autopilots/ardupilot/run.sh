#!/usr/bin/env bash
# Builds ArduCopter with the onecycle backend, flies the chirp, the relay tests, AUTOTUNE, QuikTune, the scripts and the faults in
# simulation, and prints the tables.
# ARDUPILOT_DIR is a checkout of ArduPilot with its submodules; without it there is nothing to fly.
# PYTHON needs pymavlink, empy==3.3.4, pexpect, future, lxml and dronecan. ONECYCLE is the program. FLIGHTS: of the relay tests (10).
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
python=${PYTHON:-python3}
program=${ONECYCLE:-$root/target/release/onecycle}
flights=${FLIGHTS:-10}

if [[ ! -f ${ARDUPILOT_DIR:-}/ArduCopter/Copter.cpp ]]; then
    echo "ArduPilot: skipped; set ARDUPILOT_DIR to a checkout of ArduPilot with its submodules."
    exit
fi
"$python" -c "import pymavlink, em, pexpect, future, lxml" 2>/dev/null ||
    { echo "ArduPilot: $python lacks pymavlink, empy==3.3.4, pexpect, future or lxml." >&2; exit 1; }
[[ -x $program ]] || { echo "ArduPilot: $program is missing: cargo build --release, or set ONECYCLE." >&2; exit 1; }

cargo build --quiet --release --locked --manifest-path "$root/onboard/c/Cargo.toml"
library=${CARGO_TARGET_DIR:-$root/onboard/c/target}/release/libonecycle.a
"$python" "$here/apply.py" "$ARDUPILOT_DIR"
(
    cd "$ARDUPILOT_DIR"
    # The system's libm before the library, or the linker takes sqrt and others from the library's compiler-builtins. As -Wl,-lm:
    # g++ moves a plain -lm to the end.
    LDFLAGS="-Wl,-lm $library" "$python" ./waf configure --board sitl --no-submodule-update >/dev/null
    "$python" ./waf --targets bin/arducopter
)
out=$ARDUPILOT_DIR/build/sitl/onecycle
rm -rf "$out"
mkdir -p "$out"
# On a busy machine the simulator's gyro is late and the log has gaps: with real-time priority, where it is allowed.
realtime=()
! chrt -r 5 true 2>/dev/null || realtime=(chrt -r 5)
fly() {
    "${realtime[@]}" "$python" "$here/$1" --ardupilot "$ARDUPILOT_DIR" --out "$out/$2" "${@:3}"
}
fly chirp.py chirp --onecycle "$program" --axis roll
fly tune.py onecycle --method onecycle --flights "$flights"
fly tune.py autotune --method autotune
fly tune.py quiktune --method quiktune
fly altitude.py altitude --onecycle "$program"
fly faults.py faults
"${realtime[@]}" "$python" "$here/../live.py" ardupilot "$ARDUPILOT_DIR" "$out/live" --onecycle "$program"
