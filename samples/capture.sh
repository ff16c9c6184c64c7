#!/usr/bin/env bash
# Runs the whole loop without hardware: captures white paper and a fabric on the virtual rig (the LED
# board's own firmware, real serial and camera libraries), calibrates the lights with the paper, solves
# the fabric, and compares the maps with the truth that only the simulator knows.
# Usage: samples/capture.sh [FOLDER_OF_PROGRAMS [OUTPUT_FOLDER]]
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(realpath "${1:-build/release/bin}")
out=${2:-out/demo}
rm -rf "$out/capture"
mkdir -p "$out/capture"
cp samples/rigs/ring10-rough.json "$out/capture/rig.json"
cd "$out/capture"

# Renders what lies under the camera: one picture per light, and the truth.
for scene in white-flat twill-table; do
  "$bin/sateen" simulate "$OLDPWD/samples/scenes/$scene.json" --linear -o "table/$scene" >/dev/null
done

# Prints the command, then runs it. The virtual rig is the hardware: board, camera, object on the table.
on_rig() {
  local scene=$1
  shift
  echo "\$ $*"
  "$bin/sateen-virtual-rig" run --scene "table/$scene" -- "$bin/$@"
  echo
}
type_in() {
  echo "\$ $*"
  "$bin/$@"
  echo
}

echo "-- white paper lies on the table; lights are known by the ruler, 15 mm off"
on_rig white-flat sateen capture --rig rig.json -o scans/white --sheet
type_in sateen calibrate lights --sheet scans/white -o rig.json
echo "-- the fabric lies on the table"
on_rig twill-table sateen capture --rig rig.json -o scans/twill
type_in sateen session verify scans/twill
type_in sateen solve scans/twill --truth table/twill-table -o maps/twill
type_in sateen session overview scans/twill --maps maps/twill -o contact-sheet.png
