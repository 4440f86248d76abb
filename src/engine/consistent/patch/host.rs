//! What a patch is a part of, and which patches are joined.

use super::contacts::Contact;
use super::segmented::SegmentedBlocks;
use super::{Host, Patch, PatchId};
use crate::engine::consistent::rules::Rules;

/// Misfit up to which a narrow patch lies well on a plane: a third as far off as a slice may. Facets of a pillar have more, and stay
/// equals.
const WELL: f64 = 0.1;

/// What a patch is a part of, by those that it meets.
pub(crate) fn host(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Host {
    let slice_of = sharper(segmented, id, rules).map(Host::SliceOf);
    let end_of = || {
        let may_be = segmented.patch(id).may_be_bridge();
        may_be.then(|| end_of_bridge(segmented, id, rules)).flatten().map(Host::BridgeTo)
    };
    slice_of.or_else(end_of).unwrap_or_default()
}

/// Of the patches that a patch joins the one that its points fit best, where two of these are no single surface: as where the
/// foot of a ramp, seen from afar, has a plane between those of floor and ramp. `None` where all of them agree.
fn end_of_bridge(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Option<PatchId> {
    let own = segmented.patch(id);
    let ends = || segmented.contacts_of(id).filter(|&(other, _)| segmented.patch(other).is_whole());
    // Of two that differ one is turned by half of that at least; on most patches of walls and floors none is.
    let most = (0.5 * rules.join_angle).cos();
    if ends().all(|(other, _)| own.normal().dot(&segmented.patch(other).normal()) >= most) {
        return None;
    }
    let joined = |(other, contact): (PatchId, Contact)| {
        own.joins(segmented.patch(other), &contact, rules).then_some(other)
    };
    let ends: Vec<_> = ends().filter_map(joined).collect();
    let differ = |a: PatchId, b: PatchId| segmented.patch(a).differs_from(segmented.patch(b), rules);
    let is_bridge = ends.iter().enumerate().any(|(i, &a)| ends[i + 1..].iter().any(|&b| differ(a, b)));
    let misfit = |&end: &PatchId| (own.misfit(segmented.patch(end), rules), end);
    is_bridge.then(|| best_fit(segmented, ends.iter().map(misfit))).flatten().map(|(_, end)| end)
}

/// The least misfit; of equals the patch whose block comes first in space.
fn best_fit(
    segmented: &SegmentedBlocks,
    fits: impl Iterator<Item = (f64, PatchId)>,
) -> Option<(f64, PatchId)> {
    let place = |id: PatchId| (segmented[id.block].corner(), id.number);
    fits.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| place(a.1).cmp(&place(b.1))))
}

/// The sharper, broader or whole patch that a patch is a slice of: of those it meets, the one its points fit best. A flat patch
/// that joins one with less noise as its equal, and fits that better, is no slice, unless it is narrow and lies well on the best; what
/// leads away from the best is no equal. Of several that fit alike it is the one whose block comes first in space.
fn sharper(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Option<PatchId> {
    let own = segmented.patch(id);
    if !own.may_be_slice() {
        return None;
    }
    let contacts = || segmented.contacts_of(id);
    let candidates = contacts()
        .filter_map(|(other, _)| own.slice_of(segmented.patch(other), rules).map(|misfit| (misfit, other)));
    let (misfit, best) = best_fit(segmented, candidates)?;
    // Where a wall and a door that stands ajar meet, so do their scatters. One that lies on the best plane too, and is turned off it,
    // leads from the one surface to the other.
    let leads_away = |other: &Patch| {
        let best = segmented.patch(best);
        other.normal().dot(&best.normal()) < rules.join_angle.cos() && other.slice_of(best, rules).is_some()
    };
    let fits_equal = |(other, contact): (PatchId, Contact)| {
        let other = segmented.patch(other);
        own.misfit(other, rules) <= misfit && own.is_equal_of(other, &contact, rules) && !leads_away(other)
    };
    // Where a block has a row or two of a floor at the foot of a ramp, their normal may be any, and be equal to both.
    let is_of_best = own.is_narrow() && misfit <= WELL;
    (is_of_best || !contacts().any(fits_equal)).then_some(best)
}

/// The patches that one is joined to, of those that it meets.
pub(crate) fn joined_with(
    segmented: &SegmentedBlocks,
    id: PatchId,
    rules: &Rules,
) -> impl Iterator<Item = PatchId> {
    let met = segmented.contacts_of(id);
    met.filter_map(move |(other, contact)| are_joined(segmented, id, other, &contact, rules).then_some(other))
}

/// Whether two patches that meet so are joined. A slice is with the one it is a slice of, and else with what lies on that one's
/// plane too; where one is folded or a bridge, which lies on two planes, those that the two are parts of must lie on each
/// other's.
fn are_joined(segmented: &SegmentedBlocks, a: PatchId, b: PatchId, contact: &Contact, rules: &Rules) -> bool {
    let [here, there] = [a, b].map(|id| segmented.patch(id));
    let (of_a, of_b) = (here.host.patch(), there.host.patch());
    if of_a == Some(b) || of_b == Some(a) {
        return true;
    }
    let is_part = |own: &Patch| own.host.is_bridge() || own.is_folded() && own.host != Host::None;
    if is_part(here) || is_part(there) {
        let [host_a, host_b] = [(a, of_a), (b, of_b)].map(|(own, of)| segmented.patch(of.unwrap_or(own)));
        return here.joins(there, contact, rules)
            && host_a.lies_on(host_b, rules)
            && host_b.lies_on(host_a, rules);
    }
    let lies_on =
        |own: &Patch, of: Option<PatchId>| of.is_none_or(|of| own.lies_on(segmented.patch(of), rules));
    here.joins(there, contact, rules) && lies_on(there, of_a) && lies_on(here, of_b)
}

#[cfg(test)]
mod tests;
