//! Tests of the table and of what documents become.
