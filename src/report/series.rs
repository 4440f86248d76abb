//! Numbers of every scan, in a bounded number of columns.

use nalgebra::Point3;

use crate::engine::Stamp;

/// What the caller knows of a scan that went through the engine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// Points that it put into voxels.
    pub points: u64,
    /// Dense voxels after it.
    pub dense: u64,
    /// Time that the engine took (ms).
    pub engine_ms: f64,
    /// Where the sensor stood, fixed frame (m).
    pub sensor: Point3<f64>,
}

/// One scan, or several that stand together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Column {
    /// Scans in it.
    pub(super) scans: u64,
    /// Stamp of the last.
    pub(super) stamp: Stamp,
    /// Points that all put into voxels.
    pub(super) points: u64,
    /// Time in the engine of all (ms).
    pub(super) engine_ms: f64,
    /// Time in the engine of the slowest (ms).
    pub(super) slowest_ms: f64,
    /// Voxels that became dense.
    pub(super) newly_dense: u64,
    /// Clusters after the last.
    pub(super) clusters: u64,
    /// Dense voxels after the last.
    pub(super) dense: u64,
    /// Where the sensor stood at the last.
    pub(super) sensor: Point3<f64>,
}

/// Most columns: more than a figure has pixels to tell apart.
pub(super) const COLUMNS: usize = 1024;

/// The columns, in time; all but the last of the same number of scans.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// Stamp of the first scan.
    pub(super) first: Option<Stamp>,
    pub(super) columns: Vec<Column>,
    scans_per_column: u64,
}

impl Default for Series {
    fn default() -> Self {
        Self { first: None, columns: Vec::new(), scans_per_column: 1 }
    }
}

impl Series {
    pub(super) fn push(&mut self, scan: Column) {
        self.first.get_or_insert(scan.stamp);
        match self.columns.last_mut() {
            Some(last) if last.scans < self.scans_per_column => *last = last.and_then(&scan),
            _ => self.columns.push(scan),
        }
        if self.columns.len() > COLUMNS {
            self.scans_per_column *= 2;
            let joined = self.columns.chunks(2).map(|pair| match pair {
                [first, second] => first.and_then(second),
                rest => rest[0],
            });
            self.columns = joined.collect();
        }
    }

    /// All scans as one column; `None` without a scan.
    pub(super) fn total(&self) -> Option<Column> {
        self.columns.iter().copied().reduce(|sum, column| sum.and_then(&column))
    }
}

impl Column {
    fn and_then(&self, later: &Self) -> Self {
        Self {
            scans: self.scans + later.scans,
            points: self.points + later.points,
            engine_ms: self.engine_ms + later.engine_ms,
            slowest_ms: self.slowest_ms.max(later.slowest_ms),
            newly_dense: self.newly_dense + later.newly_dense,
            ..*later
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(number: u64) -> Column {
        Column {
            scans: 1,
            stamp: Stamp::from_nanos(number as i64),
            points: 2,
            engine_ms: 0.5,
            slowest_ms: number as f64,
            newly_dense: 3,
            clusters: number,
            dense: 3 * number,
            sensor: Point3::origin(),
        }
    }

    #[test]
    fn few_scans_stand_alone() {
        let mut series = Series::default();
        (1..=COLUMNS as u64).for_each(|number| series.push(scan(number)));
        assert_eq!(series.columns, (1..=COLUMNS as u64).map(scan).collect::<Vec<_>>());
    }

    #[test]
    fn many_scans_share_columns_and_none_is_lost() {
        let mut series = Series::default();
        for number in 1..=10_001 {
            series.push(scan(number));
            assert!(series.columns.len() <= COLUMNS);
        }
        assert_eq!(series.first, Some(Stamp::from_nanos(1)));
        let total = series.total().unwrap();
        assert_eq!((total.scans, total.points, total.newly_dense), (10_001, 20_002, 30_003));
        assert_eq!((total.clusters, total.slowest_ms, total.engine_ms), (10_001, 10_001.0, 5_000.5));
        let (last, others) = series.columns.split_last().unwrap();
        assert!(others.iter().all(|column| column.scans == 16) && last.scans == 1);
    }
}
