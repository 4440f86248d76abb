//! The patches that a patch meets.

use super::block::BlockIndex;
use super::join::Contact;
use super::layer::PatchId;

/// The patches that a patch meets, ascending, and where: a handful, for which a tree's nodes would mostly be empty.
#[derive(Clone, Debug, Default)]
pub(super) struct Contacts(Vec<(PatchId, Contact)>);

impl Contacts {
    /// Notes where a patch is met, in place of what was known of that.
    pub(super) fn insert(&mut self, other: PatchId, contact: Contact) {
        match self.0.binary_search_by_key(&other, |(id, _)| *id) {
            Ok(place) => self.0[place].1 = contact,
            Err(place) => self.0.insert(place, (other, contact)),
        }
    }

    /// Forgets the patches of a block.
    pub(super) fn forget(&mut self, block: BlockIndex) {
        self.0.retain(|(id, _)| id.block != block);
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (PatchId, &Contact)> {
        self.0.iter().map(|(id, contact)| (*id, contact))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_patch_is_met_once_in_order_until_its_block_is_forgotten() {
        let id = |block, number| PatchId { block: BlockIndex(block), number };
        let met = |pairs| Contact { pairs, ..Contact::default() };
        let mut contacts = Contacts::default();
        for (other, pairs) in [(id(7, 1), 3), (id(2, 0), 4), (id(7, 0), 5), (id(7, 1), 6)] {
            contacts.insert(other, met(pairs));
        }
        let seen = |contacts: &Contacts| contacts.iter().map(|(id, it)| (id, it.pairs)).collect::<Vec<_>>();
        assert_eq!(seen(&contacts), [(id(2, 0), 4), (id(7, 0), 5), (id(7, 1), 6)]);
        contacts.forget(BlockIndex(7));
        assert_eq!(seen(&contacts), [(id(2, 0), 4)]);
    }
}
