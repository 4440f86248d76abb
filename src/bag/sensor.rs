//! A recording as a robot would make it: transforms and the clouds of one camera, in an MCAP of the profile `ros2`.
//!
//! The same messages give the same bytes: one thread compresses, and nothing comes from a clock.

use std::io::{self, Write};

use mcap::Writer;
use mcap::write::NoSeek;

use super::write::{Channel, RECORDER, channel, logged, put, writer};
use crate::msg::heard::of_robot;
use crate::msg::ros::{PointCloud2, TfMessage};
use crate::msg::topic::{Named, Qos};
use crate::msg::types;

/// Writes a recording with `/tf_static`, `/tf` and one topic of clouds, in chunks of zstd.
pub struct SensorBag<W: Write> {
    writer: Writer<NoSeek<W>>,
    static_transforms: Channel,
    transforms: Channel,
    points: Channel,
    scratch: Vec<u8>,
}

impl<W: Write> SensorBag<W> {
    /// Begins a recording whose clouds are on `points`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, points: &str) -> io::Result<Self> {
        let mut writer = writer(out, RECORDER)?;
        let [changing, lasting] = [false, true].map(of_robot);
        let clouds = Named { name: points, type_name: types::CLOUD };
        Ok(Self {
            static_transforms: channel(&mut writer, lasting.named(), lasting.qos)?,
            transforms: channel(&mut writer, changing.named(), changing.qos)?,
            points: channel(&mut writer, clouds, Qos::best_effort(10))?,
            writer,
            scratch: Vec::new(),
        })
    }

    /// Adds transforms of `/tf`, or of `/tf_static`, at the time of the first of them.
    ///
    /// # Errors
    /// Those of the output.
    pub fn transforms(&mut self, message: &TfMessage, is_static: bool) -> io::Result<()> {
        let Some(first) = message.transforms.first() else { return Ok(()) };
        let channel = if is_static { &mut self.static_transforms } else { &mut self.transforms };
        put(&mut self.writer, &mut self.scratch, channel, logged(&first.header), message)
    }

    /// Adds a cloud at the time of its header.
    ///
    /// # Errors
    /// Those of the output.
    pub fn points(&mut self, message: &PointCloud2) -> io::Result<()> {
        put(&mut self.writer, &mut self.scratch, &mut self.points, logged(&message.header), message)
    }

    /// Writes the indexes and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.writer.finish().map_err(io::Error::other)?;
        Ok(self.writer.into_inner().into_inner())
    }
}
