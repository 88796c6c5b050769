//! Takes as tables: what the columns mean, and their rows.

mod columns;
mod long;
mod table;
#[cfg(test)]
mod tests;

pub use table::parse_csv;

pub(super) use columns::{recognize, split_heading};
pub(super) use long::parse_long;
