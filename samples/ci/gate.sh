#!/usr/bin/env bash
# Renders light stacks with known answers, solves each, and ends with status 3 where the mean angular
# error of one of them exceeds its gate. For continuous integration; light-stacks.yml runs it.
# Usage: samples/ci/gate.sh [PROGRAM [OUTPUT_FOLDER [GATES_FILE]]]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
sateen=${1:-build/release/bin/sateen}
out=${2:-out/ci}
gates=${3:-$here/gates.txt}

worst=0
while read -r scene degrees format; do
  case $scene in ''|'#'*) continue ;; esac
  name=$(basename "$scene" .json)-${format:-raw}
  echo "== $name: mean angular error at most $degrees degrees"
  linear=()
  if [ "${format:-raw}" = linear ]; then linear=(--linear); fi
  "$sateen" simulate "$here/../scenes/$scene" -o "$out/$name/session" "${linear[@]}"
  status=0
  "$sateen" solve "$out/$name/session" -o "$out/$name/maps" --fail-above "$degrees" || status=$?
  if [ "$status" -gt "$worst" ]; then worst=$status; fi
done <"$gates"

if [ "$worst" -ne 0 ]; then
  echo "samples/ci/gate.sh: at least one light stack failed (status $worst)" >&2
fi
exit "$worst"
