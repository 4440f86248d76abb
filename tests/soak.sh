#!/usr/bin/env bash
# Hours of driving, with a table at the end and status 1 where something is wrong:
#   bash tests/soak.sh live [--seconds 1800] [--rate 30] [--fault-every 20] [--max-voxels 8000] [--help]
#   bash tests/soak.sh accelerated [--hours 1] [--max-voxels 100000] [--help]
# `live`: the node (CFODI_BIN, else target/release/cfodi) beside a real ROS 2 driver that plays the cabinet recording
# (CFODI_DATA) or a made-up room in a loop, with faults. `accelerated`: the engine alone, on simulated drives, as fast as it goes.
set -euo pipefail
top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mode=${1:-live}
[ $# = 0 ] || shift
cd "$top"

live() {
  local rmem=/proc/sys/net/core/rmem_max wanted=33554432 before
  before=$(cat "$rmem")
  if [ "$before" -lt "$wanted" ]; then
    { echo "$wanted" > "$rmem"; } 2>/dev/null || { echo "sudo sysctl -w net.core.rmem_max=$wanted" >&2; exit 1; }
    # shellcheck disable=SC2064
    trap "echo $before > $rmem" EXIT
  fi
  bash tests/ros/python.sh tests/soak/live.py "$@"
}

case $mode in
  live) live "$@" ;;
  accelerated) cargo run --release --example soak -- "$@" ;;
  *) sed -n '2,6s/^# //p' "$0" >&2; exit 2 ;;
esac
