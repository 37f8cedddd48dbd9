//! Writing on pictures.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::picture::Image;

/// Letters of one height.
#[derive(Clone, Copy, Debug)]
pub struct Font(RasterHeight);

impl Font {
    /// Fit for a picture of this height (pixels).
    pub fn of(height: usize) -> Self {
        Self(match height {
            0..400 => RasterHeight::Size16,
            400..720 => RasterHeight::Size20,
            720..1080 => RasterHeight::Size24,
            _ => RasterHeight::Size32,
        })
    }

    /// Height of a line (pixels).
    pub fn height(self) -> usize {
        self.0.val()
    }

    /// Width of a text (pixels).
    pub fn width(self, text: &str) -> usize {
        get_raster_width(FontWeight::Regular, self.0) * text.chars().count()
    }

    /// The text, or its beginning, in at most this width (pixels).
    pub fn fitting(self, text: &str, width: usize) -> String {
        if self.width(text) <= width {
            return text.to_owned();
        }
        let most = width / self.width("x");
        text.chars().take(most.saturating_sub(2)).chain("..".chars().take(most)).collect()
    }

    /// Writes a text whose upper left corner is at (x, y). What is beyond the picture is left out.
    pub fn write(self, image: &mut Image, text: &str, [x, y]: [usize; 2], color: [u8; 3]) {
        let step = self.width("x");
        for (k, letter) in text.chars().enumerate() {
            let raster = get_raster(letter, FontWeight::Regular, self.0)
                .or_else(|| get_raster('?', FontWeight::Regular, self.0))
                .expect("the font has question marks");
            for (row, line) in raster.rows().enumerate() {
                for (column, share) in line.iter().enumerate() {
                    image.cover([x + k * step + column, y + row], color, f32::from(*share) / 255.0);
                }
            }
        }
    }
}
