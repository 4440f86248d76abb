#!/usr/bin/env bash
# Runs Python of the bag tests in a network namespace that holds only loopback, so that nothing reaches outside:
#   bash tests/bags/python.sh -m pytest tests/bags [-k NAME] [-s]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bash "$here/../namespaces.sh"
environment=$(bash "$here/env.sh")
# Neither a sourced ROS nor another environment may lend its packages or its parameters.
for name in $(compgen -e); do
  case $name in ROS_* | RMW_* | AMENT_* | COLCON_* | RCUTILS_* | PYTHONPATH | PYTHONHOME | LD_LIBRARY_PATH) unset "$name" ;; esac
done
export PATH="$environment/venv/bin:$PATH" PYTHONDONTWRITEBYTECODE=1
exec unshare -rn bash -c 'python "$0" && exec python "$@"' "$here/../ros/network.py" "$@"
