//! Curves as pictures (SVG).

use std::ops::Range;

use plotters::prelude::*;

/// One curve, or measured points.
pub struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
    pub measured: bool,
}

/// A diagram.
pub struct Panel {
    /// Name of the column.
    pub column: String,
    pub series: Vec<Series>,
}

const PANEL: (u32, u32) = (460, 360);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 99, 168), RGBColor(200, 80, 30), RGBColor(40, 130, 70), RGBColor(120, 60, 150)];
const FONT: &str = "sans-serif";

/// Draws panels side by side, all against the strain.
pub fn svg(title: &str, panels: &[Panel]) -> Result<String, String> {
    let mut text = String::new();
    draw(&mut text, title, panels).map_err(|error| error.to_string())?;
    Ok(text)
}

fn draw(text: &mut String, title: &str, panels: &[Panel]) -> Result<(), Box<dyn std::error::Error>> {
    let size = (PANEL.0 * panels.len() as u32, PANEL.1 + 34);
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, (FONT, 18))?;
    for (area, panel) in root.split_evenly((1, panels.len())).iter().zip(panels) {
        let points = || panel.series.iter().flat_map(|series| &series.points);
        let (unit, scale) = unit(&panel.column, points().map(|point| point.1.abs()).fold(0.0, f64::max));
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .margin_right(22)
            .x_label_area_size(38)
            .y_label_area_size(62)
            .build_cartesian_2d(range(points().map(|point| point.0)), range(points().map(|point| point.1 / scale)))?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .axis_desc_style((FONT, 13))
            .label_style((FONT, 12))
            .x_labels(6)
            .y_labels(7)
            .x_label_formatter(&|x| short(*x))
            .y_label_formatter(&|y| short(*y))
            .x_desc("strain")
            .y_desc(format!("{}{unit}", panel.column.replace('_', " ")))
            .draw()?;
        for (n, series) in panel.series.iter().enumerate() {
            let colour = COLOURS[n % COLOURS.len()];
            let points = series.points.iter().map(|(x, y)| (*x, y / scale));
            if series.measured {
                chart
                    .draw_series(points.map(|point| Circle::new(point, 3, colour.stroke_width(1))))?
                    .label(&series.name)
                    .legend(move |(x, y)| Circle::new((x + 9, y), 3, colour.stroke_width(1)));
            } else {
                chart
                    .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                    .label(&series.name)
                    .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
            }
        }
        if panel.series.len() > 1 {
            // Where the curves do not end.
            let falls = points().last().is_some_and(|point| point.1 < 0.0);
            chart
                .configure_series_labels()
                .position(if falls { SeriesLabelPosition::UpperRight } else { SeriesLabelPosition::LowerRight })
                .background_style(WHITE.mix(0.8))
                .label_font((FONT, 12))
                .draw()?;
        }
    }
    root.present()?;
    Ok(())
}

/// The unit of a column, and what it is in SI units.
fn unit(column: &str, largest: f64) -> (&'static str, f64) {
    if !(column.ends_with("stress") || matches!(column, "p" | "q")) {
        return ("", 1.0);
    }
    match largest {
        x if x >= 2e9 => (" (GPa)", 1e9),
        x if x >= 2e6 => (" (MPa)", 1e6),
        x if x >= 2e3 => (" (kPa)", 1e3),
        _ => (" (Pa)", 1.0),
    }
}

/// From the least to the largest value, 0 included, with some room.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (least, most) = values.fold((0.0f64, 0.0f64), |(least, most), x| (least.min(x), most.max(x)));
    // What is 0 but for rounding is a line in the middle.
    if most - least < 1e-9 {
        return -1.0..1.0;
    }
    let room = 0.05 * (most - least);
    (if least < 0.0 { least - room } else { 0.0 })..(if most > 0.0 { most + room } else { 0.0 })
}

/// A number on an axis, without digits that are rounding.
fn short(x: f64) -> String {
    let text = format!("{x:.5}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_its_curves_and_words() {
        let line = |name: &str, measured| Series { name: name.into(), points: vec![(0.0, 0.0), (0.1, 3e4)], measured };
        let panels = [
            Panel { column: "q".into(), series: vec![line("fitted", false), line("measured", true)] },
            Panel { column: "volumetric_strain".into(), series: vec![line("fitted", false)] },
        ];
        let text = svg("Sand", &panels).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        for word in ["Sand", "q (kPa)", "volumetric strain", "fitted", "measured", "0.04"] {
            assert!(text.contains(word), "{word} is missing");
        }
        assert!(text.contains("<polyline") && text.contains("<circle"));
    }

    #[test]
    fn axes_have_room_and_short_numbers() {
        assert_eq!(range([0.0, 10.0].into_iter()), 0.0..10.5);
        assert_eq!(range([0.0, 1e-18].into_iter()), -1.0..1.0);
        assert_eq!([short(0.30000000000000004), short(-0.0), short(100.0)], ["0.3", "0", "100"]);
    }
}
