//! The tables of docs/SHADERS.md: which programs share a row, and rows to Markdown and back.

/// A line of a table: the programs that it stands for, and what a compiler said of each of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// `engine/shader`.
    pub shader: String,
    /// What it is specialised for; nothing is said of what makes no difference.
    pub variant: Vec<String>,
    pub figures: Vec<u64>,
    /// Of what the figures were made from; only where they are not made anew in each test.
    pub hash: Option<String>,
}

impl Row {
    pub fn label(&self) -> String {
        [&self.shader].into_iter().chain(&self.variant).map(String::as_str).collect::<Vec<_>>().join(" ")
    }

    /// Whether it stands for a program.
    pub fn covers(&self, program: &str) -> bool {
        let mut words = program.split(' ');
        words.next() == Some(&self.shader) && {
            let words: Vec<&str> = words.collect();
            self.variant.iter().all(|word| words.contains(&word.as_str()))
        }
    }
}

/// A row while rows are merged: `None` for a word that makes no difference.
struct Open {
    shader: String,
    words: Vec<Option<String>>,
    figures: Vec<u64>,
}

/// Rows of programs by name and figures, those of a shader one after the other. A word leaves the
/// variant where all of its values come to the same figures; the programs then share a row.
pub fn rows(programs: impl IntoIterator<Item = (String, Vec<u64>)>) -> Vec<Row> {
    let mut open: Vec<Open> = programs
        .into_iter()
        .map(|(name, figures)| {
            let mut words = name.split(' ').map(String::from);
            Open { shader: words.next().unwrap_or_default(), words: words.map(Some).collect(), figures }
        })
        .collect();
    let order: Vec<String> = open.iter().map(|row| row.shader.clone()).collect();
    open.sort_by_key(|row| order.iter().position(|shader| *shader == row.shader));

    let most = open.iter().map(|row| row.words.len()).max().unwrap_or(0);
    for axis in (0..most).rev() {
        let mut merged: Vec<Open> = Vec::new();
        while !open.is_empty() {
            let first = open.remove(0);
            if first.words.get(axis).is_none_or(Option::is_none) {
                merged.push(first);
                continue;
            }
            let others = |row: &Open| {
                row.shader == first.shader
                    && row.words.iter().enumerate().all(|(k, w)| k == axis || *w == first.words[k])
            };
            let values = |rows: &[Open]| {
                let own = rows.iter().filter(|row| row.shader == first.shader);
                own.filter_map(|row| row.words[axis].clone()).collect::<std::collections::HashSet<_>>()
            };
            let mut all = values(&open);
            all.extend(values(&merged));
            all.extend(first.words[axis].clone());
            let alike = open.iter().filter(|row| others(row) && row.figures == first.figures).count() + 1;
            if alike == all.len() {
                open.retain(|row| !others(row));
                let mut first = first;
                first.words[axis] = None;
                merged.push(first);
            } else {
                merged.push(first);
            }
        }
        open = merged;
    }
    let close = |row: Open| {
        let variant = row.words.into_iter().flatten().collect();
        Row { shader: row.shader, variant, figures: row.figures, hash: None }
    };
    open.into_iter().map(close).collect()
}

/// A Markdown table; `heads` are those of the figures.
pub fn render(heads: &[String], rows: &[Row]) -> String {
    let hashed = rows.iter().any(|row| row.hash.is_some());
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut top = vec!["shader".to_string(), "variant".into()];
    top.extend(heads.iter().cloned());
    top.extend(hashed.then(|| "hash".into()));
    let mut text = line(top) + "|---|---|" + &"--:|".repeat(heads.len()) + if hashed { "---|\n" } else { "\n" };
    for row in rows {
        let mut cells = vec![row.shader.clone(), row.variant.join(" ")];
        cells.extend(row.figures.iter().map(u64::to_string));
        cells.extend(row.hash.clone());
        text += &line(cells);
    }
    text
}

/// The rows of the table in a text, which has `figures` columns of figures. Errors name the line.
pub fn parse(text: &str, figures: usize) -> Result<Vec<Row>, String> {
    let lines = text.lines().filter(|line| line.starts_with('|')).skip(2);
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let numbers = cells.get(2..2 + figures).ok_or_else(|| format!("too few columns: {line}"))?;
        let numbers: Result<Vec<u64>, _> = numbers.iter().map(|cell| cell.parse()).collect();
        Ok(Row {
            shader: cells[0].into(),
            variant: cells[1].split_whitespace().map(String::from).collect(),
            figures: numbers.map_err(|e| format!("{e}: {line}"))?,
            hash: cells.get(2 + figures).map(|cell| cell.to_string()),
        })
    };
    lines.map(row).collect()
}

/// Where the part `name` of a document begins and ends.
fn place(document: &str, name: &str) -> Result<(usize, usize), String> {
    let (open, close) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let start = document.find(&open).ok_or_else(|| format!("no line {open}"))? + open.len();
    let end = document[start..].find(&close).ok_or_else(|| format!("no line {close}"))? + start;
    Ok((start, end))
}

/// The generated part `name` of a document.
pub fn part<'a>(document: &'a str, name: &str) -> Result<&'a str, String> {
    place(document, name).map(|(start, end)| &document[start..end])
}

/// The document with another text as its part `name`.
pub fn with_part(document: &str, name: &str, text: &str) -> Result<String, String> {
    let (start, end) = place(document, name)?;
    Ok(format!("{}\n{}\n{}", &document[..start], text.trim(), &document[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(name: &str, figure: u64) -> (String, Vec<u64>) {
        (name.into(), vec![figure, 7])
    }

    #[test]
    fn what_makes_no_difference_is_not_said() {
        let made = rows([
            program("a/one compact mls", 1),
            program("a/two compact mls", 1),
            program("a/one compact apic", 1),
            program("a/two compact apic", 2),
            program("a/one quadratic mls", 1),
            program("a/two quadratic mls", 3),
            program("a/one quadratic apic", 1),
            program("a/two quadratic apic", 3),
            program("a/three", 4),
        ]);
        let labels: Vec<String> = made.iter().map(Row::label).collect();
        assert_eq!(labels, ["a/one", "a/two compact mls", "a/two compact apic", "a/two quadratic", "a/three"]);
        assert!(made[0].covers("a/one quadratic mls") && !made[0].covers("a/two quadratic mls"));
        assert!(made[3].covers("a/two quadratic mls") && !made[3].covers("a/two compact mls"));
        assert!(made[4].covers("a/three") && !made[4].covers("a/thre"));
    }

    #[test]
    fn rows_come_back_from_a_document() {
        let heads = ["n".to_string(), "m".into()];
        let mut made = rows([program("a/one compact", 1), program("a/one quadratic", 2), program("a/two", 3)]);
        let document = "# Title\n\n<!-- x -->\nold\n<!-- end of x -->\n\nMore.\n";
        for hash in [None, Some("0123456789ab".to_string())] {
            made.iter_mut().for_each(|row| row.hash = hash.clone());
            let text = with_part(document, "x", &render(&heads, &made)).unwrap();
            assert!(
                text.starts_with("# Title\n\n<!-- x -->\n\n| shader |")
                    && text.ends_with("|\n\n<!-- end of x -->\n\nMore.\n")
            );
            assert_eq!(parse(part(&text, "x").unwrap(), 2).unwrap(), made);
        }
        assert!(part(document, "y").unwrap_err().contains("<!-- y -->"));
        assert!(parse("| a | b | n |\n|---|---|--:|\n| a/one | | many |", 1).unwrap_err().contains("many"));
    }
}
