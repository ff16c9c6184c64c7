#!/usr/bin/env bash
# Turns on each light of the sample ring in turn, on the virtual rig: no hardware. Then prints which
# lights were on and for how long, as the pins of the simulated board show it.
# Usage: samples/lights.sh [FOLDER_OF_PROGRAMS]
set -euo pipefail
cd "$(dirname "$0")/.."
bin=${1:-build/release/bin}
events=$(mktemp)
trap 'rm -f "$events"' EXIT

"$bin/sateen-virtual-rig" run --rig samples/rigs/ring10.json --events "$events" -- bash -c "
  for light in 0 1 2 3 4 5 6 7 8 9; do
    '$bin/sateen' light led-\$light --rig samples/rigs/ring10.json --level 50% --for 100ms
  done
  '$bin/sateen' light status"
grep '"event":"light"' "$events"
