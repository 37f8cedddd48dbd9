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
    /// The id of the key that the jobs are of.
    pub key: Option<String>,
}

impl Filter {
    /// True for all jobs, or all of a key.
    pub fn is_empty(&self) -> bool {
        *self == Self { key: self.key.clone(), ..Self::default() }
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

/// The way of a search for the newest jobs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub along: Along,
    /// So many jobs have a name of the filter's that looking at all jobs finds some soon.
    pub names_are_many: bool,
    /// Numbers of jobs that bound the search.
    pub after: i64,
    pub before: i64,
}

/// The index that a search walks along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Along {
    /// The first tag's.
    Tag,
    /// The status's or, if any will do, all jobs.
    Status,
}

impl Filter {
    /// The condition of everything but the status, on a row of `jobs`.
    pub(super) fn condition(&self, way: Way, values: &mut Values) -> String {
        let (after, before) = (values.int(way.after), values.int(way.before));
        format!("jobs.seq > {after} AND jobs.seq < {before} AND {}", self.condition_by("name", values))
    }

    fn condition_by(&self, name_column: &str, values: &mut Values) -> String {
        let mut all = vec!["1 = 1".to_owned()];
        if let Some(key) = &self.key {
            all.push(format!("jobs.key_id = {}", values.text(key)));
        }
        for tag in &self.tags {
            let tag = values.text(tag);
            all.push(format!("EXISTS (SELECT 1 FROM job_tags WHERE job_tags.seq = jobs.seq AND tag = {tag})"));
        }
        match self.name.as_deref().map(|name| name.strip_suffix('*').ok_or(name)) {
            None => {}
            Some(Ok(prefix)) => {
                // No text that begins with it comes after it and the last character there is.
                let (from, to) = (values.text(prefix), values.text(format!("{prefix}\u{10FFFF}")));
                all.push(format!("{name_column} >= {from} AND {name_column} < {to}"));
            }
            Some(Err(name)) => all.push(format!("name = {}", values.text(name))),
        }
        if let Some(sweep) = self.sweep {
            all.push(format!("sweep = {}", values.text(sweep)));
        }
        // The plus keeps the databases from searching by the time: all that they find would have to be sorted.
        if let Some(time) = self.created_after {
            all.push(format!("+jobs.created_at > {}", values.int(time.as_microsecond())));
        }
        if let Some(time) = self.created_before {
            all.push(format!("+jobs.created_at < {}", values.int(time.as_microsecond())));
        }
        all.join(" AND ")
    }

    /// The condition of the status; of those in `among`, whatever else the filter has.
    pub(super) fn status_in(&self, among: &[Status]) -> String {
        let wanted = |status: &&Status| self.statuses.is_empty() || self.statuses.contains(status);
        let names: Vec<String> = among.iter().filter(wanted).map(|status| format!("'{status}'")).collect();
        if names.is_empty() { "1 = 0".into() } else { format!("status IN ({})", names.join(", ")) }
    }

    /// A query of the numbers of the newest `limit` jobs. One search by status, so that each is a walk along an
    /// index that ends at the limit.
    pub(super) fn newest(&self, way: Way, limit: i64, values: &mut Values) -> String {
        let (after, before, limit) = (values.int(way.after), values.int(way.before), values.int(limit));
        // Changed by an operation that changes nothing, a column is not looked up in its index.
        let name_column = if way.names_are_many { "(name || '')" } else { "name" };
        let few_names = !way.names_are_many && self.name.as_ref().is_some_and(|name| name.ends_with('*'));
        let (status_column, job_number) =
            if few_names { ("(status || '')", "+jobs.seq") } else { ("status", "jobs.seq") };
        let mut statuses: Vec<String> =
            self.statuses.iter().map(|status| format!("{status_column} = '{status}' AND")).collect();
        if statuses.is_empty() && self.key.is_some() {
            // The index of keys is by status.
            statuses.extend(Status::ALL.iter().map(|status| format!("{status_column} = '{status}' AND")));
        } else if statuses.is_empty() {
            statuses.push(String::new());
        }
        let tag = self.tags.first().filter(|_| way.along == Along::Tag);
        let (from, seq) = match tag {
            Some(tag) => {
                let tag = values.text(tag);
                (
                    format!("job_tags JOIN jobs ON jobs.seq = job_tags.seq WHERE job_tags.tag = {tag} AND"),
                    "job_tags.seq",
                )
            }
            None => ("jobs WHERE".to_owned(), job_number),
        };
        let others = self.tags.iter().skip(usize::from(tag.is_some())).cloned().collect();
        let condition = Self { tags: others, ..self.clone() }.condition_by(name_column, values);
        let search = |status: String| {
            format!(
                "SELECT seq FROM (SELECT {seq} AS seq FROM {from} {status} {seq} > {after} AND {seq} < {before} \
                 AND {condition} \
                 ORDER BY {seq} DESC LIMIT {limit}) AS found"
            )
        };
        statuses.into_iter().map(search).collect::<Vec<_>>().join(" UNION ALL ")
    }
}
