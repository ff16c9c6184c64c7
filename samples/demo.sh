#!/usr/bin/env bash
# Solves a small session that comes with the project, then runs the whole loop without hardware:
# captures white paper and a fabric on the virtual rig, calibrates, solves, and compares with the truth.
# Usage: samples/demo.sh [FOLDER_OF_PROGRAMS [OUTPUT_FOLDER]]
set -euo pipefail
cd "$(dirname "$0")/.."
bin=${1:-build/release/bin}
out=${2:-out/demo}

echo "== Solve: eleven RAW frames of a denim twill, 160x120 pixels, that come with the project"
"$bin/sateen" solve samples/sessions/twill-small -o "$out/twill"
echo
echo "== Capture, calibrate, solve: the LED board's own firmware in a simulated chip, a camera on PTP/IP"
samples/capture.sh "$bin" "$out"
echo "Look at:"
echo "  $out/capture/contact-sheet.png       every frame that was captured, and the maps made of them"
echo "  $out/capture/maps/twill/overview.png frame, normals, albedo, error from truth"
echo "  $out/twill/overview.png              the same of the session that comes with the project"
