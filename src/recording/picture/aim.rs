//! Where the camera of a picture stands, in words.

use std::str::FromStr;

/// What is said of a camera; what is not said is chosen so that the picture shows all that will be there.
///
/// In text, parts with commas between them: `azimuth=30,elevation=20,look_at=0.5,0.5,0.2`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aim {
    /// Where the camera stands, seen from what it looks at: counter-clockwise from +x (degrees).
    pub azimuth_deg: Option<f64>,
    /// Above the horizon (degrees).
    pub elevation_deg: Option<f64>,
    /// From what it looks at (m).
    pub distance_m: Option<f64>,
    /// What is in the middle of the picture (m).
    pub look_at_m: Option<[f64; 3]>,
    /// How much larger things are than in the picture that shows all.
    pub zoom: Option<f64>,
}

const PARTS: &str = "azimuth, elevation, distance, look_at and zoom";

impl FromStr for Aim {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts: Vec<(&str, Vec<f64>)> = Vec::new();
        for piece in text.split(',') {
            let number = match piece.split_once('=') {
                Some((name, number)) => {
                    parts.push((name.trim(), Vec::new()));
                    number
                }
                None => piece,
            };
            let known =
                parts.last_mut().ok_or_else(|| format!("\"{piece}\" is no part of a camera, as azimuth=30 is"))?;
            let number: Option<f64> = number.trim().parse().ok().filter(|number: &f64| number.is_finite());
            known.1.push(number.ok_or_else(|| format!("{} has \"{piece}\", which is no number", known.0))?);
        }
        let mut aim = Self::default();
        for (name, numbers) in parts {
            let one = || match numbers[..] {
                [number] => Ok(Some(number)),
                _ => Err(format!("{name} is one number, not {}", numbers.len())),
            };
            let positive = || match one()? {
                Some(number) if number > 0.0 => Ok(Some(number)),
                _ => Err(format!("{name} must be above 0")),
            };
            let given = match name {
                "azimuth" => &mut aim.azimuth_deg,
                "elevation" => &mut aim.elevation_deg,
                "distance" => &mut aim.distance_m,
                "zoom" => &mut aim.zoom,
                "look_at" => {
                    aim.look_at_m = Some(match numbers[..] {
                        [x, y] => [x, y, 0.0],
                        [x, y, z] => [x, y, z],
                        _ => return Err(format!("look_at is x,y,z (2D: x,y), not {} numbers", numbers.len())),
                    });
                    continue;
                }
                _ => return Err(format!("a camera has no \"{name}\"; it has {PARTS}")),
            };
            *given = if matches!(name, "distance" | "zoom") { positive()? } else { one()? };
        }
        if aim.elevation_deg.is_some_and(|elevation| elevation.abs() > 90.0) {
            return Err("elevation is between -90 and 90 degrees".into());
        }
        if aim.distance_m.is_some() && aim.zoom.is_some() {
            return Err("distance and zoom say the same; give one of them".into());
        }
        Ok(aim)
    }
}

impl Aim {
    /// Fails where it says what scenes of this dimension have no use for.
    pub(crate) fn suits(&self, dimension: usize) -> Result<(), String> {
        let turned = [("azimuth", self.azimuth_deg), ("elevation", self.elevation_deg), ("distance", self.distance_m)];
        match turned.iter().find(|(_, given)| dimension == 2 && given.is_some()) {
            Some((name, _)) => {
                Err(format!("2D scenes are seen from the front and have no {name}; use look_at and zoom"))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read() {
        let aim: Aim = "azimuth=-30,elevation=20,look_at=0.5,0.25,0.2,distance=3".parse().unwrap();
        assert_eq!((aim.azimuth_deg, aim.elevation_deg), (Some(-30.0), Some(20.0)));
        assert_eq!((aim.look_at_m, aim.distance_m), (Some([0.5, 0.25, 0.2]), Some(3.0)));
        assert_eq!("look_at=1,2".parse::<Aim>().unwrap().look_at_m, Some([1.0, 2.0, 0.0]));
        for (wrong, said) in [
            ("", "no part of a camera"),
            ("30", "no part of a camera"),
            ("turn=3", "it has azimuth"),
            ("azimuth=x", "no number"),
            ("azimuth=1,2", "one number, not 2"),
            ("zoom=0", "above 0"),
            ("zoom=inf", "no number"),
            ("look_at=1", "not 1 numbers"),
            ("elevation=91", "between -90 and 90"),
            ("zoom=2,distance=3", "give one"),
        ] {
            let error = wrong.parse::<Aim>().unwrap_err();
            assert!(error.contains(said), "{wrong}: {error}");
        }
        let error = "azimuth=3".parse::<Aim>().unwrap().suits(2).unwrap_err();
        assert!(error.contains("azimuth"), "{error}");
    }
}
