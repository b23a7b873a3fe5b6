//! Fuzzes the reader of trajectory problems of `takt plan`, in JSON lines, with arbitrary text.

#[path = "../../crates/cli/src/plan/answer.rs"]
mod answer;
#[path = "../../crates/cli/src/plan/question.rs"]
mod question;

use answer::Answer;
use question::Question;

/// Answers every line of a text with one line of JSON that has a result.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for (index, line) in text.lines().enumerate() {
        let answer = match Question::parse(line) {
            Ok(question) => {
                let (answer, profiles) = question.solve();
                let duration_s =
                    profiles.iter().flatten().map(|profile| profile.duration_s()).fold(0.0, f64::max);
                assert!(duration_s.is_finite());
                answer
            }
            Err(message) => {
                assert!(!message.is_empty());
                Answer::malformed(index + 1, message)
            }
        };
        let json = serde_json::to_string(&answer).expect("an answer is plain data");
        let read: serde_json::Value = serde_json::from_str(&json).expect("what was written is JSON");
        assert!(read["result"].is_string(), "{json}");
        if read["result"] == "ok" {
            // JSON has no infinite numbers: such a number would be null.
            for key in ["duration", "t_min", "t", "p", "v", "a", "pmin", "pmax"] {
                let field = read[key].to_string();
                assert!(!field.contains("null"), "{line}: {key} is {field}");
            }
        }
    }
}
