//! Right clusters at the cost of one scan: after every scan the partition is, up to the names of the clusters, the one
//! that a definition gives from scratch on the same published voxels.
//!
//! # The definition
//!
//! 1. A voxel holds count, mean and covariance of its points and the mean of the directions towards the sensor, each scan
//!    summed exactly and weighed by its noise (`sums`, `noise`). Of a panel up to a quarter of the voxel thick the other
//!    side counts as seen from the first, or the first as from the other once that has eight times its weight: its two
//!    sides are one surface, those of a wall in two layers of voxels are two, whichever face noise from behind it has hit
//!    first. Its **state** is what these were when its block of 8 x 8 x 8 voxels was published last, or when it became
//!    dense after that. A block is published with whatever has changed while it is young and when the sensor has turned
//!    away; in between, not more often than every third scan, when a quarter of a scan's points fall into voxels that were
//!    not published or a quarter of the voxels have drifted; at once when a dense voxel is gone (`publish/news`,
//!    `publish/baseline`). While the sensor stands still, half of a scan's points must (`publish/standpoint`): its noise
//!    adds to the map for long, and moves next to nothing of what is told of. While it moves, a scan publishes what cannot
//!    wait, and as many more of what is due as make 3 m^2 with it, or an eighth of these others; the rest waits for the
//!    next (`publish/due`), so that hardly a scan takes twice the usual time. States are rounded to parts of a voxel that
//!    no surface is known to (`state`), a third of the memory. Where no scan has put a point for 64 scans, whatever was put
//!    there is published, and the voxels keep no more than that until the next, but for what was seen through them and from
//!    behind (`publish/rest`).
//! 2. The dense voxels of a block form planar **patches**, grown from the flattest places. A voxel belongs to a plane if its
//!    points lie on it within their noise and what sensor and poses are off by. Where noise spreads a surface over two layers
//!    of voxels, the two patches that are found there become one. From what is left, **strips** of sharp voxels that may be one
//!    row, and **rough** patches with half a voxel's tolerance (`rules`), of two layers that points fill each by itself. What
//!    reaches no further along the line of sight than its noise spreads it is none of these. What fits none is in no patch
//!    (`patch/segment`), and neither is what has become dense since the block was published. A voxel whose sharp points show a
//!    sheet belongs to no plane across that sheet (`state`), so that two rows of a wall and two of a ceiling are no bevel.
//! 3. Two patches that touch, in a block or across its border, are **joined** when their planes agree in direction and where
//!    they meet, as far as both are known, or, where both are noisy, each lies well on the other's plane; narrow ones also
//!    where they are facets of one **bend**, of a radius of two voxels or more; rough ones with each other alone
//!    (`patch/join`). A noisy patch that lies within its noise on the plane of a sharper one, and fits no equal better, is a
//!    **slice** of its scatter; no equal is one that lies so on that plane too and is turned off it, which leads to another
//!    surface. A slice is also what is narrow, of a broader one whose plane it lies on, for its own normal may be any (if it lies
//!    well there, whatever it equals), and what is rough, of a flat one, unless only that is narrow (`patch`). A slice is joined
//!    to that one, and else only to what lies on that one's plane too, so that it ties no two surfaces together (`patch/host`).
//!    A patch that a crease runs through, of 7 degrees or more, is **folded**: its plane is that of neither surface, and may
//!    agree with both. It is a slice of the whole patch beside it that it fits best, and joined to another only where what the
//!    two are slices of, or they themselves, lie on each other's planes. So is a **bridge**, a cut patch (4.) that would join two
//!    which are no single surface: it is a part of the one that it fits best (`patch/host`). So a ramp of 18 degrees is no part
//!    of the floor.
//! 4. A patch of two rows at a face of its block is **cut**: where a surface ends just across the border, or scatters over
//!    it, its plane may be any. It ties together what it ties together, but each of its voxels, as of a narrow or folded patch,
//!    goes to a patch within two voxels that it fits better, and that is neither narrow nor rough itself; where its own is
//!    narrow, to one that it fits up to half as well (`patch/owner`). Cut, folded and narrow patches are **frayed**. A voxel is
//!    **loose** whose patch is found by what lies around it: one of a frayed patch, or one in none.
//! 5. A **cluster** is a component of joined patches, with the loose voxels that belong to them; one in no patch belongs to the
//!    nearest within three voxels whose plane its points fit.
//!
//! `scratch` is that from scratch; `surfaces` keeps it while blocks are published, and property tests hold the two equal
//! after every scan, removals included. Its cost follows the published blocks and their neighbours, and the smaller side of
//! what splits or merges (`graph`), never the size of the map, but for lists of components that a frozen map shares
//! (`graph`), and for a look at the keys of all blocks where the view is wider than the map (`clearing/view/blocks`); what
//! leaves the engine is described anew where it changed, which for an outline costs as much as the whole cluster is large,
//! and what it is judged by is found without a look at all clusters (`surfaces/landmarks`).
//!
//! # Why patches of blocks
//!
//! Local planes of single voxels are noisy where a Kinect is (14 degrees at 4 m, one in ten), so that joining voxel by
//! voxel either shatters surfaces or chains around edges. A patch has hundreds of times the points and ten times the
//! lever: its normal is good to a degree at 6 m. It is a function of 512 voxels, so a change is looked at anew in
//! microseconds, and components are found over some hundred patches instead of tens of thousands of voxels.
//!
//! The rules were measured against what could stand in their place, on the simulated laboratory and on recordings:
//! `docs/design-log.md` has the alternatives that were tried and left, with their figures and what each one breaks.
//!
//! # What becomes of it
//!
//! A cluster keeps exact sums (`cluster/sums`), its footprint (`outline/footprint`) and its identity (`cluster`) while
//! voxels come and go. In the sums a voxel counts by how much of its cross section its points cover, so that the edge of a
//! board, a sliver in its voxels, does not tilt the plane of its top (`state`), and little where its patch is rough, so
//! that a door leaf is not turned by the voxels that it shares with its jamb (`patch`); `describe` makes of them what
//! leaves the engine: plane and covariance, outline with holes (`outline`); `class` names it. A voxel with hardly any of
//! the points hereabouts, where noise beyond an edge has become dense, is no part of the outline (`patch/segmented`). What
//! the sensor looks through loses its points (`clearing`), what is too far or too much is forgotten (`bounds`).

// What is done with a scan, one step after another, and the definition that the outcome is held to.
mod pipeline;
mod scratch;

// Points, summed by voxel and folded into the voxels of blocks, each weighed by its noise.
mod block;
mod cells;
mod grid;
mod noise;
mod sums;

// What takes voxels out again.
mod bounds;
mod clearing;

// The states of voxels, and when they are published.
mod eigen;
mod plane;
mod publish;
mod state;

// Planar patches of each block, what they are joined to, and which loose voxels are theirs.
mod patch;
mod rules;

// Clusters of joined patches, kept while blocks are published.
mod cluster;
mod graph;
mod surfaces;

// What leaves the engine: outlines and classes; the map as it was after a scan, and saved.
mod class;
mod describe;
mod frozen;
mod outline;
mod saved;

// What the map is kept in.
mod lists;

pub(super) use frozen::FrozenConsistent;
pub use noise::NoiseModel;
pub use pipeline::Consistent;
pub(super) use saved::SavedConsistent;
