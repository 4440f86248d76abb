#!/usr/bin/env bash
# Installs what else clusters point clouds, runs it in turn with ours on the same scans, and prints a table of ratios:
#   bash benches/peers/run.sh [--quick]      (quick: one round, every 8th scan for the peers, a second a stream method)
#
# The scans: tum_fr3_cabinet58 in CFODI_DATA (default: ../shared/data beside the repository).
# CFODI_CACHE  what is made here goes into its folder `peers`, 1.1 GB (default: the build's folder, target)
# CFODI_CORE   the core that everything is pinned to (default: the last one that this process may use)
# CFODI_LIMIT  the command that measures ours, instead of `cargo bench --bench limit -- --cabinet`. It prints lines
#              `ours <voxel size in m> <cloud|unorganized|depth> median_ms <number>` and `cold_read median_ms <number>`
#
# Needs Debian 12, a Rust toolchain and Python 3.11; installs packages as root or by sudo. A peer that cannot be had is
# named with the reason, and the others are measured.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
top=$(cd "$here/../.." && pwd)
die() { echo "benches/peers/run.sh: $*" >&2; exit 1; }

rounds=3 step=1 repeats=5 seconds=5 quick=
case "${1:-}" in
  "") ;;
  --quick) quick=yes rounds=1 step=8 repeats=1 seconds=1 ;;
  *) die "unknown argument $1: nothing or --quick" ;;
esac

CFODI_DATA=$(realpath -m "${CFODI_DATA:-$top/../shared/data}")
export CFODI_DATA PYTHONDONTWRITEBYTECODE=1
recording=$CFODI_DATA/tum_fr3_cabinet58
[ -f "$recording/poses.csv" ] || die "no recording in $recording: set CFODI_DATA"
cache=$(realpath -m "${CFODI_CACHE:-${CARGO_TARGET_DIR:-$top/target}}")/peers
core=${CFODI_CORE:-$(taskset -cp $$ | sed 's/.*[:,-] *//')}
bench=(cargo bench --no-default-features --features sim --bench limit)
limit=${CFODI_LIMIT:-${bench[*]} -- --cabinet}
mkdir -p "$cache"
results=$cache/results log=$cache/log
cd "$top"

exec 9>"$cache/lock"
flock -n 9 || die "another run is using $cache"
: > "$results"
missing() { echo "missing $1: ${2:0:200}" | tee -a "$results" >&2; }
note() { echo "note $*" >> "$results"; }
version() { echo "version $*" >> "$results"; }

bin='' python=''
# shellcheck source=benches/peers/install.sh
source "$here/install.sh"

pinned() { taskset -c "$core" env OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$@"; }

ours() {
  pinned bash -c "$limit" > "$log.ours" 2> "$log" || { tail -n 20 "$log" >&2; die "failed: $limit"; }
  grep -E '^(ours|cold_read) ' "$log.ours" >> "$results" || die "printed no line \`ours ...\`: $limit"
}

# A program that could not be made has said why.
peer() {  # NAME PROGRAM ARGUMENT...
  local name=$1 status=0
  shift
  [ -x "$1" ] || return 0
  pinned timeout 600 "$@" >> "$results" 2> "$log" || status=$?
  [ "$status" = 0 ] || missing "$name" "ended with status $status: $(tail -n 1 "$log")"
}

scans_file() {
  local key
  key=$(cat "$here/scans.py" "$recording/poses.csv" "$recording/camera.json" | sha256sum | cut -c 1-16)
  scans=$cache/scans-$key.bin
  [ -e "$scans" ] || "$python" "$here/scans.py" "$recording" "$scans" || die "the scans could not be read"
}

versions() {
  local name
  version "processor: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), core $core"
  version "ours $(sed -n 's/^version = //p' Cargo.toml | head -n 1 | tr -d '"'), $(rustc --version 2>/dev/null)"
  version "$(g++ --version 2>/dev/null | head -n 1), -O3 -march=native"
  for name in libpcl-common1.13 liboctomap-dev; do
    version "$name $(dpkg-query -W -f '${Version}' "$name" 2>/dev/null || echo 'not installed')"
  done
  version "$("$python" --version)"
  for name in open3d-cpu river capymoa incdbscan; do version "$(grep "^$name==" "$here/requirements.txt")"; done
  version "$(java -version 2>&1 | head -n 1)"
}

environment
libraries
programs
scans_file
[ -n "${CFODI_LIMIT:-}" ] || "${bench[@]}" --no-run >&2 || die "ours does not build"

for ((round = 1; round <= rounds; round++)); do
  echo "round $round of $rounds" >&2
  ours
  peer PCL "$bin/pcl" "$scans" "$step" "$repeats"
  ours
  peer OctoMap "$bin/octomap" "$scans" "$step"
  ours
  peer Open3D "$python" "$here/open3d_scans.py" "$scans" "$step"
done
ours
echo "stream methods" >&2
peer "stream methods" "$python" "$here/streams.py" "$scans" "$seconds"

[ -z "$quick" ] || note "a quick run: one round, every 8th scan for the peers, a second for each stream method"
note "times are medians over scans, then over rounds (here $rounds); a ratio is the median of those to the runs" \
  "of ours, cloud, right before and after"
note "ours begins with a message's bytes and ends with the clusters of the whole map; the peers begin with valid" \
  "points in memory, and neither bringing them into the fixed frame nor making PCL's map is in their time"
note "Bonxai is left out: neither Debian nor PyPI has it (PyPI's bonxai is something else)"
versions
pinned "$python" "$here/table.py" "$results"
