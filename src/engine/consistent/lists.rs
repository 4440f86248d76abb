//! Lists that the map is kept in: with places of a type of their own (`by`), with copies that share what neither has changed
//! (`shared`), with little room to spare (`room`).

pub(super) mod by;
pub(super) mod room;
pub(super) mod shared;
