//! The known word that is most like a misspelt one.

/// The candidate most like a word, if any is like it at all.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |candidate: &str| {
        let (word, candidate) = (word.to_lowercase(), candidate.to_lowercase());
        let whole = strsim::normalized_damerau_levenshtein(&word, &candidate);
        let is_part = word.len() >= 4 && (candidate.contains(&word) || word.contains(&candidate));
        if is_part { whole.max(0.7) } else { whole }
    };
    candidates
        .into_iter()
        .map(|candidate| (likeness(candidate), candidate))
        .filter(|(likeness, _)| *likeness >= 0.5)
        // Of equals the first one: candidates come with the usual ones first.
        .reduce(|best, next| if next.0 > best.0 { next } else { best })
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_finds_what_was_meant_and_nonsense_finds_nothing() {
        let keys = ["velocity", "acceleration", "torque", "position"];
        assert_eq!(nearest("velocty", keys), Some("velocity"));
        assert_eq!(nearest("max_torque", keys), Some("torque"));
        assert_eq!(nearest("Position", keys), Some("position"));
        assert_eq!(nearest("colour", keys), None);
        assert_eq!(nearest("erob", ["erob-canopen", "erob-can", "erob-modbus"]), Some("erob-canopen"));
    }
}
