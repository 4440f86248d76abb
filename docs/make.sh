#!/usr/bin/env bash
# Makes the README's pictures anew:  bash docs/make.sh CFODI [room|markers|report ...]
# Without names all three. The report is of a recording and takes Chromium (testing.md); those of the paper are made by
# `cfodi experiment`, docs/tune/ by docs/tune/make.sh. Takes 2 GB of disk until its end.
set -euo pipefail
cfodi=$(realpath "${1:?usage: bash docs/make.sh CFODI [room|markers|report ...]}")
shift
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tests=$here/../tests
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

room() {
  "$cfodi" demo --out "$work/demo"
  cp "$work/demo/map.png" "$here/room.png"
}

markers() {
  "$cfodi" simulate --out "$work/room.mcap" --scene room --seconds 40
  "$cfodi" replay "$work/room.mcap" --out "$work/result.mcap"
  bash "$tests/bags/python.sh" "$tests/bags/draw_markers.py" "$work/result.mcap" "$here/markers.png"
}

report() {
  bash "$tests/report/browser.sh"
  CFODI_BIN=$cfodi CFODI_SCREENSHOT=$here/report.png bash "$tests/bags/python.sh" -m pytest -c "$tests/bags/pytest.ini" \
    "$tests/report" -k draws_the_map_and_shows_it
}

if [ $# = 0 ]; then set -- room markers report; fi
for picture; do
  case $picture in
    room | markers | report) "$picture" ;;
    *) echo "no picture $picture: room, markers, report" >&2; exit 2 ;;
  esac
done
