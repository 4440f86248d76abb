#!/usr/bin/env bash
# Runs Python of the ROS environment in a network namespace of its own, so that tests cannot talk to anything else on the
# machine or outside:  bash tests/ros/python.sh -m pytest tests/ros [-k NAME] [-s]
# Several at once, which only tests that are not marked `alone` bear:  ... -m "not alone" --numprocesses 8 --dist loadscope
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export ROS_LOG_DIR=${ROS_LOG_DIR:-${TMPDIR:-/tmp}/cfodi-ros-log}
if [ -z "${HOME:-}" ]; then   # rclpy does not start without it
  HOME=$(getent passwd "$(id -u)" | cut -d : -f 6)
  export HOME="${HOME:-/tmp}"
  echo "HOME is not set: using $HOME" >&2
fi
bash "$here/../namespaces.sh"
environment=$(bash "$here/env.sh")
# shellcheck source=/dev/null
source "$environment/env.sh"
export PYTHONDONTWRITEBYTECODE=1
exec unshare -rn bash -c 'python "$0" && exec python "$@"' "$here/network.py" "$@"
