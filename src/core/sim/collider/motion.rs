//! Rigid motion of an obstacle: constant velocities, or keyframes.

use super::{axis_angle, rotate, rotate_back};
use crate::sim::particles::IDENTITY;

/// Tolerance for comparing times (s). Engines accumulate time, and rounding must not make what
/// begins with a frame begin one step late.
pub const TIME_TIE_S: f64 = 1e-9;

/// Position and orientation at an instant: x_world = rotation x_start + translation (row-major).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub rotation: [f64; 9],
    pub translation: [f64; 3],
}

impl Pose {
    /// Maps a point of the body's pose at time 0 to space.
    pub fn to_space(&self, x: [f64; 3]) -> [f64; 3] {
        let x = rotate(&self.rotation, x);
        std::array::from_fn(|a| x[a] + self.translation[a])
    }

    /// Maps a point in space to the body's pose at time 0.
    pub fn to_start(&self, x: [f64; 3]) -> [f64; 3] {
        let t = self.translation;
        rotate_back(&self.rotation, [x[0] - t[0], x[1] - t[1], x[2] - t[2]])
    }
}

/// Offset and rotation of a motion at a given time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keyframe {
    pub time_s: f64,
    /// Offset of the centre from its place at time 0 (m).
    pub offset: [f64; 3],
    /// Angle times axis (rad). All rotations of one motion are about parallel axes.
    pub turn: [f64; 3],
}

/// Rigid motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Centre of rotation at time 0 (m).
    pub center: [f64; 3],
    /// m/s.
    pub linear_velocity: [f64; 3],
    /// rad/s.
    pub angular_velocity: [f64; 3],
    /// Used instead of the velocities unless empty. Linear between keyframes, at rest before the
    /// first and after the last. Times are increasing.
    pub keyframes: Vec<Keyframe>,
}

/// A motion at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    pub pose: Pose,
    /// Current centre of rotation (m).
    pub center: [f64; 3],
    pub linear_velocity: [f64; 3],
    pub angular_velocity: [f64; 3],
}

impl Motion {
    /// The motion at time `t` (s). The instant of a keyframe belongs to the segment that follows
    /// it.
    pub fn at(&self, t: f64) -> Instant {
        let (offset, turn, linear_velocity, angular_velocity) = self.course(t);
        let angle = norm(turn);
        let rotation = if angle == 0.0 { IDENTITY } else { axis_angle(turn.map(|a| a / angle), angle) };
        let turned = rotate(&rotation, self.center);
        let center = std::array::from_fn(|a| self.center[a] + offset[a]);
        let translation = std::array::from_fn(|a| center[a] - turned[a]);
        Instant { pose: Pose { rotation, translation }, center, linear_velocity, angular_velocity }
    }

    /// Position and orientation at time `t` (s).
    pub fn pose(&self, t: f64) -> Pose {
        self.at(t).pose
    }

    /// True if the pose ever changes.
    pub fn moves(&self) -> bool {
        self.velocities().any(|(v, w)| v != [0.0; 3] || w != [0.0; 3])
            || self.keyframes.iter().any(|k| k.offset != [0.0; 3] || k.turn != [0.0; 3])
    }

    /// Linear (m/s) and angular (rad/s) velocity of every segment of the motion.
    pub fn velocities(&self) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
        let constant = self.keyframes.is_empty().then_some((self.linear_velocity, self.angular_velocity));
        constant.into_iter().chain(self.keyframes.windows(2).map(|pair| rates(&pair[0], &pair[1])))
    }

    /// Offset, rotation and their rates.
    fn course(&self, t: f64) -> ([f64; 3], [f64; 3], [f64; 3], [f64; 3]) {
        let (Some(first), Some(last)) = (self.keyframes.first(), self.keyframes.last()) else {
            let (v, w) = (self.linear_velocity, self.angular_velocity);
            return (v.map(|v| v * t), w.map(|w| w * t), v, w);
        };
        let begun = self.keyframes.iter().filter(|k| k.time_s <= t + TIME_TIE_S).count();
        match begun {
            0 => (first.offset, first.turn, [0.0; 3], [0.0; 3]),
            n if n == self.keyframes.len() => (last.offset, last.turn, [0.0; 3], [0.0; 3]),
            n => {
                let (from, to) = (&self.keyframes[n - 1], &self.keyframes[n]);
                let (v, w) = rates(from, to);
                let s = t - from.time_s;
                let along = |start: [f64; 3], rate: [f64; 3]| std::array::from_fn(|a| start[a] + s * rate[a]);
                (along(from.offset, v), along(from.turn, w), v, w)
            }
        }
    }
}

