#!/usr/bin/env bash
# Runs Python of the bag tests in a network namespace that holds only loopback, so that nothing reaches outside:
#   bash tests/bags/python.sh -m pytest tests/bags [-k NAME] [-s]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
environment=$(bash "$here/env.sh")
if ! refusal=$(unshare -rn true 2>&1); then
  echo "the bag tests need a network namespace and this machine refuses one: $refusal" >&2
  echo "(allow user namespaces: sysctl -w kernel.unprivileged_userns_clone=1, or run as root)" >&2
  exit 1
fi
# Neither a sourced ROS nor another environment may lend its packages or its parameters.
for name in $(compgen -e); do
  case $name in ROS_* | RMW_* | AMENT_* | COLCON_* | RCUTILS_* | PYTHONPATH | PYTHONHOME | LD_LIBRARY_PATH) unset "$name" ;; esac
done
export PATH="$environment/venv/bin:$PATH" PYTHONDONTWRITEBYTECODE=1
exec unshare -rn bash -c 'python "$0" && exec python "$@"' "$here/../ros/network.py" "$@"
