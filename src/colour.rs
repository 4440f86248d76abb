//! A colour for every cluster id, the same in a picture, a PLY and a marker, in every run.

use std::f64::consts::TAU;

use crate::engine::ClusterId;

/// Colour of what is in no cluster.
const NO_CLUSTER: [u8; 3] = [150, 150, 150];

/// 2^64 over the golden ratio: multiples of it, modulo 2^64, stay as far apart as such a sequence can.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
/// 2^64 times the fraction of the square root of 2: likewise, and out of step with the golden ratio.
const SILVER: u64 = 0x6A09_E667_F3BC_C908;

/// Lightness in Oklab from the darkest to the brightest cluster, of 1: away from black and from white.
const LIGHTNESS: [f64; 2] = [0.62, 0.82];
/// Distance from grey in Oklab.
const CHROMA: f64 = 0.14;

/// sRGB of a cluster: hue and lightness from a hash of the id that keeps successive ids well apart; grey for none.
pub(crate) fn cluster_colour(id: Option<ClusterId>) -> [u8; 3] {
    let Some(id) = id else { return NO_CLUSTER };
    let hue = TAU * fraction(id.get().wrapping_mul(GOLDEN));
    let lightness = LIGHTNESS[0] + (LIGHTNESS[1] - LIGHTNESS[0]) * fraction(id.get().wrapping_mul(SILVER));
    srgb_from_oklab([lightness, CHROMA * hue.cos(), CHROMA * hue.sin()])
}

/// A hash as a number from 0 to 1.
fn fraction(hash: u64) -> f64 {
    hash as f64 / 2_f64.powi(64)
}

/// Oklab (Ottosson 2020), in which equal distances look equally large; beyond sRGB's gamut each channel is clamped.
fn srgb_from_oklab([lightness, a, b]: [f64; 3]) -> [u8; 3] {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ];
    linear.map(|channel| (255.0 * gamma_encode(channel.clamp(0.0, 1.0))).round() as u8)
}

/// The transfer function of sRGB.
fn gamma_encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colour(id: u64) -> [f64; 3] {
        cluster_colour(ClusterId::new(id)).map(f64::from)
    }

    fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
        a.into_iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn oklab_gives_the_known_colours_of_srgb() {
        assert_eq!(srgb_from_oklab([1.0, 0.0, 0.0]), [255, 255, 255]);
        assert_eq!(srgb_from_oklab([0.0, 0.0, 0.0]), [0, 0, 0]);
        assert_eq!(srgb_from_oklab([0.627_955, 0.224_863, 0.125_846]), [255, 0, 0]);
    }

    #[test]
    fn the_colour_of_an_id_never_changes() {
        let colours = [1, 2, 3, u64::MAX].map(|id| cluster_colour(ClusterId::new(id)));
        assert_eq!(colours, [[0, 177, 222], [226, 177, 61], [172, 123, 215], [125, 190, 100]]);
    }

    #[test]
    fn a_dozen_successive_clusters_are_told_apart_wherever_the_ids_begin() {
        for first in [1, 100, 12_345, u64::MAX - 12] {
            let colours: Vec<_> = (first..first + 12).map(colour).collect();
            for (i, &a) in colours.iter().enumerate() {
                for &b in &colours[..i] {
                    assert!(distance(a, b) > 25.0, "from id {first}: {a:?} and {b:?}");
                }
            }
        }
    }

    #[test]
    fn every_cluster_is_bright_and_unlike_the_grey_of_none() {
        let grey = cluster_colour(None).map(f64::from);
        for id in 1..2000 {
            let [red, green, blue] = colour(id);
            let luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
            assert!((90.0..235.0).contains(&luma), "id {id}: {luma}");
            assert!(distance([red, green, blue], grey) > 40.0, "id {id}");
        }
    }
}
