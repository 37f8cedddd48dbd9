//! Curves as CSV: those of the program, and measured ones.

use std::io::{Read, Write};

use gridfall_core::material::element::Point;

/// Writes a curve, with all its columns.
pub fn write(points: &[Point], out: impl Write) -> Result<(), String> {
    let mut writer = csv::Writer::from_writer(out);
    let failed = |error: csv::Error| error.to_string();
    writer.write_record(Point::COLUMNS).map_err(failed)?;
    for point in points {
        writer.write_record(point.values().map(|value| value.to_string())).map_err(failed)?;
    }
    writer.flush().map_err(|error| error.to_string())
}

/// A measured curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    pub strain: Vec<f64>,
    /// Columns of the program's curves, with a value a strain.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl Measured {
    /// The strain that is farthest from 0.
    pub fn end(&self) -> f64 {
        self.strain.iter().copied().fold(0.0, |most: f64, strain| if strain.abs() > most.abs() { strain } else { most })
    }
}

/// Reads a measured curve: a head with `strain` and other columns of the program's curves, then
/// numbers. Lines that begin with `#` are left out.
pub fn read(text: impl Read) -> Result<Measured, String> {
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(text);
    let head: Vec<String> = reader.headers().map_err(|error| error.to_string())?.iter().map(str::to_owned).collect();
    for (n, name) in head.iter().enumerate() {
        if !Point::COLUMNS.contains(&name.as_str()) {
            let known = Point::COLUMNS.join(", ");
            return Err(format!("line 1: there is no column '{name}'; the columns are {known}"));
        }
        if head[..n].contains(name) {
            return Err(format!("line 1: the column '{name}' is there twice"));
        }
    }
    let Some(strain_at) = head.iter().position(|name| name == "strain") else {
        return Err("line 1: the column 'strain' is missing; write a head such as strain,q".into());
    };
    if head.len() < 2 {
        return Err("line 1: there is nothing but 'strain'; add what was measured, such as q".into());
    }
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, |position| position.line());
        if record.len() != head.len() {
            return Err(format!("line {line}: {} values under {} columns", record.len(), head.len()));
        }
        let number = |(text, name): (&str, &String)| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("line {line}: '{text}' under {name} is not a number")),
        };
        rows.push(record.iter().zip(&head).map(number).collect::<Result<_, _>>()?);
    }
    let column = |at: usize| rows.iter().map(|row| row[at]).collect::<Vec<f64>>();
    let strain = column(strain_at);
    if strain.len() < 3 {
        return Err(format!("{} points; a curve has 3 or more", strain.len()));
    }
    if strain.iter().any(|&e| e > 0.0) && strain.iter().any(|&e| e < 0.0) {
        return Err("strains have both signs; a test goes one way from 0, so split the curve".into());
    }
    if strain.iter().all(|&e| e == 0.0) {
        return Err("all strains are 0".into());
    }
    let others = head.iter().enumerate().filter(|(at, _)| *at != strain_at);
    Ok(Measured { columns: others.map(|(at, name)| (name.clone(), column(at))).collect(), strain })
}

/// A column of a curve at a strain, by straight lines between its points.
pub fn at(points: &[Point], column: &str, strain: f64) -> f64 {
    let value = |point: &Point| point.value(column).expect("the column is known");
    let after = points.iter().position(|point| point.strain.abs() >= strain.abs()).unwrap_or(points.len() - 1);
    let (a, b) = (&points[after.saturating_sub(1)], &points[after]);
    let width = b.strain - a.strain;
    let share = if width == 0.0 { 1.0 } else { ((strain - a.strain) / width).clamp(0.0, 1.0) };
    value(a) + share * (value(b) - value(a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_curves_are_read_and_faults_have_their_lines() {
        let good = "# a test of 1986\nstrain, q,volumetric_strain\n0,0,0\n0.01,1e3,-0.001\n 0.02 ,1500,-0.001\n";
        let measured = read(good.as_bytes()).unwrap();
        assert_eq!(measured.strain, [0.0, 0.01, 0.02]);
        assert_eq!(measured.columns[0], ("q".to_owned(), vec![0.0, 1e3, 1500.0]));
        assert_eq!(measured.end(), 0.02);
        for (text, fault) in [
            ("strain,qq\n0,0\n", "line 1: there is no column 'qq'"),
            ("q,p\n0,0\n", "line 1: the column 'strain' is missing"),
            ("strain\n0\n", "nothing but 'strain'"),
            ("strain,q,q\n0,0,0\n", "line 1: the column 'q' is there twice"),
            ("strain,q\n0,0\n0.1,high\n", "line 3: 'high' under q is not a number"),
            ("strain,q\n0,0\n0.1,NaN\n", "line 3: 'NaN' under q is not a number"),
            ("strain,q\n0,0\n0.1\n", "line 3: 1 values under 2 columns"),
            ("strain,q\n0,0\n", "1 points"),
            ("strain,q\n0,0\n0.1,1\n-0.1,2\n", "both signs"),
        ] {
            let said = read(text.as_bytes()).unwrap_err();
            assert!(said.contains(fault), "{said:?} for {fault:?}");
        }
    }

    #[test]
    fn curves_are_written_and_read_between_their_points() {
        let point = |strain: f64, q: f64| Point { strain, q, ..Point::default() };
        let points = [point(0.0, 0.0), point(-0.1, 10.0), point(-0.2, 30.0)];
        assert_eq!([0.0, -0.05, -0.15, -0.2, -0.3].map(|e| at(&points, "q", e)), [0.0, 5.0, 20.0, 30.0, 30.0]);
        let mut text = Vec::new();
        write(&points, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.starts_with("strain,nominal_stress,") && text.lines().count() == 4, "{text}");
        assert_eq!(read(text.as_bytes()).unwrap().columns.len(), Point::COLUMNS.len() - 1);
    }
}
