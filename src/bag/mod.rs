//! Recorded bags: MCAP files as `rosbags-convert` and `ros2 bag record` write them, in; result bags out.
//!
//! Keeps true: a bag is read once from its start to its end, and memory is bounded by its largest chunk and message, of files
//! that are read side by side by those of each, and by the images that wait for their camera, whatever a file's size; a message
//! that is compressed by itself is unpacked when its turn comes; a bag that is cut short gives every message before the cut, and
//! then says so. Reading is the crate `mcap`; what stands here is which files a bag is made of, which of its topics
//! are sensors, what its messages say, and that no length in it is believed before it is held against what is there. Times are
//! those of the message headers, never the clock's.

mod attachments;
mod bag_file;
mod channels;
mod choose;
mod clock;
mod copies;
mod decode;
mod error;
mod files;
mod metadata;
mod order;
mod qos;
mod read;
mod records;
mod schemas;
mod sensor;
mod survey;
mod topic;
mod write;

pub use choose::{Choice, ChoiceError, Info, Sensor, Wanted, choose};
pub use decode::{Decoder, Elsewhere, Recorded, TransformTopics};
pub use error::{BagError, Damage};
pub use files::Bag;
pub use read::{MAX_MESSAGE_BYTES, Message, Messages};
pub use sensor::SensorBag;
pub use topic::{Survey, Topic};
pub use write::{OutputTopics, ResultBag};
