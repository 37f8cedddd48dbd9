//! What time it is.

use std::fmt;
use std::sync::Arc;

use jiff::Timestamp;

/// Microseconds since the Unix epoch, by the computer's clock or by a test's.
#[derive(Clone)]
pub(super) struct Clock(Arc<dyn Fn() -> i64 + Send + Sync>);

impl Clock {
    pub fn new(now: impl Fn() -> i64 + Send + Sync + 'static) -> Self {
        Self(Arc::new(now))
    }

    pub fn now(&self) -> i64 {
        self.0()
    }
}

impl Default for Clock {
    fn default() -> Self {
        Self::new(|| Timestamp::now().as_microsecond())
    }
}

impl fmt::Debug for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Clock")
    }
}
