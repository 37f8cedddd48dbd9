//! Lists that are too long for one answer: pages, and where the next one begins.

use std::str::FromStr;

use super::problem::{Code, Problem};

const DEFAULT: i64 = 50;
const MOST: i64 = 200;

/// A page that a client asks for.
pub struct Page<C> {
    size: i64,
    /// Where the page before ended.
    pub after: Option<C>,
}

impl<C: FromStr> Page<C> {
    pub fn of(limit: Option<i64>, cursor: Option<&String>) -> Result<Self, Problem> {
        let size = limit.unwrap_or(DEFAULT);
        if !(1..=MOST).contains(&size) {
            return Err(Problem::new(Code::InvalidQuery, format!("limit is {size}; it may be 1 to {MOST}")));
        }
        let after = cursor.map(|cursor| cursor.parse()).transpose().map_err(|_| {
            Problem::new(Code::InvalidQuery, "cursor is not one that this server gave out; take next_cursor of a page")
        })?;
        Ok(Self { size, after })
    }

    /// How many entries to look for: one more than the page has shows whether there is another page.
    pub fn wanted(&self) -> i64 {
        self.size + 1
    }

    /// The entries of the page, and the cursor of the next one, made of the last entry.
    pub fn cut<T, S: ToString>(&self, mut found: Vec<T>, cursor: impl Fn(&T) -> S) -> (Vec<T>, Option<String>) {
        let more = found.len() as i64 > self.size;
        found.truncate(self.size as usize);
        let next = found.last().filter(|_| more).map(|last| cursor(last).to_string());
        (found, next)
    }
}
