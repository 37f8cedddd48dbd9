//! Pictures and films of recordings, drawn from the recorded points and the scene that the recording carries.

mod film;
mod legend;
mod look;
mod text;

use rayon::prelude::*;

use crate::appearance::local;
use crate::cloud::{Cloud, unit};
use crate::excerpt::select;
use crate::export::ExportError;
use crate::files::RecordingError;
use crate::palette::{Palette, Rgb, from_srgb};
use crate::picture::{Brush, Quality, STILL, View, draw};
use crate::scenery::{OtherScene, Scenery};
use legend::Legend;

pub use crate::picture::{Aim, Image};
pub use film::{Film, Format};
pub use look::{Bounds, Look, Size};

/// Gloss of particles that show a field.
const MATT: f32 = 0.08;
/// Colour of what is not a number (sRGB).
const UNKNOWN: [u8; 3] = [150, 150, 150];
/// Share of the points whose values may lie beyond the range of colours at each end.
const BEYOND: f64 = 0.005;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    #[error("camera: {0}")]
    Camera(String),
    #[error("the points have no field \"{field}\"; they have {}", known.join(", "))]
    NoField { field: String, known: Vec<String> },
    #[error(transparent)]
    OtherScene(#[from] OtherScene),
    /// What the file cannot be.
    #[error("{0}")]
    Film(String),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// What gives points their colours.
#[derive(Clone, Debug, PartialEq)]
enum ColorBy {
    /// Nothing but the recording.
    Recorded,
    Body,
    Field(String),
}

/// Draws frames of one recording, all from the same place.
pub struct Renderer<'a> {
    scenery: &'a Scenery,
    view: View,
    palette: Palette,
    size: [usize; 2],
    color_by: ColorBy,
    bounds: Option<Bounds>,
    /// Whether the points of a body are drawn.
    drawn: Vec<bool>,
}

impl<'a> Renderer<'a> {
    /// A renderer of the recording that carries this scene.
    ///
    /// # Errors
    /// When the scene has no such body, or no use for such a camera.
    pub fn new(scenery: &'a Scenery, look: &Look) -> Result<Self, RenderError> {
        let (setup, known) = (&scenery.setup, scenery.names());
        look.aim.suits(setup.dimension).map_err(RenderError::Camera)?;
        let mut drawn = vec![look.bodies.is_empty(); known.len()];
        for name in &look.bodies {
            let number = known.iter().position(|known| known == name);
            drawn[number.ok_or_else(|| ExportError::NoBody { name: name.clone(), known: known.clone() })?] = true;
        }
        let color_by = match look.color_by.as_deref() {
            None => ColorBy::Recorded,
            Some("body") => ColorBy::Body,
            Some(field) => ColorBy::Field(field.to_owned()),
        };
        let size = look.size.pixels();
        let strip = if color_by == ColorBy::Recorded { 0 } else { legend::height(size) };
        let quality = Quality {
            size: [size[0], size[1] - strip],
            shadows: size[0].max(size[1]).clamp(STILL.shadows / 2, 2 * STILL.shadows),
            ..STILL
        };
        Ok(Self {
            scenery,
            view: View::of(setup, scenery.appearance.focus, &quality, &look.aim),
            palette: Palette::new(setup, &scenery.appearance),
            size,
            color_by,
            bounds: look.bounds,
            drawn,
        })
    }

    /// Whether the colours of a film need [`Self::bounds`] of all its frames first.
    pub fn wants_bounds(&self) -> bool {
        self.bounds.is_none() && matches!(self.color_by, ColorBy::Field(_))
    }

    /// The values that get the first and the last colour if a frame is drawn by itself: those of almost all points.
    /// `None` without a finite value.
    ///
    /// # Errors
    /// When the points do not have the field.
    pub fn bounds(&self, cloud: &Cloud) -> Result<Option<Bounds>, RenderError> {
        let ColorBy::Field(field) = &self.color_by else { return Ok(None) };
        let points = self.points(cloud)?;
        let values = values(cloud, field)?;
        let mut finite: Vec<f32> =
            points.iter().map(|(k, _)| values[*k as usize]).filter(|value| value.is_finite()).collect();
        if finite.is_empty() {
            return Ok(None);
        }
        let n = finite.len();
        let out = ((n as f64 * BEYOND) as usize).min(n - 1);
        let mut at = |k: usize| f64::from(*finite.select_nth_unstable_by(k, f32::total_cmp).1);
        Ok(Some(Bounds { low: at(out), high: at(n - 1 - out) }.reaching_zero()))
    }

