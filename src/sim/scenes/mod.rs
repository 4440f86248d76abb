//! The built-in scenes, each in a file of its own.
//!
//! Walls and furniture lie off the multiples of usual voxel sizes, as they would in a real room; the floor is at z = 0,
//! as a robot's odometry has it, and so at the border of two voxel layers.

mod clutter;
mod corridor;
mod lab;
mod moving;
mod room;
mod stairs;

use super::scene::Scene;

impl Scene {
    /// The names of the built-in scenes.
    pub const NAMES: [&str; 6] = ["room", "lab", "corridor", "stairs", "clutter", "moving"];

    /// A built-in scene; `None` where [`Scene::NAMES`] does not hold the name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "room" => Self::room(),
            "lab" => Self::lab(),
            "corridor" => Self::corridor(),
            "stairs" => Self::stairs(),
            "clutter" => Self::clutter(),
            "moving" => Self::moving(),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use nalgebra::Vector3;

    use super::*;
    use crate::engine::{Stamp, SurfaceClass};
    use crate::sim::{Drive, Surface};

    #[test]
    fn every_scene_has_surfaces_with_names_of_their_own_and_a_floor_at_zero() {
        for name in Scene::NAMES {
            let scene = Scene::named(name).unwrap();
            let names: BTreeSet<_> = scene.surfaces().iter().map(Surface::name).collect();
            assert_eq!(names.len(), scene.surfaces().len(), "{name}");
            let floors: Vec<_> =
                scene.surfaces().iter().filter(|surface| surface.class() == SurfaceClass::Floor).collect();
            assert_eq!(floors.len(), 1, "{name}");
            assert!(floors[0].pose().translation.z.abs() < 1e-12, "{name}");
        }
        assert!(Scene::named("kitchen").is_none());
    }

    #[test]
    fn classes_agree_with_the_way_that_surfaces_face() {
        for name in Scene::NAMES {
            for surface in Scene::named(name).unwrap().surfaces() {
                let up = surface.normal().dot(&Vector3::z());
                let fits = match surface.class() {
                    SurfaceClass::Floor | SurfaceClass::Horizontal => up > 0.98,
                    SurfaceClass::Ceiling => up < -0.98,
                    SurfaceClass::Wall | SurfaceClass::Door => up.abs() < 0.18,
                    SurfaceClass::Slope => (0.17..0.99).contains(&up),
                    SurfaceClass::Curved => !surface.shape().is_flat(),
                    SurfaceClass::Unknown => true,
                };
                assert!(fits, "{name}: {} is {:?} and faces {up}", surface.name(), surface.class());
            }
        }
    }

    #[test]
    fn everywhere_on_the_way_the_camera_sees_something_near() {
        for name in Scene::NAMES {
            let drive = Drive::new(Scene::named(name).unwrap(), 1, Stamp::from_nanos(0));
            for index in (0..2400).step_by(97) {
                let hits: BTreeMap<u32, u32> =
                    drive.true_hits(index, 8).fold(BTreeMap::new(), |mut counts, (label, _)| {
                        *counts.entry(label).or_default() += 1;
                        counts
                    });
                let rays: u32 = hits.values().sum();
                assert!(rays > 3500, "{name}, step {index}: {rays} of 4800 rays");
                assert!(hits.len() > 1, "{name}, step {index}: {hits:?}");
            }
        }
    }
}
