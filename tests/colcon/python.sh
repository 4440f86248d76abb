#!/usr/bin/env bash
# Runs Python of the ROS environment in a network namespace of its own, with the environment of a colcon in CFODI_COLCON:
#   bash tests/colcon/python.sh -m pytest tests/colcon
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
CFODI_COLCON=$(bash "$here/../bags/env.sh" "$here")/venv
export CFODI_COLCON
exec bash "$here/../ros/python.sh" "$@"
