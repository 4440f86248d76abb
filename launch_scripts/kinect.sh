#!/usr/bin/env bash
# Runs cfodi beside a Kinect driver that publishes clouds.
# usage: launch_scripts/kinect.sh [CLOUD_TOPIC] [more ROS arguments, as -p voxel_size:=0.05, which count before those here]
set -euo pipefail
script=$(readlink -f "${BASH_SOURCE[0]}")
here=$(cd "$(dirname "$script")/.." && pwd)
case ${1-} in -h | --help) exec sed -n 's/^# usage: /usage: /p' "$script" ;; esac
topic=/camera/depth/points
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then topic=$1; shift; fi
# Installed by cargo, built here, or installed by colcon, perhaps as links.
installed=lib/cfodi/cfodi
for cfodi in cfodi "$here/target/release/cfodi" "$here/../../$installed" "$(dirname "${BASH_SOURCE[0]}")/../../../$installed"; do
  if command -v "$cfodi" >/dev/null; then break; fi
done
if ! command -v "$cfodi" >/dev/null; then
  echo "$0: there is no cfodi: \`cargo install --path . --locked\` in its repository makes it" >&2
  exit 1
fi
# Of values the last counts, of rules for a name the first.
exec "$cfodi" run --ros-args --params-file "$here/config/kinect.yaml" "$@" --ros-args -r "points:=$topic"
