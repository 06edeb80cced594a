//! Times by the GPU's own clock: a timestamp before and one after each dispatch, draw, clear and copy.

use std::cell::Cell;
use std::ops::Range;

use super::VulkanDevice;
use crate::device::Device;
use crate::device::error::Result;

/// What an adapter must have: timestamps between passes.
pub const FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// Bytes of a timestamp.
const BYTES: usize = 8;

/// Timestamps of what ran since [`VulkanDevice::begin_clock`].
#[derive(Debug)]
pub struct Clock {
    timestamps: wgpu::QuerySet,
    /// How many are written.
    written: Cell<u32>,
}

impl Clock {
    /// Numbers of the next two timestamps, `None` if all are written.
    fn next(&self) -> Option<Range<u32>> {
        let first = self.written.get();
        let last = first + 1;
        if last >= wgpu::QUERY_SET_MAX_QUERIES {
            return None;
        }
        self.written.set(last + 1);
        Some(first..last)
    }
}

impl VulkanDevice {
    /// Encodes `work`, timed if a clock runs.
    pub(super) fn timed(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        work: impl FnOnce(&mut wgpu::CommandEncoder),
    ) {
        let lap = self.clock.as_ref().and_then(|it| Some((it, it.next()?)));
        if let Some((clock, lap)) = &lap {
            encoder.write_timestamp(&clock.timestamps, lap.start);
        }
        work(encoder);
        if let Some((clock, lap)) = &lap {
            encoder.write_timestamp(&clock.timestamps, lap.end);
        }
    }

    /// Whether times are taken by timestamps. Not of a driver that runs on the processor, unless
    /// [`Self::time_by_timestamps`] asked for it: lavapipe 22.3 writes the second one before a dispatch is
    /// done. Its wall time is right.
    #[must_use]
    pub fn has_clock(&self) -> bool {
        self.has_timestamps() && (self.is_gpu() || self.by_timestamps)
    }

    /// Whether the adapter can write timestamps.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(FEATURES)
    }

    /// Takes times by timestamps even of a driver that runs on the processor.
    pub const fn time_by_timestamps(&mut self) {
        self.by_timestamps = true;
    }

    /// Starts a clock. `false` if there is none.
    pub(super) fn begin_clock(&mut self) -> Result<bool> {
        if !self.has_clock() {
            return Ok(false);
        }
        if let Some(clock) = &self.clock {
            clock.written.set(0);
            return Ok(true);
        }
        let timestamps = self.guarded(&|| "making timestamps".into(), |device| {
            device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: wgpu::QUERY_SET_MAX_QUERIES,
            })
        })?;
        self.clock = Some(Clock {
            timestamps,
            written: Cell::new(0),
        });
        Ok(true)
    }

    /// How many times there are.
    pub(super) fn laps(&self) -> usize {
        self.clock
            .as_ref()
            .map_or(0, |it| it.written.get() as usize / 2)
    }

    /// Waits, and stops the clock: seconds between each pair of timestamps.
    pub(super) fn end_clock(&mut self) -> Result<Vec<f64>> {
        let during = || "reading timestamps".to_owned();
        let Some(clock) = self.clock.take() else {
            return Ok(Vec::new());
        };
        let written = clock.written.get();
        if written == 0 {
            return Ok(Vec::new());
        }
        let size = u64::from(written) * BYTES as u64;
        let resolved = self.guarded(&during, |device| {
            let resolved = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            encoder.resolve_query_set(&clock.timestamps, 0..written, &resolved, 0);
            self.queue.submit([encoder.finish()]);
            resolved
        })?;
        let bytes = self.download(&resolved, size, "timestamps")?;
        let nanoseconds = f64::from(self.queue.get_timestamp_period());
        let (words, _) = bytes.as_chunks::<BYTES>();
        let ticks = |word: &[u8; BYTES]| u64::from_le_bytes(*word);
        Ok(words
            .chunks_exact(2)
            .map(|pair| {
                // A clock of few bits may have begun anew in between.
                ticks(&pair[1]).saturating_sub(ticks(&pair[0])) as f64 * nanoseconds * 1e-9
            })
            .collect())
    }
}
