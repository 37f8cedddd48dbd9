//! Which jobs a request is about.

use std::fmt::Display;
use std::str::FromStr;

use jiff::Timestamp;
use serde::{Deserialize, Deserializer, de};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use super::caller::Caller;
use super::problem::{Code, Problem};
use crate::store::{Filter, Status};

/// Which jobs to list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ListJobs {
    /// Only jobs in one of these statuses.
    #[param(inline, style = Form, explode = false)]
    #[serde(default, deserialize_with = "commas")]
    pub status: Vec<Status>,
    /// Only jobs that have all these tags.
    #[param(style = Form, explode = false)]
    #[serde(default, deserialize_with = "commas")]
    pub tag: Vec<String>,
    /// Only jobs of this name, or of names that begin like this if it ends in `*`.
    pub name: Option<String>,
    /// Only jobs accepted after this time.
    pub created_after: Option<Timestamp>,
    /// Only jobs accepted before this time.
    pub created_before: Option<Timestamp>,
    /// Only jobs of this sweep.
    pub sweep: Option<Uuid>,
    /// Jobs a page; 50 by default.
    #[param(minimum = 1, maximum = 200)]
    pub limit: Option<i64>,
    /// `next_cursor` of the page before.
    pub cursor: Option<String>,
}

impl ListJobs {
    /// Without the page, of what the caller may see.
    pub fn filter(&self, caller: &Caller) -> Filter {
        Filter {
            statuses: self.status.clone(),
            tags: self.tag.clone(),
            name: self.name.clone(),
            created_after: self.created_after,
            created_before: self.created_before,
            sweep: self.sweep,
            key: caller.confined_to().map(str::to_owned),
        }
    }
}

/// A list in a query string: `a,b`.
pub(super) fn commas<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err: Display>,
{
    let text = String::deserialize(deserializer)?;
    let parts = text.split(',').filter(|part| !part.is_empty());
    parts.map(|part| part.parse().map_err(de::Error::custom)).collect()
}

/// Jobs that have all of what is given; something must be.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JobFilter {
    /// In one of these statuses.
    pub status: Vec<Status>,
    /// With all these tags.
    pub tag: Vec<String>,
    /// Of this name, or of names that begin like this if it ends in `*`.
    pub name: Option<String>,
    pub created_after: Option<Timestamp>,
    pub created_before: Option<Timestamp>,
    pub sweep: Option<Uuid>,
}

impl JobFilter {
    /// The filter, of what the caller may change, unless it is for all jobs there are.
    pub fn given(self, caller: &Caller) -> Result<Filter, Problem> {
        let key = caller.confined_to().map(str::to_owned);
        let Self { status, tag, name, created_after, created_before, sweep } = self;
        let filter = Filter { statuses: status, tags: tag, name, created_after, created_before, sweep, key };
        if filter.is_empty() {
            let detail = "the filter is for all jobs; say which, or name all statuses if you mean all";
            return Err(Problem::new(Code::InvalidRequest, detail));
        }
        Ok(filter)
    }
}
