//! The measures, what each asks for, and the values that a run gives to each.

use super::confidence::calibration_error;
use super::score::{ClusterScore, Described, Quality, SurfaceScore};

/// Seen area from which on planes are held to their bars and areas to the narrow one (m^2).
const LARGE: f64 = 2.0;

/// One line of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Measure {
    /// Share of the scored voxels of seen surfaces that are in clusters; one value a run.
    Coverage,
    /// Share of a seen surface's scored voxels that one cluster holds.
    Wholeness,
    /// Share of a cluster's scored voxels that are of another surface; clusters that hold voxels of seen surfaces.
    Impurity,
    /// The same for all clusters of 10 voxels or more.
    ImpurityOfLarge,
    /// Adjusted Rand index; one value a run.
    RandIndex,
    /// Angle between the normals (degrees), flat surfaces of 2 m^2 or more.
    Angle,
    /// Distance of the planes (m), flat surfaces of 2 m^2 or more.
    Offset,
    /// Relative error of the area, surfaces of 2 m^2 or more.
    AreaOfLarge,
    /// Relative error of the area, smaller surfaces.
    AreaOfSmall,
    /// Share of the seen area whose class is right; one value a run.
    Class,
    /// By how much the confidences of classes differ from the share of the area that is right; one value a run.
    Confidence,
    /// Normalised estimation error squared of a plane.
    Nees,
    /// Standard deviation that is stated for a plane's offset (m).
    OffsetSigma,
    /// Share of the scans on which the partition is what the definition gives from scratch; one value a run.
    AsFromScratch,
}

/// What a measure asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bar {
    /// Every value is at least this.
    EachAtLeast(f64),
    /// Every value is at most this.
    EachAtMost(f64),
    /// The mean is within these bounds.
    MeanWithin {
        /// The lower bound.
        least: f64,
        /// The upper bound.
        most: f64,
        /// Least number of values that it must be the mean of.
        cases: usize,
    },
    /// The median is at most this.
    MedianAtMost(f64),
}

/// How the values of a measure are shown.
pub(super) struct Scale {
    /// What a value is multiplied with.
    pub(super) factor: f64,
    /// Digits behind the point.
    pub(super) digits: usize,
    /// As it stands behind the number; empty where there is none.
    pub(super) unit: &'static str,
}

