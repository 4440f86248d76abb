//! Messages as bags and some middleware have them: four bytes that tell the order of bytes, then the message in CDR.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::Serialize;
use serde::de::{DeserializeOwned, DeserializeSeed};

/// What a message begins with whose lower bytes come first.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];

/// Reads a message; what is wrong, for a person.
pub(crate) fn read<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    read_with(data, std::marker::PhantomData)
}

/// Reads a message by a seed; what is wrong, for a person.
pub(crate) fn read_with<'de, S: DeserializeSeed<'de>>(data: &'de [u8], seed: S) -> Result<S::Value, String> {
    let read = match data {
        [0, 1, _, _, body @ ..] => seed.deserialize(&mut CdrDeserializer::<LittleEndian>::new(body)),
        [0, 0, _, _, body @ ..] => seed.deserialize(&mut CdrDeserializer::<BigEndian>::new(body)),
        _ => {
            let start = data[..data.len().min(4)].escape_ascii();
            return Err(format!("{} bytes that begin with \"{start}\" are no message in CDR", data.len()));
        }
    };
    read.map_err(|error| error.to_string())
}

/// Puts a message behind what `out` holds.
pub(crate) fn write(out: &mut Vec<u8>, message: &impl Serialize) -> Result<(), cdr_encoding::Error> {
    out.extend(CDR_LE);
    cdr_encoding::to_writer::<_, LittleEndian, _>(out, message)
}
