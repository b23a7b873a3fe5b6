//! Failures of bringing drives up again.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The last failure of each group, in words. Clones see the same.
#[derive(Clone, Debug, Default)]
pub struct BringUpFailures(Arc<Mutex<BTreeMap<u8, String>>>);

impl BringUpFailures {
    /// Keeps the failure of these groups.
    pub fn note(&self, groups: &[u8], words: &str) {
        self.failures().extend(groups.iter().map(|group| (*group, words.to_owned())));
    }

    /// Forgets the failures of these groups, which are being brought up.
    pub fn forget(&self, groups: &[u8]) {
        self.failures().retain(|group, _| !groups.contains(group));
    }

    /// Returns the failure of the last bring-up of a group; `None` if that has succeeded or is under way.
    pub fn of(&self, group: u8) -> Option<String> {
        self.failures().get(&group).cloned()
    }

    fn failures(&self) -> MutexGuard<'_, BTreeMap<u8, String>> {
        // A panic of another holder of the lock leaves whole texts.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
