//! Comparison of measurements with earlier ones.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::row::{Row, Spread};
use super::spelled;

/// What an earlier row says of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// Particle-steps per second.
    pub before: Spread,
    /// The new median over the old one.
    pub ratio: f64,
    pub verdict: Verdict,
    /// Version and commit of the earlier row.
    pub version: String,
    pub commit: String,
}

/// Whether two spreads are apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    Faster,
    Slower,
    /// They overlap: the ratio may be chance.
    WithinSpread,
}

impl Verdict {
    fn of(new: &Spread, old: &Spread) -> Self {
        match () {
            _ if new.min > old.max => Self::Faster,
            _ if new.max < old.min => Self::Slower,
            _ => Self::WithinSpread,
        }
    }
}

/// The rows of a file that `gridfall bench --json` wrote; several documents may follow one another.
///
/// Errors: a sentence with the file, its fault, and what helps.
pub fn read(path: &Path) -> Result<Vec<Row>, String> {
    let file = path.display();
    let help = "give a file that `gridfall bench --json` wrote";
    let text = std::fs::read_to_string(path).map_err(|e| format!("cannot read {file}: {e}; {help}"))?;
    rows_of(&text).map_err(|fault| format!("{file} {fault}; {help}"))
}

fn rows_of(text: &str) -> Result<Vec<Row>, String> {
    // What is no JSON at all, before what is of another form.
    let documents: Vec<serde_json::Value> = serde_json::Deserializer::from_str(text)
        .into_iter()
        .collect::<Result<_, _>>()
        .map_err(|e| format!("is not JSON: {e}"))?;
    let mut rows = Vec::new();
    for document in documents {
        let more: Vec<Row> = serde_json::from_value(document).map_err(|e| format!("is JSON of another form: {e}"))?;
        rows.extend(more);
    }
    if rows.is_empty() { Err("has no measurements".into()) } else { Ok(rows) }
}

/// What two rows must share to be compared.
fn subject(row: &Row) -> String {
    let kind = if row.backend.software { "software GPU" } else { &row.backend.kind };
    format!("{}, {} particles, {}, {}, {kind}", row.case, row.particles, spelled(&row.kernel), spelled(&row.precision))
}

/// The last earlier row of the same case, particles, kernel, precision and kind of device.
fn partner<'a>(row: &Row, old: &'a [Row]) -> Option<&'a Row> {
    old.iter().rev().find(|before| subject(before) == subject(row))
}

/// Compares a row with its partner, if there is one.
pub fn compare_row(row: &mut Row, old: &[Row]) {
    row.compared = partner(row, old).map(|before| {
        let (new, old) = (row.particle_steps_per_s, before.particle_steps_per_s);
        Compared {
            before: old,
            ratio: new.median / old.median,
            verdict: Verdict::of(&new, &old),
            version: before.version.clone(),
            commit: before.commit.clone(),
        }
    });
}

/// What could not be compared, or not fairly; a sentence each.
pub fn doubts(rows: &[Row], old: &[Row]) -> Vec<String> {
    let device = |row: &Row| format!("{} {}", row.backend.device, row.backend.driver).trim_end().to_owned();
    let mut doubts = Vec::new();
    for row in rows {
        match partner(row, old) {
            None => doubts.push(format!("nothing earlier to compare with: {}", subject(row))),
            Some(before) if device(before) != device(row) => {
                let (was, is) = (device(before), device(row));
                doubts.push(format!("another device or driver, {was} before and {is} now: {}", subject(row)));
            }
            Some(_) => {}
        }
    }
    let lost = old.iter().filter(|before| !rows.iter().any(|row| subject(row) == subject(before)));
    doubts.extend(lost.map(|before| format!("not measured again: {}", subject(before))));
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What version 0.1.0 wrote before there were amounts.
    const OLD: &str = r#"[{
        "case": "pair", "size": "small", "particles": 16800, "kernel": "compact", "precision": "f32", "dt_s": 1e-4,
        "backend": { "kind": "cpu", "device": "Xeon", "driver": "", "software": false, "reason": "asked for" },
        "particle_steps_per_s": { "median": 4e6, "min": 3.5e6, "max": 4.5e6 },
        "wall_s_per_simulated_s": 42.0, "floor_bytes": 120.0, "copy_bandwidth_b_s": 2e10, "floor_share": 0.024,
        "stages": [{ "stage": "g2p2g", "us_per_step": 12.5 }], "version": "0.1.0", "commit": "abc" }]"#;

    fn row() -> Row {
        rows_of(OLD).unwrap().remove(0)
    }

    fn with_rate(median: f64, min: f64, max: f64) -> Row {
        Row { particle_steps_per_s: Spread { median, min, max }, ..row() }
    }

    #[test]
    fn older_rows_are_read() {
        let row = row();
        assert_eq!((row.rounds, row.device_bytes, row.stages[0].time_us), (0, None, None));
        let again = serde_json::to_string(&[row]).unwrap();
        assert_eq!(rows_of(&format!("{again}\n{OLD}")).unwrap().len(), 2, "a stream of documents");
    }

    #[test]
    fn ratios_and_verdicts() {
        let verdict = |mut new: Row| {
            compare_row(&mut new, &[row()]);
            assert!(doubts(&[new.clone()], &[row()]).is_empty());
            let compared = new.compared.expect("it has a partner");
            (compared.ratio, compared.verdict)
        };
        assert_eq!(verdict(row()), (1.0, Verdict::WithinSpread));
        assert_eq!(verdict(with_rate(8e6, 4.6e6, 9e6)), (2.0, Verdict::Faster));
        assert_eq!(verdict(with_rate(8e6, 4.4e6, 9e6)), (2.0, Verdict::WithinSpread));
        assert_eq!(verdict(with_rate(1e6, 0.5e6, 3.4e6)), (0.25, Verdict::Slower));
    }

    #[test]
    fn what_has_no_partner_is_said() {
        let gpu = |device: &str| {
            let mut row = row();
            row.backend.kind = "gpu".into();
            row.backend.device = device.into();
            row
        };
        let said = doubts(&[gpu("H200")], &[row(), gpu("H100")]);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("H100 before and H200 now"), "{said:?}");
        assert_eq!(said[1], "not measured again: pair, 16800 particles, compact, f32, cpu");
        let mut software = gpu("llvmpipe");
        software.backend.software = true;
        let said = doubts(&[software], &[gpu("H100")]);
        assert!(said[0].starts_with("nothing earlier to compare with: pair") && said.len() == 2, "{said:?}");
    }

    #[test]
    fn files_of_another_kind_are_refused() {
        let fault = |text: &str| rows_of(text).unwrap_err();
        assert!(fault("").contains("no measurements") && fault("[]").contains("no measurements"));
        assert!(fault("case, rate\n").contains("is not JSON: "));
        assert!(fault(&OLD[..200]).contains("is not JSON: EOF"));
        assert!(fault(r#"[{ "scene": "twist", "method": "hot" }]"#).contains("another form: missing field `case`"));
        assert!(fault(r#"{ "rows": [] }"#).contains("another form"));
        let missing = read(Path::new("/nowhere/old.json")).unwrap_err();
        assert!(missing.contains("cannot read /nowhere/old.json") && missing.contains("bench --json"), "{missing}");
    }
}
