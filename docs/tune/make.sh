#!/usr/bin/env bash
# Makes the pictures of docs/tune.md anew, and prints the numbers that stand there:  bash docs/tune/make.sh CFODI
# Takes a few minutes, and 1 GB of disk until its end.
set -euo pipefail
cfodi=$(realpath "$1")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python() { bash "$here/../../tests/bags/python.sh" "$@"; }

"$cfodi" simulate --out lab.mcap --scene lab --seconds 12
"$cfodi" simulate --out moving.mcap --scene moving --seconds 12

map() {  # NAME SCENE [PARAMETER:=VALUE ...]
  local name=$1 scene=$2
  shift 2
  local given=()
  for one in "$@"; do given+=(-p "$one"); done
  "$cfodi" replay "$scene.mcap" --ply "$name.ply" --summary "$name.json" --ros-args "${given[@]}" 2>>log || { cat log; exit 1; }
}
draw() { python "$here/draw.py" "$here/$1.png" "${@:2}"; }

map usual lab
map fine lab voxel_size:=0.04
map coarse lab voxel_size:=0.16
map few lab min_points:=3
map more lab min_points:=60
map many lab min_points:=1000
map near lab max_range:=3.0
map far lab max_range:=10.0
map distance lab optical:=no
map strict lab max_normal_angle:=0.02
map tenth lab max_normal_angle:=0.1
map unknown lab noise_model:=none
map letter lab mode:=paper
map cleared moving
map kept moving clearing:=false
map radius lab keep_radius:=2.5
map bounded lab max_voxels:=10000
map eager lab expansion_interval:=1
map patient lab expansion_interval:=100

draw voxel_size '4 cm=fine.ply' '8 cm=usual.ply' '16 cm=coarse.ply'
draw min_points '3=few.ply' '15=usual.ply' '1000=many.ply'
draw max_range '10 m=far.ply' '6 m=usual.ply' '3 m=near.ply'
draw max_normal_angle '0.53, in consistent 0.17=usual.ply' '0.02=strict.ply'
draw noise_model 'kinect_v1=usual.ply' 'none=unknown.ply'
draw mode 'consistent=usual.ply' 'paper=letter.ply'
draw clearing 'true=cleared.ply' 'false=kept.ply'
draw bounds 'no bound=usual.ply' 'keep_radius 2.5 m=radius.ply' 'max_voxels 10000=bounded.ply'
python - <<'TABLE'
import glob, json
for path in sorted(glob.glob("*.json")):
    s = json.load(open(path))
    print(f"{path[:-5]:9} dense voxels {s['dense_voxels']:6}  voxels {s['voxels']:6}  clusters {s['clusters']:4}"
          f"  of these active {s['clusters_active']:2}  ms {s['engine_ms']['p50']:5.1f}  MB {s['peak_rss_mb']:4.0f}")
TABLE

for rate in 0.5 2.0 10.0; do
  "$cfodi" replay lab.mcap --out "$rate.mcap" --ros-args -p "publish_rate:=$rate" 2>>log
  echo "publish_rate $rate: $(stat -c %s "$rate.mcap") bytes of results"
done

"$cfodi" experiment lab.mcap --out figures
for name in depth max_normal_angle min_vicinity; do cp "figures/effects_$name.svg" "$here/paper_$name.svg"; done
