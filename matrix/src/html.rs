//! The report as a page for people.
use crate::report::Report;
/// The page.
#[must_use]
pub fn page(_report: &Report) -> String {
    String::new()
}
