#!/usr/bin/env bash
# Simulates sessions of a ChArUco board (10x7 squares of 15 mm, markers of 11 mm) through the distorting
# lens of samples/rigs/lens.json, to try the calibration of lens and pose: DIR/boards/view-1 to -16,
# tilted to all sides and up to the image's corners, and DIR/table.
# Usage: samples/boards.sh SATEEN DIR
set -euo pipefail
sateen=$(realpath "$1")
out=$2
samples=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$out/boards"
scene=$(mktemp --suffix=.json)
trap 'rm -f "$scene"' EXIT

for i in $(seq 0 15); do
  x=$(((i % 4) * 24 - 36))
  y=$((i / 4 * 18 - 27))
  sed -e "s|\"\.\./rigs/lens.json\"|\"$samples/rigs/lens.json\"|" \
      -e "s|\"azimuth_deg\": [-0-9.]*|\"azimuth_deg\": $((i * 100 % 360))|" \
      -e "s|\"turn_deg\": [-0-9.]*|\"turn_deg\": $((i * 25 % 360))|" \
      -e "s|\"offset_mm\": \[[^]]*\]|\"offset_mm\": [$x, $y]|" \
      "$samples/scenes/charuco-tilted.json" >"$scene"
  "$sateen" simulate "$scene" -o "$out/boards/view-$((i + 1))" >/dev/null
done
"$sateen" simulate "$samples/scenes/charuco-table.json" -o "$out/table" >/dev/null
echo "$out/boards and $out/table are there"
