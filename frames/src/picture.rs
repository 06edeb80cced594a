//! Pictures: from linear light to PNG and OpenEXR, and how two of them differ.

use exr::image::write::WritableImage as _;
use hankel_dsl::glam::Vec4;
use hankel_system::output::{Output, OutputError};

use super::error::{FrameError, Result};

/// A picture: 8-bit sRGB without alpha, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels of red, green, blue.
    pub pixels: Vec<[u8; 3]>,
}

/// sRGB's transfer function (IEC 61966-2-1), from linear light in [0, 1] to 8 bits.
fn encode(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let y = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (y * 255.0).round() as u8
}

impl Picture {
    /// Encodes linear light; what is beyond [0, 1] is clamped, NaN becomes black. `linear` has
    /// `width * height` pixels; alpha is passed over.
    #[must_use]
    pub fn from_linear(width: u32, height: u32, linear: impl Iterator<Item = Vec4>) -> Self {
        let pixels = linear.map(|c| [c.x, c.y, c.z].map(encode)).collect();
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// [`FrameError::Write`].
    pub fn save(&self, output: Output) -> Result<()> {
        let png = self
            .png()
            .map_err(|e| OutputError::write(output.path(), e))?;
        Ok(output.finish(&png)?)
    }

    fn png(&self) -> std::result::Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }

    /// How `other` differs from this picture. The difference picture shows absolute differences
    /// times `amplification`.
    ///
    /// # Errors
    /// [`FrameError::Sizes`] unless both have the same size.
    pub fn difference(&self, other: &Self, amplification: u32) -> Result<Difference> {
        if (self.width, self.height) != (other.width, other.height) {
            return Err(FrameError::Sizes {
                left: [self.width, self.height],
                right: [other.width, other.height],
            });
        }
        let mut pixels = Vec::with_capacity(self.pixels.len());
        let (mut largest, mut sum, mut squares) = (0_u8, 0_u64, 0_u64);
        let mut over = [0_u64; 2];
        for (a, b) in self.pixels.iter().zip(&other.pixels) {
            let d: [u8; 3] = std::array::from_fn(|i| a[i].abs_diff(b[i]));
            let worst = d[0].max(d[1]).max(d[2]);
            largest = largest.max(worst);
            for x in d {
                sum += u64::from(x);
                squares += u64::from(x) * u64::from(x);
            }
            over[0] += u64::from(worst > 1);
            over[1] += u64::from(worst > 8);
            pixels.push(d.map(|x| u32::from(x).saturating_mul(amplification).min(255) as u8));
        }
        let count = (self.pixels.len().max(1)) as f64;
        let rmse = (squares as f64 / (3.0 * count)).sqrt() / 255.0;
        Ok(Difference {
            picture: Self {
                width: self.width,
                height: self.height,
                pixels,
            },
            amplification,
            largest: f64::from(largest) / 255.0,
            mean: sum as f64 / (3.0 * count) / 255.0,
            rmse,
            psnr: if rmse > 0.0 {
                Some(-20.0 * rmse.log10())
            } else {
                None
            },
            over_1: over[0] as f64 / count,
            over_8: over[1] as f64 / count,
        })
    }
}

/// Linear light, as it was drawn: red, green, blue, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels; alpha is passed over.
    pub pixels: Vec<Vec4>,
}

impl Linear {
    /// The same as it is shown.
    #[must_use]
    pub fn picture(&self) -> Picture {
        Picture::from_linear(self.width, self.height, self.pixels.iter().copied())
    }

    /// Writes an OpenEXR file of 32-bit floats, compressed without loss.
    ///
    /// # Errors
    /// [`FrameError::Write`].
    pub fn save(&self, output: Output) -> Result<()> {
        let exr = self
            .exr()
            .map_err(|e| OutputError::write(output.path(), std::io::Error::other(e)))?;
        Ok(output.finish(&exr)?)
    }

    fn exr(&self) -> exr::error::Result<Vec<u8>> {
        let width = self.width as usize;
        let pixel = |at: exr::math::Vec2<usize>| {
            let c = self.pixels.get(at.y() * width + at.x());
            let c = c.copied().unwrap_or_default();
            (c.x, c.y, c.z)
        };
        let channels = exr::image::SpecificChannels::rgb(pixel);
        let image = exr::image::Image::from_channels((width, self.height as usize), channels);
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes)?;
        Ok(bytes.into_inner())
    }
}

/// How two pictures differ. Values of a channel count as 0 to 1.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Absolute differences, amplified.
    #[serde(skip)]
    pub picture: Picture,
    /// By how much.
    pub amplification: u32,
    /// Largest difference of a channel.
    pub largest: f64,
    /// Mean difference of all channels.
    pub mean: f64,
    /// Root of the mean squared difference of all channels.
    pub rmse: f64,
    /// Peak signal-to-noise ratio in decibels; `None` (infinite) for equal pictures.
    pub psnr: Option<f64>,
    /// Share of pixels with a channel that differs by more than 1/255.
    pub over_1: f64,
    /// Share of pixels with a channel that differs by more than 8/255.
    pub over_8: f64,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "largest {:.4}, mean {:.6}, rmse {:.6}, ",
            self.largest, self.mean, self.rmse
        )?;
        match self.psnr {
            Some(psnr) => write!(f, "psnr {psnr:.1} dB")?,
            None => write!(f, "psnr infinite")?,
        }
        write!(
            f,
            ", pixels over 1/255: {:.3} %, over 8/255: {:.3} %",
            self.over_1 * 100.0,
            self.over_8 * 100.0
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: &[u8]) -> Picture {
        Picture {
            width: values.len() as u32,
            height: 1,
            pixels: values.iter().map(|&v| [v; 3]).collect(),
        }
    }

    #[test]
    fn differences_are_counted() {
        let d = grey(&[0, 10, 20, 30])
            .difference(&grey(&[0, 11, 22, 130]), 4)
            .unwrap();
        assert_eq!(d.picture.pixels, [[0; 3], [4; 3], [8; 3], [255; 3]]);
        assert_eq!((d.over_1, d.over_8), (0.5, 0.25));
        assert!((d.largest - 100.0 / 255.0).abs() < 1e-12);
        assert!((d.mean - 103.0 / 4.0 / 255.0).abs() < 1e-12);
        let rmse = (10005.0_f64 / 4.0).sqrt() / 255.0;
        assert!((d.rmse - rmse).abs() < 1e-12);
        assert!((d.psnr.unwrap() + 20.0 * rmse.log10()).abs() < 1e-9);
        assert_eq!(grey(&[1]).difference(&grey(&[1]), 4).unwrap().psnr, None);
        assert!(grey(&[1]).difference(&grey(&[1, 2]), 4).is_err());
    }

    #[test]
    fn srgb_has_its_known_values() {
        let codes = [0.0, 0.001, 0.215_860_5, 1.0, f32::NAN, -1.0, 9.0].map(encode);
        assert_eq!(codes, [0, 3, 128, 255, 0, 0, 255]);
    }

    #[test]
    fn a_png_holds_the_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.png");
        let picture = grey(&[1, 2, 250]);
        picture.save(Output::create(&file, &[]).unwrap()).unwrap();
        let mut reader =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&file).unwrap()))
                .read_info()
                .unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(bytes, picture.pixels.as_flattened());
    }
}
