"""Tables in Markdown from what was measured:  python table.py RESULTS

RESULTS holds, in the order of measuring, the lines `ours SIZE MODE median_ms N`, `cold_read median_ms N`,
`peer NAME SIZE median_ms N`, `stream NAME | POINTS_PER_S | POINTS | KEPT | SETTINGS`, `scan_points N`,
`missing NAME: REASON`, `version NAME NUMBER` and `note TEXT`.
"""

import sys
from pathlib import Path
from statistics import mean, median

SIZES = ("0.08", "0.05")
OURS = {
    "cloud": "a message's bytes to clusters of the whole map, organised cloud",
    "unorganized": "the same, cloud without rows",
    "depth": "the same, depth image",
}
PEERS = {
    "pcl_scan": ("PCL", "one scan alone: VoxelGrid, normals (kd-tree, 2 voxels), RegionGrowing (10 neighbours)"),
    "pcl_map": ("PCL", "the whole map once more, from centroids of dense voxels: normals, RegionGrowing as above"),
    "octomap": ("OctoMap", "one scan more in the occupancy tree: insertPointCloud, lazy, discretised; no clusters"),
    "open3d_dbscan": ("Open3D", "one scan alone: voxels, normals (10 neighbours), cluster_dbscan (no surfaces)"),
    "open3d_patches": ("Open3D", "one scan alone: voxels, normals (10 neighbours), detect_planar_patches"),
}
BASE = "cloud"  # of ours, what the ratios are to
SCANS_A_SECOND = 30


def main(results):
    lines = [line for line in Path(results).read_text().splitlines() if line]
    ours, peers, cold = timed(lines)
    missing = [rest(line) for line in lines if line.startswith("missing ")]
    print(scan_table(ours, peers, cold, missing))
    print(stream_table(lines, ours, missing))
    for heading, word in (("Not to be had", "missing"), ("Notes", "note"), ("Versions", "version")):
        told = list(dict.fromkeys(rest(line) for line in lines if line.startswith(word + " ")))
        if told:
            print(f"{heading}:\n" + "".join(f"- {text}\n" for text in told))


def rest(line):
    return line.split(" ", 1)[1]


def timed(lines):
    """Times in ms with their place in the order of measuring: `{(name, size): [(place, ms)]}`, and the cold reads."""
    ours, peers, cold = {}, {}, []
    for place, line in enumerate(lines):
        match line.split():
            case ["ours", size, mode, "median_ms", ms]:
                ours.setdefault((mode, f"{float(size):.2f}"), []).append((place, float(ms)))
            case ["peer", name, size, "median_ms", ms]:
                peers.setdefault((name, size), []).append((place, float(ms)))
            case ["cold_read", "median_ms", ms]:
                cold.append(float(ms))
    if not all((BASE, size) in ours for size in SIZES):
        raise SystemExit(f"no time of ours ({BASE}) at each of {SIZES} m: there is nothing to compare with")
    return ours, peers, cold


def ratio(base, measured):
    """Median of measured / ours, each beside the runs of ours right before and after it, so that a drift cancels."""
    ratios = []
    for place, ms in measured:
        before = [own for at, own in base if at < place][-1:]
        after = [own for at, own in base if at > place][:1]
        ratios.append(ms / mean(before + after))
    return median(ratios)


def row(*cells):
    return "| " + " | ".join(cells) + " |\n"


def scan_table(ours, peers, cold, missing):
    def cells(times):
        columns = [(f"{median(ms for _, ms in times[size]):.2f}" if times[size] else "") for size in SIZES]
        return columns + [(f"{ratio(ours[BASE, size], times[size]):.1f}" if times[size] else "") for size in SIZES]

    text = row("", "what is timed", "ms at 8 cm", "ms at 5 cm", "times ours at 8 cm", "times ours at 5 cm")
    text += row("---", "---", *["---:"] * 4)
    for mode, what in OURS.items():
        times = {size: ours.get((mode, size), []) for size in SIZES}
        own = cells(times)
        text += row(f"ours, {mode}", what, *own[:2], *(["1", "1"] if mode == BASE else own[2:]))
    for name, (library, what) in PEERS.items():
        times = {size: peers.get((name, size), []) for size in SIZES}
        reason = next((m.split(": ", 1)[1] for m in missing if m.split(":")[0] == library), None)
        text += row(library, what, *(cells(times) if any(times.values()) else [reason or "not measured", "", "", ""]))
    if cold:
        text += row("", "reading the cloud's bytes once, out of cache", f"{median(cold):.2f}", "", "", "")
    return text


def stream_table(lines, ours, missing):
    points = next((int(rest(line)) for line in lines if line.startswith("scan_points ")), 0)
    if not points:
        return "No stream method was measured.\n"
    stream = points * SCANS_A_SECOND
    text = row("stream method", "settings", "of the scan's points", "kept at the end", "points a second",
               f"of {SCANS_A_SECOND} scans a second")
    text += row("---", "---", "---:", "---", "---:", "---:")
    own = points / median(ms for _, ms in ours[BASE, SIZES[0]]) * 1000
    text += row("ours, cloud", "8 cm", f"{points:,}", "the map", f"{own:,.0f}", f"{own / stream:.0%}")
    for line in lines:
        if line.startswith("stream "):
            name, rate, taken, kept, settings = rest(line).split(" | ")
            text += row(name, settings, f"{int(taken):,}", kept, f"{int(rate):,}", f"{int(rate) / stream:.2%}")
    for name in ("river", "MOA in capymoa", "incdbscan"):
        reason = next((m.split(": ", 1)[1] for m in missing if m.split(":")[0] == name), None)
        if reason:
            text += row(name, reason, "", "", "", "")
    return text


if __name__ == "__main__":
    main(sys.argv[1])
