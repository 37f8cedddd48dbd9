//! Engines' states as bytes: plain values, one after the other, in the machine's own byte order. Whoever keeps them
//! sees to it that they come back whole, to the same build on the same kind of device.

use std::io::{self, Read, Write};

use bytemuck::Pod;

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::touch::Touch;

/// Of a state that is not one of this problem's.
pub(crate) fn foreign(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the saved state is not of this problem: {what}"))
}

pub(crate) fn put<T: Pod>(to: &mut dyn Write, values: &[T]) -> io::Result<()> {
    to.write_all(bytemuck::cast_slice(values))
}

pub(crate) fn get<T: Pod>(from: &mut dyn Read, count: usize) -> io::Result<Vec<T>> {
    let mut values = vec![T::zeroed(); count];
    get_into(from, &mut values)?;
    Ok(values)
}

pub(crate) fn get_into<T: Pod>(from: &mut dyn Read, values: &mut [T]) -> io::Result<()> {
    from.read_exact(bytemuck::cast_slice_mut(values))
}

pub(crate) fn get_one<T: Pod>(from: &mut dyn Read) -> io::Result<T> {
    Ok(get(from, 1)?[0])
}

/// A number of things, of which there are at most `most`.
pub(crate) fn get_count(from: &mut dyn Read, most: usize, what: &str) -> io::Result<usize> {
    let count: u64 = get_one(from)?;
    usize::try_from(count)
        .ok()
        .filter(|&count| count <= most)
        .ok_or_else(|| foreign(&format!("{count} {what} where there are at most {most}")))
}

/// A time that may not be known.
pub(crate) fn put_time(to: &mut dyn Write, time_s: Option<f64>) -> io::Result<()> {
    put(to, &[time_s.unwrap_or(f64::NAN)])
}

pub(crate) fn get_time(from: &mut dyn Read) -> io::Result<Option<f64>> {
    let time_s: f64 = get_one(from)?;
    Ok((!time_s.is_nan()).then_some(time_s))
}

pub(crate) fn put_reactions(to: &mut dyn Write, reactions: &[Reaction]) -> io::Result<()> {
    reactions.iter().try_for_each(|reaction| put(to, &[reaction.force, reaction.torque]))
}

pub(crate) fn get_reactions(from: &mut dyn Read, reactions: &mut [Reaction]) -> io::Result<()> {
    for reaction in reactions {
        let [force, torque]: [[f64; 3]; 2] = get_one(from)?;
        *reaction = Reaction { force, torque };
    }
    Ok(())
}

pub(crate) fn put_touch(to: &mut dyn Write, touch: &Touch) -> io::Result<()> {
    let [x, y, z] = touch.stretch;
    put(to, &[touch.radius, x, y, z])?;
    put(to, &[touch.with])
}

pub(crate) fn get_touch(from: &mut dyn Read) -> io::Result<Touch> {
    let [radius, x, y, z]: [f64; 4] = get_one(from)?;
    Ok(Touch { radius, stretch: [x, y, z], with: get_one(from)? })
}

/// Particles as an f64 engine has them.
pub(crate) fn put_particles(to: &mut dyn Write, particles: &Particles) -> io::Result<()> {
    let Particles { x, v, b, f, plastic, body, touch } = particles;
    put(to, &[x.len() as u64, touch.len() as u64])?;
    put(to, x)?;
    put(to, v)?;
    put(to, b)?;
    put(to, f)?;
    put(to, plastic)?;
    put(to, body)?;
    touch.iter().try_for_each(|touch| put_touch(to, touch))
}

/// The same, of at most `most`, in `bodies` bodies.
pub(crate) fn get_particles(from: &mut dyn Read, most: usize, bodies: usize) -> io::Result<Particles> {
    let n = get_count(from, most, "particles")?;
    let touched = get_count(from, n, "particles that remember contact")?;
    let particles = Particles {
        x: get(from, n)?,
        v: get(from, n)?,
        b: get(from, n)?,
        f: get(from, n)?,
        plastic: get(from, n)?,
        body: get_bodies(from, n, bodies)?,
        touch: (0..touched).map(|_| get_touch(from)).collect::<io::Result<_>>()?,
    };
    Ok(particles)
}

/// Bodies of `n` particles.
pub(crate) fn get_bodies(from: &mut dyn Read, n: usize, bodies: usize) -> io::Result<Vec<u32>> {
    let body: Vec<u32> = get(from, n)?;
    match body.iter().find(|&&body| body as usize >= bodies) {
        Some(body) => Err(foreign(&format!("a particle of body {body} of {bodies}"))),
        None => Ok(body),
    }
}
