#!/usr/bin/env bash
# Runs cfodi beside a driver that publishes depth images, each with its camera info beside it.
# usage: launch_scripts/depth.sh [IMAGE_TOPIC] [more ROS arguments, as -p voxel_size:=0.05, which count before those here]
set -euo pipefail
script=$(readlink -f "${BASH_SOURCE[0]}")
here=$(cd "$(dirname "$script")/.." && pwd)
case ${1-} in -h | --help) exec sed -n 's/^# usage: /usage: /p' "$script" ;; esac
topic=/depth/image_raw
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
case $topic in
  */*) info=${topic%/*}/camera_info ;;
  *) info=camera_info ;;
esac
# Of values the last counts, of rules for a name the first.
exec "$cfodi" run --ros-args --params-file "$here/config/kinect.yaml" "$@" \
  --ros-args -r "depth/image:=$topic" -r "depth/camera_info:=$info"
