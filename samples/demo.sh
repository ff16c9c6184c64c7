#!/usr/bin/env bash
# Solves a small session that comes with the project, then renders a whole light stack with known
# answers, solves it, and compares the two.
# Usage: samples/demo.sh [PROGRAM [OUTPUT_FOLDER]]
set -euo pipefail
cd "$(dirname "$0")/.."
sateen=${1:-build/release/bin/sateen}
out=${2:-out/demo}

echo "== Solve: eleven RAW frames of a denim twill, 160x120 pixels, that come with the project"
"$sateen" solve samples/sessions/twill-small -o "$out/twill"
echo
echo "== Simulate: crossed waves under ten LEDs 600 mm away, as a 14-bit camera sees them"
"$sateen" simulate samples/scenes/ripple.json -o "$out/ripple/session"
echo
echo "== Solve: normal and albedo for every pixel, compared with the truth"
"$sateen" solve "$out/ripple/session" -o "$out/ripple/maps"
echo
echo "Look at:"
echo "  $out/twill/overview.png           frame, normals, albedo, error (at the yarns' edges)"
echo "  $out/ripple/session/overview.png  all frames, true normals, albedo, height"
echo "  $out/ripple/maps/overview.png     frame, normals, albedo, error"
