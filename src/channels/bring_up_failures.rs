//! Why the drives of groups were not brought up again.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The last failure of each group, in words. Clones see the same.
#[derive(Clone, Debug, Default)]
pub struct BringUpFailures(Arc<Mutex<BTreeMap<u8, String>>>);

impl BringUpFailures {
    /// Keeps why these groups were not brought up.
    pub fn note(&self, groups: &[u8], words: &str) {
        self.failures().extend(groups.iter().map(|group| (*group, words.to_owned())));
    }

    /// These groups are brought up anew.
    pub fn forget(&self, groups: &[u8]) {
        self.failures().retain(|group, _| !groups.contains(group));
    }

    /// Why a group was not brought up at its last bring-up; `None` if it was, or is being brought up.
    pub fn of(&self, group: u8) -> Option<String> {
        self.failures().get(&group).cloned()
    }

    fn failures(&self) -> MutexGuard<'_, BTreeMap<u8, String>> {
        // A panic of another holder of the lock leaves whole texts.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
