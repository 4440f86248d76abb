#!/usr/bin/env bash
# Builds, once, the Python environment of the bag tests: tools that write, convert and read bags, and pytest; or, with a folder
# as argument, that of the requirements.txt there. Prints the folder that holds it; then:  FOLDER/venv/bin/python ...
# Needs CPython 3.11 with venv, and flock. The first run takes about 15 seconds and 550 MB.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
of=$(cd "${1:-$here}" && pwd)
name=$(basename "$of")
die() { echo "tests/bags/env.sh: $*" >&2; exit 1; }

if [ -n "${CFODI_CACHE:-}" ]; then cache=$CFODI_CACHE
elif [ -n "${XDG_CACHE_HOME:-}" ]; then cache=$XDG_CACHE_HOME/cfodi
elif [ -n "${HOME:-}" ]; then cache=$HOME/.cache/cfodi
else die "HOME is not set, so there is no place for the Python environment: set CFODI_CACHE to a folder"
fi

python=$(bash "$here/../python311.sh")
command -v flock >/dev/null || die "needs flock, which is not here"

# A virtual environment bakes in its own path and its interpreter: it is keyed by what it is made from, and never moved.
key=$({ echo "$python"; cd "$here"; sha256sum env.sh; cd "$of"; sha256sum requirements.txt; } | sha256sum | cut -c 1-16)
mkdir -p "$cache"
cache=$(cd "$cache" && pwd)
dir=$cache/$name-$key

exec 9>"$cache/$name-$key.lock"
flock 9   # two runs at once: the second waits for the first one's environment
if [ -e "$dir/complete" ]; then echo "$dir"; exit; fi
echo "building the environment of tests/$name in $dir" >&2
rm -rf "$dir"   # half-built
mkdir -p "$dir"
"$python" -m venv "$dir/venv" >&2 || die "$python cannot make a virtual environment (Debian: apt-get install python3.11-venv)"
bash "$here/../retry.sh" "$dir/venv/bin/pip" install -q --disable-pip-version-check --no-deps -r "$of/requirements.txt" >&2
"$dir/venv/bin/pip" check --disable-pip-version-check >&2 || die "$of/requirements.txt is not complete"
touch "$dir/complete"
echo "$dir"
