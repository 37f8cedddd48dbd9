//! The last state of a run, as `gridfall_recording::state` writes it.

use gridfall_core::sim::particles::{IDENTITY, Particles};

use crate::npz::{self, Array, is_npz};

/// The particles of a state, in sampling order.
///
/// # Errors
/// What is wrong with the file.
pub fn read(bytes: &[u8], dimension: usize) -> Result<Particles, String> {
    if !is_npz(bytes) {
        return Err("it is no npz".into());
    }
    let mut archive = npz::open(bytes)?;
    let mut array = |name: &str| -> Result<Array, String> {
        npz::array(&mut archive, name)?.ok_or_else(|| format!("it lacks the array `{name}`"))
    };
    let x = array("x")?;
    let n = x.shape.first().copied().unwrap_or(0);
    let scalars = |array: Array, name: &str| array.expect(name, &[n]).map(|()| array.values);
    let particles = Particles {
        x: x.vectors("x", n, dimension)?,
        v: array("v")?.vectors("v", n, dimension)?,
        b: array("B")?.matrices("B", n, dimension, [0.0; 9])?,
        f: array("F")?.matrices("F", n, dimension, IDENTITY)?,
        plastic: scalars(array("plastic")?, "plastic")?,
        body: scalars(array("body")?, "body")?.into_iter().map(|body| body as u32).collect(),
        touch: Vec::new(),
    };
    let Particles { x, v, b, f, plastic, .. } = &particles;
    for k in 0..x.len() {
        let mut numbers = x[k].iter().chain(&v[k]).chain(&b[k]).chain(&f[k]).chain([&plastic[k]]);
        if !numbers.all(|number| number.is_finite()) {
            return Err(format!("the state of particle {k} is not finite"));
        }
    }
    Ok(particles)
}
