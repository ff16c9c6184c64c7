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
count=0
fail() {
  if [ "$1" -gt "$worst" ]; then worst=$1; fi
}
# Also a last line without its end, and the line ends of Windows.
while read -r scene degrees format || [ -n "$scene" ]; do
  case $scene in ''|'#'*) continue ;; esac
  format=${format:-raw}
  linear=()
  case $format in
    raw) ;;
    linear) linear=(--linear) ;;
    *) echo "samples/ci/gate.sh: $scene: frames are '$format'; need raw or linear" >&2; exit 2 ;;
  esac
  count=$((count + 1))
  name=$(basename "$scene" .json)-$format
  echo "== $name: mean angular error at most $degrees degrees"
  status=0
  "$sateen" simulate "$here/../scenes/$scene" -o "$out/$name/session" "${linear[@]}" || status=$?
  if [ "$status" -eq 0 ]; then
    "$sateen" solve "$out/$name/session" -o "$out/$name/maps" --fail-above "$degrees" || status=$?
  fi
  fail "$status"
done < <(tr -d '\r' <"$gates")

if [ "$count" -eq 0 ]; then
  echo "samples/ci/gate.sh: $gates names no light stack; need lines 'scene degrees [raw|linear]'" >&2
  exit 2
fi
if [ "$worst" -ne 0 ]; then
  echo "samples/ci/gate.sh: at least one light stack failed (status $worst)" >&2
fi
exit "$worst"