    /// A frame; with `bounds` for the colours where the look has none.
    ///
    /// # Errors
    /// When the points do not have the field, or are not those of the scene.
    pub fn draw(&self, cloud: &Cloud, bounds: Option<Bounds>) -> Result<Image, RenderError> {
        let (setup, points) = (&self.scenery.setup, self.points(cloud)?);
        let (paint, legend) = self.paint(cloud, &points, bounds)?;
        let most = self.brushed(&points);
        let exact = matches!(self.color_by, ColorBy::Field(_));
        let brush = Brush::new(setup, self.scenery.growth(most.len(), points.len()), exact);
        let position = cloud.positions();
        let ball = |&(k, body): &(u32, u32)| {
            let x = position(cloud.point(k as usize));
            brush.ball(local(setup, x), body, k, paint(k as usize, body))
        };
        let balls: Vec<_> = most.par_iter().map(ball).collect();
        let image = draw(setup, &self.view, &balls, cloud.time_s());
        Ok(match legend {
            Some(legend) => legend.below(image, self.size[1], cloud.time_s()),
            None => image,
        })
    }

    /// The points that are drawn, with their bodies.
    fn points(&self, cloud: &Cloud) -> Result<Vec<(u32, u32)>, RenderError> {
        let bodies = self.scenery.bodies(cloud)?;
        let all = bodies.iter().enumerate().map(|(k, body)| (k as u32, *body));
        Ok(all.filter(|(_, body)| self.drawn[*body as usize]).collect())
    }

    /// Not more of them than pictures show.
    fn brushed(&self, points: &[(u32, u32)]) -> Vec<(u32, u32)> {
        let chosen = select(points.len(), STILL.particles, self.scenery.setup.seed);
        chosen.into_iter().map(|k| points[k as usize]).collect()
    }

    /// How to colour a point of a body, with its gloss, and what the colours mean.
    fn paint(
        &self,
        cloud: &Cloud,
        points: &[(u32, u32)],
        bounds: Option<Bounds>,
    ) -> Result<(Box<Paint>, Option<Legend>), RenderError> {
        let palette = self.palette.clone();
        Ok(match &self.color_by {
            ColorBy::Recorded => {
                let colors = cloud.colors();
                let paint = move |k: usize, body: u32| {
                    let recorded = colors.as_ref().map(|colors: &Vec<[u8; 3]>| colors[k].map(from_srgb));
                    (recorded.unwrap_or_else(|| palette.color(body, 0.0)), palette.gloss(body))
                };
                (Box::new(paint) as Box<Paint>, None)
            }
            ColorBy::Body => {
                let named = self.scenery.setup.bodies.iter().zip(0..).filter(|(_, k)| self.drawn[*k as usize]);
                let swatches = named.map(|(body, k)| (body.name.clone(), palette.color(k, 0.0))).collect();
                let paint = move |_: usize, body: u32| (palette.color(body, 0.0), palette.gloss(body));
                (Box::new(paint), Some(Legend::Bodies(swatches)))
            }
            ColorBy::Field(field) => {
                let values = values(cloud, field)?;
                let bounds = self.bounds.or(bounds).map_or_else(|| self.bounds(cloud), |bounds| Ok(Some(bounds)))?;
                let bounds = bounds.unwrap_or(Bounds { low: 0.0, high: 1.0 }).widened();
                let beyond = |at: fn(&Bounds, f64) -> bool| {
                    points.par_iter().any(|(k, _)| at(&bounds, f64::from(values[*k as usize])))
                };
                let ends = [beyond(|bounds, value| value < bounds.low), beyond(|bounds, value| value > bounds.high)];
                let paint = move |k: usize, _: u32| (color(&bounds, f64::from(values[k])).map(from_srgb), MATT);
                let legend = Legend::Scale { field: field.clone(), unit: unit(field), bounds, ends };
                (Box::new(paint), Some(legend))
            }
        })
    }
}

/// Colour and gloss of a point of a body.
type Paint = dyn Fn(usize, u32) -> (Rgb, f32) + Send + Sync;

fn values(cloud: &Cloud, field: &str) -> Result<Vec<f32>, RenderError> {
    cloud.values(field).ok_or_else(|| {
        let known = cloud.fields().into_iter().filter(|known| *known != "body").chain(["body"]);
        RenderError::NoField { field: field.to_owned(), known: known.map(String::from).collect() }
    })
}

/// The colour of a value (sRGB): viridis, in which equal steps look equal.
fn color(bounds: &Bounds, value: f64) -> [u8; 3] {
    if !value.is_finite() {
        return UNKNOWN;
    }
    let share = ((value - bounds.low) / (bounds.high - bounds.low)).clamp(0.0, 1.0);
    colorous::VIRIDIS.eval_continuous(share).into_array()
}

#[cfg(test)]
mod tests;
