//! Fuzzes the reader of configurations with arbitrary text.

use takt::config::{Config, ConfigError};
use takt::controller::assemble;
use takt::schedule;

/// Reads a text as a configuration. A valid one can be checked and assembled. An error says what is wrong, and where.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match Config::parse("fuzz", text) {
        Err(error) => assert_explained(text, &error),
        Ok(config) => {
            // The buses may not be able to carry it, but the check must give a result.
            let _ = schedule::verify(&config);
            assemble::engine(&config).expect("a configuration that passed its checks can be assembled");
        }
    }
}

pub fn assert_explained(text: &str, error: &ConfigError) {
    assert!(!error.problems().is_empty(), "refused without a reason");
    for problem in error.problems() {
        let span = problem.span().expect("the text could be read");
        assert!(text.get(span.clone()).is_some(), "{span:?} is no part of the text");
        assert!(error.line(problem).is_some_and(|line| line <= text.lines().count().max(1) + 1));
        assert!(!problem.to_string().is_empty() && !problem.kind.help().is_empty());
    }
}
