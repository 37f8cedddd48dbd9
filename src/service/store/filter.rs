//! Which jobs a list, or a change of many jobs, is about.

use jiff::Timestamp;
use sqlx::any::{Any, AnyArguments};
use sqlx::query::{Query, QueryAs};
use uuid::Uuid;

use super::Status;

/// Jobs that have all of what is given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filter {
    /// Any of these; all if empty.
    pub statuses: Vec<Status>,
    /// All of these.
    pub tags: Vec<String>,
    /// The whole name, or its beginning and `*`.
    pub name: Option<String>,
    pub created_after: Option<Timestamp>,
    pub created_before: Option<Timestamp>,
    pub sweep: Option<Uuid>,
}

impl Filter {
    /// True for all jobs.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// A value of a query.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Text(String),
    Int(i64),
}

/// SQL and its values, grown piece by piece.
#[derive(Debug, Default)]
pub(super) struct Values(pub Vec<Value>);

impl Values {
    /// Adds a value and returns its placeholder.
    pub fn text(&mut self, value: impl Into<String>) -> String {
        self.add(Value::Text(value.into()))
    }

    pub fn int(&mut self, value: i64) -> String {
        self.add(Value::Int(value))
    }

    fn add(&mut self, value: Value) -> String {
        self.0.push(value);
        format!("${}", self.0.len())
    }

    pub fn bind(self, query: Query<'_, Any, AnyArguments>) -> Query<'_, Any, AnyArguments> {
        self.0.into_iter().fold(query, |query, value| match value {
            Value::Text(text) => query.bind(text),
            Value::Int(int) => query.bind(int),
        })
    }

    pub fn bind_as<T>(self, query: QueryAs<'_, Any, T, AnyArguments>) -> QueryAs<'_, Any, T, AnyArguments> {
        self.0.into_iter().fold(query, |query, value| match value {
            Value::Text(text) => query.bind(text),
            Value::Int(int) => query.bind(int),
        })
    }
}

impl Filter {
    /// The condition of everything but the status, on a row of `jobs`.
    pub(super) fn condition(&self, values: &mut Values) -> String {
        let mut all = vec!["1 = 1".to_owned()];
        for tag in &self.tags {
            let tag = values.text(tag);
            all.push(format!("EXISTS (SELECT 1 FROM job_tags WHERE job_tags.seq = jobs.seq AND tag = {tag})"));
        }
        match self.name.as_deref().map(|name| name.strip_suffix('*').ok_or(name)) {
            None => {}
            Some(Ok(prefix)) => {
                // No text that begins with it comes after it and the last character there is.
                let (from, to) = (values.text(prefix), values.text(format!("{prefix}\u{10FFFF}")));
                all.push(format!("name >= {from} AND name < {to}"));
            }
            Some(Err(name)) => all.push(format!("name = {}", values.text(name))),
        }
        if let Some(sweep) = self.sweep {
            all.push(format!("sweep = {}", values.text(sweep)));
        }
        // Jobs are numbered as they are created, so that the number bounds the search. The plus keeps the
        // databases from searching by the time itself: all that it finds would have to be sorted.
        if let Some(time) = self.created_after {
            let time = values.int(time.as_microsecond());
            all.push(format!(
                "+jobs.created_at > {time} AND jobs.seq >= (SELECT seq FROM jobs AS later \
                 WHERE later.created_at > {time} ORDER BY created_at, seq LIMIT 1)"
            ));
        }
        if let Some(time) = self.created_before {
            let time = values.int(time.as_microsecond());
            all.push(format!(
                "+jobs.created_at < {time} AND jobs.seq <= (SELECT seq FROM jobs AS earlier \
                 WHERE earlier.created_at < {time} ORDER BY created_at DESC, seq DESC LIMIT 1)"
            ));
        }
        all.join(" AND ")
    }

    /// The condition of the status; of those in `among`, whatever else the filter has.
    pub(super) fn status_in(&self, among: &[Status]) -> String {
        let wanted = |status: &&Status| self.statuses.is_empty() || self.statuses.contains(status);
        let names: Vec<String> = among.iter().filter(wanted).map(|status| format!("'{status}'")).collect();
        if names.is_empty() { "1 = 0".into() } else { format!("status IN ({})", names.join(", ")) }
    }

    /// A query of the numbers of the newest `limit` jobs with numbers below `before`. One search by status, so
    /// that each is a walk along an index that ends at the limit.
    pub(super) fn newest(&self, before: i64, limit: i64, values: &mut Values) -> String {
        let (before, limit) = (values.int(before), values.int(limit));
        let mut statuses: Vec<String> = self.statuses.iter().map(|status| format!("status = '{status}' AND")).collect();
        if statuses.is_empty() {
            statuses.push(String::new());
        }
        // The rarest is a tag, more likely than not.
        let (from, seq) = match self.tags.first() {
            Some(tag) => {
                let tag = values.text(tag);
                (
                    format!("job_tags JOIN jobs ON jobs.seq = job_tags.seq WHERE job_tags.tag = {tag} AND"),
                    "job_tags.seq",
                )
            }
            None => ("jobs WHERE".to_owned(), "jobs.seq"),
        };
        let condition = Self { tags: self.tags.iter().skip(1).cloned().collect(), ..self.clone() }.condition(values);
        let search = |status: String| {
            format!(
                "SELECT seq FROM (SELECT {seq} AS seq FROM {from} {status} {seq} < {before} AND {condition} \
                 ORDER BY {seq} DESC LIMIT {limit}) AS found"
            )
        };
        statuses.into_iter().map(search).collect::<Vec<_>>().join(" UNION ALL ")
    }
}
