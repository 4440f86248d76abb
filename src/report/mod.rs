//! What a replay leaves to be looked at: one HTML page with the clusters in 3-D over time, figures, parameters, and what
//! was skipped and why.
//!
//! A [`Story`] is built up while the scans go through the engine, in memory that grows with the
//! map and not with the length of the bag, but for the ids of each merge; [`write_report`] makes the page of it. Everything is pure: the same story and
//! [`Facts`] give the same bytes. The page needs no network and refuses itself any: its viewer (`viewer/*.js`) draws in
//! software on a 2-D canvas.
//!
//! Whatever comes out of a bag is text of a stranger: it is escaped for HTML where it stands in the page, and the JSON
//! holds no `<`, `>` or `&`.

mod facts;
mod json;
mod moment;
mod pack;
mod page;
mod row;
mod series;
mod story;
#[cfg(test)]
mod tests;

pub use facts::{Facts, Figure};
pub use page::write_report;
pub use series::Taken;
pub use story::{MOMENTS, Story};