impl Instant {
    /// Velocity (m/s) of the rigid motion at a point in space.
    pub fn velocity_at(&self, x: [f64; 3]) -> [f64; 3] {
        let (v, w) = (self.linear_velocity, self.angular_velocity);
        let r: [f64; 3] = std::array::from_fn(|a| x[a] - self.center[a]);
        [v[0] + w[1] * r[2] - w[2] * r[1], v[1] + w[2] * r[0] - w[0] * r[2], v[2] + w[0] * r[1] - w[1] * r[0]]
    }
}

fn rates(from: &Keyframe, to: &Keyframe) -> ([f64; 3], [f64; 3]) {
    let s = to.time_s - from.time_s;
    let rate = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| (b[k] - a[k]) / s);
    (rate(from.offset, to.offset), rate(from.turn, to.turn))
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keyed() -> Motion {
        let key = |time_s, x, angle: f64| Keyframe { time_s, offset: [x, 0.0, 0.0], turn: [0.0, 0.0, angle] };
        Motion {
            center: [1.0, 2.0, 0.0],
            keyframes: vec![key(0.5, 0.0, 0.0), key(1.0, 0.2, 1.0), key(3.0, 0.2, -1.0)],
            ..Motion::default()
        }
    }

    #[test]
    fn keyframes_are_met_and_held_outside() {
        let motion = keyed();
        for (t, x, angle) in
            [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.75, 0.1, 0.5), (1.0, 0.2, 1.0), (2.0, 0.2, 0.0), (9.0, 0.2, -1.0)]
        {
            let now = motion.at(t);
            assert!((now.center[0] - 1.0 - x).abs() < 1e-15, "{t}: {now:?}");
            let r = &now.pose.rotation;
            assert!((r[3].atan2(r[0]) - angle).abs() < 1e-14, "{t}: {now:?}");
            // The pose moves the centre of rotation correctly.
            let moved = rotate(r, motion.center);
            assert!((0..3).all(|a| (moved[a] + now.pose.translation[a] - now.center[a]).abs() < 1e-14));
        }
        assert_eq!(motion.at(0.2).linear_velocity, [0.0; 3]);
        assert_eq!(motion.at(4.0).angular_velocity, [0.0; 3]);
    }

    #[test]
    fn a_keyframe_begins_in_spite_of_rounding() {
        let motion = keyed();
        let time_s = (0..24).fold(0.0, |t, _| t + 1.0 / 48.0) - 1e-15;
        assert_eq!(motion.at(time_s).linear_velocity, [0.4, 0.0, 0.0]);
        assert_eq!(motion.at(1.0 - 1e-12).angular_velocity, [0.0, 0.0, -1.0]);
    }

    #[test]
    fn velocities_are_the_slopes_of_poses() {
        let motion = keyed();
        let x = [1.3, 1.9, 0.4];
        for t in [0.7, 1.7] {
            let at = |t: f64| {
                let pose = motion.pose(t);
                let moved = rotate(&pose.rotation, x);
                [0, 1, 2].map(|a| moved[a] + pose.translation[a])
            };
            let h = 1e-6;
            let (ahead, behind, v) = (at(t + h), at(t - h), motion.at(t).velocity_at(at(t)));
            assert!((0..3).all(|a| ((ahead[a] - behind[a]) / (2.0 * h) - v[a]).abs() < 1e-8), "at t = {t}");
        }
    }

    #[test]
    fn what_stands_still_does_not_move() {
        assert!(!Motion { center: [1.0; 3], ..Motion::default() }.moves());
        let mut motion = keyed();
        assert!(motion.moves());
        motion.keyframes.iter_mut().for_each(|k| (k.offset, k.turn) = ([0.0; 3], [0.0; 3]));
        assert!(!motion.moves());
        // Held, but not where it was at time 0.
        motion.keyframes.iter_mut().for_each(|k| k.offset[1] = 0.5);
        assert!(motion.moves());
    }
}