impl Measure {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 14] = [
        Self::Coverage,
        Self::Wholeness,
        Self::Impurity,
        Self::ImpurityOfLarge,
        Self::RandIndex,
        Self::Angle,
        Self::Offset,
        Self::AreaOfLarge,
        Self::AreaOfSmall,
        Self::Class,
        Self::Confidence,
        Self::Nees,
        Self::OffsetSigma,
        Self::AsFromScratch,
    ];

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::AsFromScratch => "scans after which it is as from scratch",
            Self::Coverage => "scored voxels in clusters",
            Self::Wholeness => "share of a surface in one cluster",
            Self::Impurity => "share of a cluster on other surfaces",
            Self::ImpurityOfLarge => "the same, all clusters of 10 voxels or more",
            Self::RandIndex => "adjusted Rand index",
            Self::Angle => "angle of planes from 2 m2 on",
            Self::Offset => "offset of planes from 2 m2 on",
            Self::AreaOfLarge => "error of areas from 2 m2 on",
            Self::AreaOfSmall => "error of areas below 2 m2",
            Self::Class => "area with the right class",
            Self::Confidence => "error of the confidence in classes",
            Self::Nees => "NEES of planes",
            Self::OffsetSigma => "sigma of offsets",
        }
    }

    /// What a value of it is, for whoever reads the table.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::AsFromScratch => {
                "of every 50th scan and the last those after which the clusters are, up to their names, what the method's definition gives \
                 from scratch on the same voxels, in `consistent` as each was published last; a value for each run"
            }
            Self::Coverage => {
                "of the scored voxels of seen surfaces those that are in a cluster; a value for each run"
            }
            Self::Wholeness => {
                "of a seen surface's scored voxels those that one cluster holds, the one with the most; a value for each surface"
            }
            Self::Impurity => {
                "of a cluster's scored voxels those that are not of the surface with the most; a value for each cluster with voxels \
                 of a seen surface"
            }
            Self::ImpurityOfLarge => {
                "the same; a value for each cluster of 10 voxels or more, whatever surfaces it is on"
            }
            Self::RandIndex => {
                "how far clusters and true surfaces agree on which scored voxels belong together: 1 is agreement, 0 what chance \
                 gives; a value for each run"
            }
            Self::Angle => {
                "between the true normal and that of the cluster with most of the surface; a value for each flat surface of 2 m2 or more"
            }
            Self::Offset => {
                "of that cluster's plane from the true one, at the middle of what was seen; a value for each flat surface of 2 m2 or more"
            }
            Self::AreaOfLarge => {
                "by how much that cluster's area differs from the seen one, as a share of this; of a bent surface in the cluster's plane, \
                 for there its boundary lies; a value for each surface of 2 m2 or more"
            }
            Self::AreaOfSmall => "the same; a value for each smaller surface",
            Self::Class => {
                "of the seen area that whose class (floor, wall, ...) is right; a value for each run"
            }
            Self::Confidence => {
                "of classes that are stated with about the same confidence, in bins of 0.1, how far this is from the share of their area \
                 that is right (the expected calibration error); a value for each run"
            }
            Self::Nees => {
                "normalised estimation error squared: the error of a plane in angle and offset, squared, in terms of the covariance \
                 that is stated for it: 3 on average where that is right, more where it promises too much; a value for each surface \
                 that is one plane, but for those of which the plane is turned by 45 degrees or more, which is another surface's"
            }
            Self::OffsetSigma => {
                "the standard deviation that is stated for a plane's offset; a value for each flat surface"
            }
        }
    }

    /// Whether methods are compared by the mean of its values, where none is infinite by nature; else it is by the median.
    pub const fn is_by_mean(self) -> bool {
        matches!(
            self,
            Self::AsFromScratch
                | Self::Coverage
                | Self::Wholeness
                | Self::Impurity
                | Self::ImpurityOfLarge
                | Self::RandIndex
                | Self::Class
                | Self::Confidence
                | Self::Nees
        )
    }

    /// In tables for programs.
    pub const fn key(self) -> &'static str {
        match self {
            Self::AsFromScratch => "as_from_scratch",
            Self::Coverage => "coverage",
            Self::Wholeness => "wholeness",
            Self::Impurity => "impurity",
            Self::ImpurityOfLarge => "impurity_all_large",
            Self::RandIndex => "rand_index",
            Self::Angle => "plane_angle_deg",
            Self::Offset => "plane_offset_m",
            Self::AreaOfLarge => "area_error_large",
            Self::AreaOfSmall => "area_error_small",
            Self::Class => "class_area",
            Self::Confidence => "class_confidence_error",
            Self::Nees => "plane_nees",
            Self::OffsetSigma => "plane_offset_sigma_m",
        }
    }

    /// What it asks for.
    pub const fn bar(self) -> Bar {
        match self {
            Self::AsFromScratch => Bar::EachAtLeast(1.0),
            Self::Coverage | Self::Wholeness => Bar::EachAtLeast(0.9),
            Self::Impurity | Self::ImpurityOfLarge => Bar::EachAtMost(0.05),
            Self::RandIndex | Self::Class => Bar::EachAtLeast(0.95),
            Self::Angle => Bar::EachAtMost(0.5),
            Self::Offset => Bar::EachAtMost(0.01),
            Self::AreaOfLarge | Self::Confidence => Bar::EachAtMost(0.1),
            Self::AreaOfSmall => Bar::EachAtMost(0.25),
            Self::Nees => Bar::MeanWithin { least: 1.5, most: 6.0, cases: 200 },
            Self::OffsetSigma => Bar::MedianAtMost(0.005),
        }
    }

    /// How its values are shown.
    pub(super) const fn scale(self) -> Scale {
        let (factor, digits, unit) = match self {
            Self::RandIndex => (1.0, 3, ""),
            Self::Angle => (1.0, 2, " deg"),
            Self::Offset | Self::OffsetSigma => (1e3, 1, " mm"),
            Self::Nees => (1.0, 2, ""),
            _ => (100.0, 1, " %"),
        };
        Scale { factor, digits, unit }
    }

    /// A value with its unit; an infinite one says that there was nothing to measure where something should be.
    pub fn show(self, value: f64) -> String {
        let Scale { factor, digits, unit } = self.scale();
        if value.is_infinite() { "none".to_owned() } else { format!("{:.digits$}{unit}", value * factor) }
    }

    /// The values that a run gives; empty where there is nothing to measure, or the method does not compute such a thing. An
    /// infinite value stands for a surface that no cluster, or one without this description, holds.
    pub fn values(self, quality: &Quality) -> Vec<f64> {
        let Quality { surfaces, clusters, computes, .. } = quality;
        let is_large = |surface: &&SurfaceScore| surface.seen_area >= LARGE;
        let large = || surfaces.iter().filter(is_large);
        let planes = || large().filter(|surface| surface.has_plane);
        let of = |surface: &SurfaceScore, value: fn(&Described) -> Option<f64>| {
            surface.described.as_ref().and_then(value).map_or(f64::INFINITY, f64::abs)
        };
        match self {
            Self::AsFromScratch => quality.as_from_scratch.into_iter().collect(),
            Self::Coverage => share(
                surfaces.iter().map(|surface| f64::from(surface.clustered)),
                surfaces.iter().map(|surface| f64::from(surface.scored)),
            ),
            Self::Wholeness => surfaces.iter().map(SurfaceScore::wholeness).collect(),
            Self::Impurity => {
                clusters.iter().filter(|cluster| cluster.of_seen).map(ClusterScore::impurity).collect()
            }
            Self::ImpurityOfLarge => {
                clusters.iter().filter(|cluster| cluster.is_large()).map(ClusterScore::impurity).collect()
            }
            Self::RandIndex => quality.rand_index.into_iter().collect(),
            Self::Angle => planes().map(|surface| of(surface, |found| found.angle)).collect(),
            Self::Offset => planes().map(|surface| of(surface, |found| found.offset)).collect(),
            Self::AreaOfLarge if computes.area => {
                large().map(|surface| of(surface, |found| found.area_error)).collect()
            }
            Self::AreaOfSmall if computes.area => {
                let small = surfaces.iter().filter(|surface| !is_large(surface));
                small.map(|surface| of(surface, |found| found.area_error)).collect()
            }
            Self::Class if computes.class => share(
                surfaces.iter().map(|surface| surface.class_right),
                surfaces.iter().map(|surface| surface.seen_area),
            ),
            Self::Confidence => {
                calibration_error(surfaces.iter().flat_map(|surface| &surface.stated)).into_iter().collect()
            }
            Self::Nees if computes.certainty => {
                // What is another surface fails by its angle: it would make a mean of all the others worthless.
                let is_judged =
                    |surface: &&SurfaceScore| surface.is_one_plane && !surface.is_described_as_another();
                let exact = surfaces.iter().filter(is_judged);
                exact.map(|surface| of(surface, |found| found.nees)).collect()
            }
            Self::OffsetSigma if computes.certainty => {
                let flat = surfaces.iter().filter(|surface| surface.has_plane);
                flat.map(|surface| of(surface, |found| found.offset_sigma)).collect()
            }
            Self::AreaOfLarge | Self::AreaOfSmall | Self::Class | Self::Nees | Self::OffsetSigma => {
                Vec::new()
            }
        }
    }
}

/// The sum of some over the sum of all; nothing where there is nothing.
fn share(some: impl Iterator<Item = f64>, all: impl Iterator<Item = f64>) -> Vec<f64> {
    let all: f64 = all.sum();
    if all > 0.0 { vec![some.sum::<f64>() / all] } else { Vec::new() }
}

impl Bar {
    /// The value of these that is furthest to the wrong side.
    pub(super) fn worst(self, values: impl Iterator<Item = f64>) -> Option<f64> {
        let badness = |value: f64| if matches!(self, Self::EachAtLeast(_)) { -value } else { value };
        values.max_by(|a, b| badness(*a).total_cmp(&badness(*b)))
    }

    /// Whether a single value is good.
    pub fn holds_for(self, value: f64) -> bool {
        match self {
            Self::EachAtLeast(least) => value >= least,
            Self::EachAtMost(most) | Self::MedianAtMost(most) => value <= most,
            Self::MeanWithin { least, most, .. } => (least..=most).contains(&value),
        }
    }
}
