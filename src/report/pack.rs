//! Integers as few bytes, for base64 in JSON.
//!
//! LEB128, the form of the `varint` of Protocol Buffers: seven bits a byte from the lowest on, the eighth says that more
//! follow. Signed numbers are folded first (0, -1, 1, -2 ... become 0, 1, 2, 3 ...).

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::engine::VoxelKey;

pub(super) fn push(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn push_signed(bytes: &mut Vec<u8>, number: i32) {
    let number = i64::from(number);
    push(bytes, ((number << 1) ^ (number >> 63)) as u64);
}

/// The indices of each voxel less those of the voxel before.
pub(super) fn keys(keys: &[VoxelKey]) -> String {
    let mut bytes = Vec::with_capacity(4 * keys.len());
    let mut before = [0; 3];
    for key in keys {
        let indices = key.indices();
        indices.into_iter().zip(before).for_each(|(now, before)| push_signed(&mut bytes, now - before));
        before = indices;
    }
    base64(&bytes)
}

pub(super) fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_takes_as_many_bytes_as_it_has_sevens_of_bits() {
        let mut bytes = Vec::new();
        [0, 127, 128, 300].into_iter().for_each(|number| push(&mut bytes, number));
        assert_eq!(bytes, [0, 127, 0x80, 1, 0xac, 2]);
    }

    #[test]
    fn negative_numbers_are_as_short_as_positive_ones() {
        let mut bytes = Vec::new();
        [0, -1, 1, -64, 63, i32::MIN].into_iter().for_each(|number| push_signed(&mut bytes, number));
        assert_eq!(bytes, [0, 1, 2, 127, 126, 0xff, 0xff, 0xff, 0xff, 0x0f]);
    }

    #[test]
    fn neighbours_in_a_column_take_three_bytes_each() {
        let column = [VoxelKey::new(1, -2, 0), VoxelKey::new(1, -2, 1)].map(Option::unwrap);
        assert_eq!(keys(&column), base64(&[2, 3, 0, 0, 0, 2]));
    }
}
