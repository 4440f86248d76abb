//! MCAP by the byte, for files that no writer makes.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

pub const MAGIC: &[u8] = b"\x89MCAP0\r\n";

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

pub fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

pub fn header() -> Vec<u8> {
    record(0x01, &[text("ros2"), text("test")].concat())
}

pub fn channel_body(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    [&id.to_le_bytes()[..], &schema.to_le_bytes(), &text(topic), &text(encoding), &[0; 4]].concat()
}

/// A channel of point clouds, with its schema before it.
pub fn channel(id: u16, topic: &str) -> Vec<u8> {
    channel_of(id, topic, "sensor_msgs/msg/PointCloud2", "cdr")
}

/// A channel of messages of this type, in this encoding, with its schema before it.
pub fn channel_of(id: u16, topic: &str, type_name: &str, encoding: &str) -> Vec<u8> {
    let schema = [&1_u16.to_le_bytes()[..], &text(type_name), &text("ros2msg"), &[0; 4]].concat();
    [record(0x03, &schema), record(0x04, &channel_body(id, 1, topic, encoding))].concat()
}

pub fn message(channel: u16, time: u64, data: &[u8]) -> Vec<u8> {
    record(
        0x05,
        &[&channel.to_le_bytes()[..], &[0; 4], &time.to_le_bytes(), &time.to_le_bytes(), data].concat(),
    )
}

/// A chunk that claims to unpack to `size` bytes.
pub fn chunk(compression: &str, size: u64, packed: &[u8]) -> Vec<u8> {
    let times = [0; 16];
    let length = (packed.len() as u64).to_le_bytes();
    record(0x06, &[&times[..], &size.to_le_bytes(), &[0; 4], &text(compression), &length, packed].concat())
}

pub fn footer(summary: u64) -> Vec<u8> {
    record(0x02, &[&summary.to_le_bytes()[..], &[0; 12]].concat())
}

/// A file of these records, without a summary.
pub fn whole(records: &[u8]) -> Vec<u8> {
    [MAGIC, &header(), records, &record(0x0f, &[0; 4]), &footer(0), MAGIC].concat()
}
