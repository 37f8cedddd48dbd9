//! What the colours of a picture mean, on a strip below it.

use super::look::Bounds;
use super::text::Font;
use super::{Image, color};
use crate::palette::{Rgb, to_srgb};

const PAPER: [u8; 3] = [250, 250, 251];
const INK: [u8; 3] = [40, 44, 52];
const LINE: [u8; 3] = [120, 126, 136];

pub enum Legend {
    Scale {
        field: String,
        unit: &'static str,
        bounds: Bounds,
        /// Whether there are values below and above.
        ends: [bool; 2],
    },
    /// Names and colours.
    Bodies(Vec<(String, Rgb)>),
}

/// Height of the strip of a picture of this size; none where it would take too much.
pub fn height([width, height]: [usize; 2]) -> usize {
    let line = Font::of(height).height();
    if height < 6 * line || width < 12 * line { 0 } else { line * 11 / 4 }
}

impl Legend {
    /// The picture with a strip that makes it so high.
    pub fn below(&self, mut image: Image, height: usize, time_s: f64) -> Image {
        let [width, top] = image.size;
        if height == top {
            return image;
        }
        image.rgb.extend(PAPER.iter().cycle().take(3 * width * (height - top)));
        image.size[1] = height;
        let font = Font::of(height);
        let (line, margin) = (font.height(), font.height() * 3 / 4);
        let time = format!("t = {} s", short(time_s));
        let middle = top + (height - top - line) / 2;
        let right = width - margin - font.width(&time);
        font.write(&mut image, &time, [right, middle], INK);
        let room = right - 2 * margin;
        match self {
            Self::Bodies(bodies) => swatches(&mut image, font, bodies, [margin, middle], room),
            Self::Scale { field, unit, bounds, ends } => {
                let (factor, unit) = unit_of(unit, bounds);
                let name = if unit.is_empty() { field.clone() } else { format!("{field} ({unit})") };
                let name = font.fitting(&name, room / 2);
                font.write(&mut image, &name, [margin, middle], INK);
                let left = margin + font.width(&name) + 2 * margin;
                let bar = [left, top + line / 2];
                scale(&mut image, font, (bounds, *ends, factor), bar, room.saturating_sub(left + margin));
            }
        }
        image
    }
}

/// A square of each colour, and its name.
fn swatches(image: &mut Image, font: Font, bodies: &[(String, Rgb)], [mut x, y]: [usize; 2], room: usize) {
    let line = font.height();
    for (k, (name, rgb)) in bodies.iter().enumerate() {
        let more = format!("+{}", bodies.len() - k);
        let reserve = if k + 1 < bodies.len() { font.width(&more) + line } else { 0 };
        let name = font.fitting(name, room / 3);
        if x + line * 3 / 2 + font.width(&name) + reserve > room {
            font.write(image, &more, [x, y], INK);
            return;
        }
        fill(image, [x, y + line / 8], [line * 3 / 4; 2], rgb.map(to_srgb));
        font.write(image, &name, [x + line, y], INK);
        x += line * 2 + font.width(&name);
    }
}

/// The colours, with numbers below them. Ends point outwards where values lie beyond them.
fn scale(
    image: &mut Image,
    font: Font,
    (bounds, ends, factor): (&Bounds, [bool; 2], f64),
    [left, top]: [usize; 2],
    width: usize,
) {
    let high = font.height() * 5 / 8;
    let span = bounds.high - bounds.low;
    for column in 0..width {
        let share = (column as f64 + 0.5) / width as f64;
        let rgb = color(bounds, bounds.low + span * share);
        fill(image, [left + column, top], [1, high], rgb);
    }
    for (k, beyond) in ends.into_iter().enumerate().filter(|(_, beyond)| *beyond).collect::<Vec<_>>() {
        debug_assert!(beyond);
        let rgb = color(bounds, if k == 0 { bounds.low } else { bounds.high });
        for step in 1..=high / 2 {
            let x = if k == 0 { left - step } else { left + width - 1 + step };
            fill(image, [x, top + step], [1, high - 2 * step], rgb);
        }
    }
    let most = (width / font.width("-0.0000 ")).max(2);
    let mut free = 0;
    for tick in ticks(bounds.low / factor, bounds.high / factor, most) {
        let x = left + ((tick * factor - bounds.low) / span * (width.max(1) - 1) as f64).round() as usize;
        let text = short(tick);
        let start = x.saturating_sub(font.width(&text) / 2);
        if start >= free {
            fill(image, [x, top + high], [1, font.height() / 5], LINE);
            font.write(image, &text, [start, top + high + font.height() / 8], INK);
            free = start + font.width(&text) + font.width(" ") / 2;
        }
    }
}

fn fill(image: &mut Image, [x, y]: [usize; 2], [width, height]: [usize; 2], rgb: [u8; 3]) {
    for row in y..y + height {
        (x..x + width).for_each(|column| image.cover([column, row], rgb, 1.0));
    }
}

/// At most about `most` round numbers within two.
fn ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    let rough = (high - low) / most as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| *step >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let slack = 1e-9 * (high - low);
    let (first, last) = (((low - slack) / step).ceil(), ((high + slack) / step).floor());
    // Zero has no sign, and 3 × 0.1 is 0.3.
    let rounded = |k: f64| format!("{:.*}", (2.0 - step.log10().floor()).clamp(0.0, 12.0) as usize, k * step);
    (0..=(last - first).max(0.0) as usize)
        .map(|k| rounded(first + k as f64).parse::<f64>().unwrap_or(0.0) + 0.0)
        .collect()
}

/// A number with at most four digits.
fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&x.abs()) {
        let text = format!("{x:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", trimmed(digits));
    }
    let before = x.abs().log10().floor() as i32;
    trimmed(&format!("{x:.*}", (3 - before).clamp(0, 6) as usize)).to_owned()
}

/// Without zeros at the end.
fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

/// What values are divided by to be short, and the unit that they then have.
fn unit_of(unit: &str, bounds: &Bounds) -> (f64, String) {
    let most = bounds.low.abs().max(bounds.high.abs());
    match unit {
        "Pa" => {
            let prefixes = [(1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa")];
            let (factor, name) = prefixes.into_iter().find(|(factor, _)| most >= *factor).unwrap_or((1.0, "Pa"));
            (factor, name.to_owned())
        }
        "1" => (1.0, String::new()),
        unit => (1.0, unit.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_below_the_bar() {
        assert_eq!(ticks(0.0, 1.0, 5), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(ticks(-0.31, 0.34, 4), [-0.2, 0.0, 0.2]);
        assert_eq!(ticks(1203.0, 4810.0, 4), [2000.0, 3000.0, 4000.0]);
        assert_eq!([0.0, 0.3, 1500.0, 2.5e-6, -1e7, 12.5].map(short), ["0", "0.3", "1500", "2.5e-6", "-1e7", "12.5"]);
        let bounds = Bounds { low: -2.0, high: 3.2e5 };
        assert_eq!(unit_of("Pa", &bounds), (1e3, "kPa".into()));
        assert_eq!(unit_of("1", &bounds), (1.0, String::new()));
    }
}
