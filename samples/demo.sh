#!/usr/bin/env bash
# Renders a small light stack with known answers, solves it, and compares the two.
# Usage: samples/demo.sh [PROGRAM [OUTPUT_FOLDER]]
set -euo pipefail
cd "$(dirname "$0")/.."
sateen=${1:-build/release/bin/sateen}
out=${2:-out/demo}

echo "== Render: a rippled surface under ten LEDs 600 mm away, with its true normals and albedo"
"$sateen" simulate samples/scenes/ripple.json -o "$out/session"
echo
echo "== Solve: normal and albedo for every pixel, compared with the truth"
"$sateen" solve "$out/session" -o "$out/maps"
echo
echo "Pictures: $out/maps/overview.png (frame, normals, albedo, error), normal.png beside it"
