//! What pictures and surfaces need of the scene of a recording.

use std::iter;
use std::ops::Range;

use crate::appearance::Appearance;
use crate::cloud::Cloud;
use crate::excerpt::select;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Problem, Setup};

/// The scene of a recording, and which of its particles are recorded.
#[derive(Debug)]
pub struct Scenery {
    pub(crate) setup: Setup,
    pub(crate) appearance: Appearance,
    /// The body of each point, those included that sources have yet to emit.
    bodies: Vec<u32>,
}

/// The recording and its scene do not agree.
#[derive(Debug, thiserror::Error)]
#[error("the recording has {points} points in a frame, and its scene makes {most}: they do not belong together")]
pub struct OtherScene {
    points: usize,
    most: usize,
}

impl Scenery {
    /// Of the problem that the recording's scene makes.
    pub fn new(Problem { setup, particles }: Problem) -> Self {
        let recorded = select(setup.total_particles(), setup.preview_points, setup.seed);
        let mut runs = runs(&setup, &particles);
        let mut run = runs.next();
        let body = |id: u32| {
            while run.as_ref().is_some_and(|(ids, _)| ids.end <= u64::from(id)) {
                run = runs.next();
            }
            run.as_ref().map_or(0, |(_, body)| *body)
        };
        let bodies = recorded.into_iter().map(body).collect();
        let appearance = Appearance::new(&setup, &particles);
        drop(runs);
        Self { setup, appearance, bodies }
    }

    /// 2 or 3.
    pub fn dimension(&self) -> usize {
        self.setup.dimension
    }

    /// Names of the bodies and sources, by number.
    pub fn names(&self) -> Vec<String> {
        self.setup.bodies.iter().map(|body| body.name.clone()).collect()
    }

    /// The body of each point of a frame.
    pub(crate) fn bodies(&self, cloud: &Cloud) -> Result<&[u32], OtherScene> {
        let (points, most) = (cloud.len(), self.bodies.len());
        // Sources have yet to emit some of them.
        let fits = points == most || (points < most && !self.setup.sources.is_empty());
        if fits { Ok(&self.bodies[..points]) } else { Err(OtherScene { points, most }) }
    }

    /// The factor by which particles are larger that stand for all, where only some of `chosen` of the recorded points
    /// are shown.
    pub(crate) fn growth(&self, shown: usize, chosen: usize) -> f64 {
        let recorded = self.bodies.len().max(1) as f64 * shown.max(1) as f64 / chosen.max(1) as f64;
        (self.setup.total_particles() as f64 / recorded).powf(1.0 / self.setup.dimension as f64)
    }
}

/// Bodies of all particles, by their ids: those that are there at time 0, then what sources emit, frame by frame.
fn runs<'a>(setup: &'a Setup, particles: &'a Particles) -> impl Iterator<Item = (Range<u64>, u32)> + 'a {
    let first = particles.body.iter().map(|body| (1, *body));
    let frames = setup.sources.iter().map(|source| source.by_frame.len()).max().unwrap_or(0);
    let emitted = (0..frames).flat_map(|frame| {
        setup.sources.iter().map(move |source| (source.by_frame.get(frame).copied().unwrap_or(0), source.body as u32))
    });
    let mut next = 0;
    iter::from_fn({
        let mut all = first.chain(emitted);
        move || {
            let (count, body) = all.next()?;
            let ids = next..next + count;
            next = ids.end;
            Some((ids, body))
        }
    })
}
