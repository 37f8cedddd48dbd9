//! Rows of named values, declared once for CSV, JSON and protobuf.

/// One value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    Count(u64),
    Real(f64),
    Flag(bool),
}

impl Value {
    /// The value as a CSV cell; numbers round-trip.
    pub fn csv(self) -> String {
        match self {
            Self::Count(n) => n.to_string(),
            Self::Real(x) => format!("{x:?}"),
            Self::Flag(flag) => flag.to_string(),
        }
    }
}

impl From<u64> for Value {
    fn from(n: u64) -> Self {
        Self::Count(n)
    }
}

impl From<f64> for Value {
    fn from(x: f64) -> Self {
        Self::Real(x)
    }
}

impl From<u32> for Value {
    fn from(n: u32) -> Self {
        Self::Count(n.into())
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

/// Declares a row once: the struct, its column names and its values in order. Fields after the
/// semicolon are not fixed columns.
macro_rules! columns {
    (
        $(#[$attribute:meta])*
        $row:ident {
            $($(#[doc = $doc:literal])+ $name:ident: $type:ty,)+
            $(; $(#[doc = $more_doc:literal])+ $more:ident: $more_type:ty,)*
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Debug, Default, PartialEq)]
        #[allow(non_snake_case)]
        pub struct $row {
            $($(#[doc = $doc])+ pub $name: $type,)+
            $($(#[doc = $more_doc])+ pub $more: $more_type,)*
        }

        impl $row {
            /// Names of the fixed columns, in order.
            pub const COLUMNS: &'static [&'static str] = &[$(stringify!($name)),+];

            /// The values of these columns, in order.
            pub fn values(&self) -> [$crate::sim::diagnostics::Value; Self::COLUMNS.len()] {
                [$(self.$name.into()),+]
            }
        }
    };
}
pub(super) use columns;
