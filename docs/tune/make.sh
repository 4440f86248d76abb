#!/usr/bin/env bash
# Makes the pictures of docs/tune.md anew, writes the counts that stand there into counts.json and prints times and memory:
#   bash docs/tune/make.sh CFODI
# Takes a few minutes, and 1 GB of disk until its end. tests/bags/test_tune.py holds the page against counts.json.
set -euo pipefail
cfodi=$(realpath "${1:?usage: bash docs/tune/make.sh CFODI}")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python() { bash "$here/../../tests/bags/python.sh" "$@"; }

"$cfodi" simulate --out lab.mcap --scene lab --seconds 12
"$cfodi" simulate --out moving.mcap --scene moving --seconds 12
"$cfodi" simulate --out swayed.mcap --scene lab --seconds 12 --pose-noise 0.05,0.01

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
map swayed swayed
map told swayed pose_sigma:=0.05
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
draw pose_sigma '0=swayed.ply' '0.05=told.ply'
draw mode 'consistent=usual.ply' 'paper=letter.ply'
draw clearing 'true=cleared.ply' 'false=kept.ply'
draw bounds 'no bound=usual.ply' 'keep_radius 2.5 m=radius.ply' 'max_voxels 10000=bounded.ply'
for rate in 0.5 2.0 10.0; do
  "$cfodi" replay lab.mcap --out "$rate.mcap" --ros-args -p "publish_rate:=$rate" 2>>log
done

"$cfodi" experiment lab.mcap --out figures
for name in depth max_normal_angle min_vicinity; do cp "figures/effects_$name.svg" "$here/paper_$name.svg"; done

python - "$here/counts.json" <<'TABLE'
import csv, glob, json, os, sys
runs = {}
for path in sorted(glob.glob("*.json")):
    s, name = json.load(open(path)), path[:-5]
    runs[name] = {count: s[count] for count in ("dense_voxels", "voxels", "clusters", "clusters_active")}
    print(f"{name:9} a scan {s['engine_ms']['p50']:5.1f} ms  memory {s['peak_rss_mb']:4.0f} MB")
effects = [row for row in csv.DictReader(open("figures/effects.csv")) if row["parameter"] == "min_vicinity"]
counts = {
    "runs": runs,
    "result_mb": {rate: round(os.path.getsize(f"{rate}.mcap") / 1e6, 1) for rate in ("0.5", "2.0", "10.0")},
    "min_vicinity": {row["value"]: int(row["clusters"]) for row in effects if row["value"] in ("2", "10")},
}
with open(sys.argv[1], "w") as file:
    file.write(json.dumps(counts, indent=2) + "\n")
TABLE
