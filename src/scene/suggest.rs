//! Wording of choices: lists and "did you mean".

/// "`a`, `b` or `c`".
pub fn list<'a>(choices: impl Iterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = choices.map(|c| format!("`{c}`")).collect();
    match quoted.split_last() {
        None => "none".into(),
        Some((only, [])) => only.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// A word from a scene as messages show it, shortened if it is long.
pub fn quote(word: &str) -> String {
    match word.char_indices().nth(60) {
        Some((end, _)) => format!("`{}…`", &word[..end]),
        None => format!("`{word}`"),
    }
}

/// The choice that differs from `word` by at most a few letters, ignoring hyphens and case.
pub fn closest<'a>(word: &str, choices: &[&'a str]) -> Option<&'a str> {
    let plain = |text: &str| text.to_lowercase().replace(['-', ' '], "_");
    if word.len() > 100 {
        return None;
    }
    let word = plain(word);
    // A name that was left unfinished, such as one without its unit.
    let mut longer = choices.iter().filter(|choice| word.len() >= 4 && plain(choice).starts_with(&word));
    if let (Some(only), None) = (longer.next(), longer.next()) {
        return Some(only);
    }
    let scored = choices.iter().map(|choice| (edits(&word, &plain(choice)), *choice));
    let (distance, choice) = scored.min()?;
    (distance <= 1 + word.chars().count() / 4).then_some(choice)
}

/// Levenshtein distance; swapped neighbours count as one edit.
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let differs = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + differs);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_typing_errors_and_nothing_far_off() {
        let fields = ["particles_per_cell", "velocity", "J", "angular_velocity"];
        assert_eq!(closest("particle_per_cell", &fields), Some("particles_per_cell"));
        assert_eq!(closest("particles-per-cell", &fields), Some("particles_per_cell"));
        assert_eq!(closest("veloctiy", &fields), Some("velocity"));
        assert_eq!(closest("angular", &fields), Some("angular_velocity"));
        assert_eq!(closest("temperature", &fields), None);
        assert_eq!(closest("x", &[]), None);
    }

    #[test]
    fn lists_read_like_prose() {
        assert_eq!(list(["a"].into_iter()), "`a`");
        assert_eq!(list(["a", "b", "c"].into_iter()), "`a`, `b` or `c`");
    }
}
