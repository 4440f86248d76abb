"""The counts of docs/tune.md are those of docs/tune/counts.json, which docs/tune/make.sh writes; and this program counts so."""

import json

from bags import REPOSITORY
from replay import Replay, cfodi

DOCS = REPOSITORY / "docs"
COUNTS = json.loads((DOCS / "tune" / "counts.json").read_text())

# Words of the page, with a run of make.sh and what is counted of it.
SAID = """
| dense voxels | {fine.dense_voxels:,} | {usual.dense_voxels:,} | {coarse.dense_voxels} |
| clusters | {fine.clusters} | {usual.clusters} | {coarse.clusters} |
{few.dense_voxels:,} dense voxels with 3, {usual.dense_voxels:,} with 15, {more.dense_voxels:,} with 60
With 1000, half ({many.dense_voxels:,}) are left
the map has {near.clusters} clusters, with 6 m 2.1 ms and {usual.clusters}, with 10 m 2.5 ms and {far.clusters}.
{distance.dense_voxels:,} voxels are dense instead of {usual.dense_voxels:,}
{unknown.clusters} clusters with `none` and {usual.clusters} with `kinect_v1`
{swayed.clusters} clusters, with 0.05 {told.clusters}
{usual.clusters} clusters and {letter.clusters} on the same voxels
{usual.clusters} clusters as it is, {tenth.clusters} with 0.1 and with 0.02
{usual.clusters} clusters as it is, {strict.clusters} with 0.1 and with 0.02
{eager.clusters_active} of {eager.clusters} clusters is active with 1, {usual.clusters_active} with 10, {patient.clusters_active} with 100
what has passed stays: {kept.clusters} clusters, with it {cleared.clusters}.
With 2.5 m {radius.dense_voxels} dense voxels are left of {usual.dense_voxels:,}
With 10,000 there were {bounded.voxels} at the end
{min_vicinity[2]} clusters with 2, {min_vicinity[10]:,} with 10
take {result_mb[0.5]} MB at 0.5 Hz, {result_mb[2.0]} MB at 2 Hz and {result_mb[10.0]} MB at 10 Hz
""".strip().splitlines()


class Run(dict):
    __getattr__ = dict.__getitem__


def test_the_page_says_what_was_counted():
    page = " ".join((DOCS / "tune.md").read_text().split())
    values = {name: Run(run) for name, run in COUNTS["runs"].items()}
    values["min_vicinity"] = {int(value): clusters for value, clusters in COUNTS["min_vicinity"].items()}
    values["result_mb"] = COUNTS["result_mb"]
    missing = [words for words in (line.format_map(values) for line in SAID) if words not in page]
    assert not missing, "docs/tune.md does not say this"


def test_this_program_counts_the_same(tmp_path):
    """Two runs of make.sh."""
    bag = tmp_path / "lab.mcap"
    made = cfodi("simulate", "--out", bag, "--scene", "lab", "--seconds", 12)
    assert made.returncode == 0, made.stderr
    for name, parameters in {"usual": {}, "coarse": {"voxel_size": 0.16}}.items():
        summary = Replay(bag, tmp_path / name, outputs=("summary",), parameters=parameters).summary()
        counted = {count: summary[count] for count in COUNTS["runs"][name]}
        assert counted == COUNTS["runs"][name], f"{name}: bash docs/tune/make.sh CFODI, and docs/tune.md after it"
