//! Messages from one thread to any number of readers. They are few, and all of them are kept. Neither side waits for the other.

use std::sync::OnceLock;

/// The messages, in their order.
#[derive(Debug, Default)]
pub(super) struct Messages(OnceLock<Box<(String, Messages)>>);

impl Messages {
    /// Adds a message behind the others.
    pub(super) fn add(&self, message: String) {
        let mut end = self;
        while let Some(link) = end.0.get() {
            end = &link.1;
        }
        // One thread adds, so the place is still free.
        let _ = end.0.set(Box::new((message, Self::default())));
    }

    /// All messages until now.
    pub(super) fn all(&self) -> Vec<String> {
        let links = std::iter::successors(self.0.get(), |link| link.1.0.get());
        links.map(|link| link.0.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_stay_in_their_order() {
        let messages = Messages::default();
        assert!(messages.all().is_empty());
        ["a", "b", "c"].into_iter().for_each(|message| messages.add(message.to_owned()));
        assert_eq!(messages.all(), ["a", "b", "c"]);
    }
}
