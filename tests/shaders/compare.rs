//! Whether today's figures are those of a table.

use crate::table::Row;

/// How far a figure may be from the table's.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// At most this.
    Within(u64),
    /// At most this part of it, or a few instructions.
    Part(f64),
    /// Not compared: it follows from the others.
    Shown,
}

/// Instructions that do not count in small shaders.
const FEW: u64 = 16;

/// A column of figures.
#[derive(Clone, Debug)]
pub struct Column {
    pub head: String,
    pub rule: Rule,
}

impl Column {
    pub fn new(head: impl Into<String>, rule: Rule) -> Self {
        Self { head: head.into(), rule }
    }

    /// For figures of another version of the compiler: only instructions are compared, with a larger tolerance.
    pub fn loosened(&self) -> Self {
        let rule = if let Rule::Part(_) = self.rule { Rule::Part(0.3) } else { Rule::Shown };
        Self { rule, ..self.clone() }
    }

    fn allows(&self, kept: u64, today: u64) -> bool {
        let apart = kept.abs_diff(today);
        match self.rule {
            Rule::Within(most) => apart <= most,
            Rule::Part(part) => apart <= FEW.max((part * kept as f64) as u64),
            Rule::Shown => true,
        }
    }
}

/// What a table says that is no longer so; `today` has the programs by name.
pub fn faults(columns: &[Column], table: &[Row], today: &[(String, Vec<u64>)]) -> Vec<String> {
    let mut faults = missing(table, today.iter().map(|(name, _)| name.as_str()));
    for row in table {
        let own: Vec<_> = today.iter().filter(|(name, _)| row.covers(name)).collect();
        for (k, column) in columns.iter().enumerate() {
            let kept = row.figures[k];
            // One program speaks for all of a row.
            if let Some((name, figures)) = own.iter().find(|(_, figures)| !column.allows(kept, figures[k])) {
                faults.push(format!("{name}: {}: {kept} in the table, {} today", column.head, figures[k]));
            }
        }
    }
    faults
}

/// Programs without a row, and rows without a program.
pub fn missing<'a>(table: &[Row], programs: impl Iterator<Item = &'a str> + Clone) -> Vec<String> {
    let without = programs.clone().filter(|name| table.iter().filter(|row| row.covers(name)).count() != 1);
    let mut faults: Vec<String> = without.map(|name| format!("{name}: has no row of the table")).collect();
    let unused = table.iter().filter(|row| !programs.clone().any(|name| row.covers(name)));
    faults.extend(unused.map(|row| format!("{}: in the table, but there is no such program", row.label())));
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::rows;

    fn columns() -> Vec<Column> {
        vec![
            Column::new("instructions", Rule::Part(0.1)),
            Column::new("registers", Rule::Within(8)),
            Column::new("bytes", Rule::Within(0)),
            Column::new("waves", Rule::Shown),
        ]
    }

    fn today(figures: [u64; 4]) -> Vec<(String, Vec<u64>)> {
        vec![("a/one compact".into(), vec![1000, 64, 512, 16]), ("a/one quadratic".into(), figures.into())]
    }

    #[test]
    fn only_what_leaves_its_tolerance_is_a_fault() {
        let table = rows(today([1000, 64, 512, 16]));
        assert_eq!(table.len(), 1);
        assert!(faults(&columns(), &table, &today([1100, 56, 512, 10])).is_empty());
        let found = |figures| faults(&columns(), &table, &today(figures));
        let doubled = found([2000, 64, 512, 16]);
        assert_eq!(doubled, ["a/one quadratic: instructions: 1000 in the table, 2000 today"]);
        assert_eq!(found([899, 64, 512, 16]).len(), 1, "fewer are a change too");
        assert_eq!(found([1000, 80, 513, 16]).len(), 2);
        // A few instructions are a large part of a small shader.
        assert!(columns()[0].allows(20, 36) && !columns()[0].allows(20, 37));
    }

    #[test]
    fn another_version_of_the_compiler_still_shows_a_doubling() {
        let table = rows(today([1000, 64, 512, 16]));
        let loose: Vec<Column> = columns().iter().map(Column::loosened).collect();
        assert!(faults(&loose, &table, &today([1290, 128, 1024, 8])).is_empty());
        assert_eq!(faults(&loose, &table, &today([2000, 64, 512, 16])).len(), 1);
    }

    #[test]
    fn programs_and_rows_belong_together() {
        let table = rows([("a/one".to_string(), vec![1, 1, 1, 1])]);
        let found = faults(&columns(), &table, &[("a/two".to_string(), vec![1, 1, 1, 1])]);
        assert_eq!(found, ["a/two: has no row of the table", "a/one: in the table, but there is no such program"]);
    }
}
