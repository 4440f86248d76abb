//! When what the voxels of a block hold becomes the states that clusters are made of, and what is remembered of that.
//!
//! A block tells what is new in it since it was published (`news`), by what each voxel was then (`baseline`); where the sensor
//! stands still it must be more (`standpoint`). What is due is published at once or in turn (`due`). What the sensor has
//! left is at rest after a while, and shares what was published of it with the surfaces (`rest`).

pub(super) mod baseline;
pub(super) mod due;
pub(super) mod news;
pub(super) mod rest;
pub(super) mod standpoint;
