//! Fuzzes both sides of the packets between a controller and clients in other processes.

use takt::remote::{Answer, Demand, Reply, Role, StopRequest};
use takt::telemetry::Machine;

/// What is decoded is encoded to words that are decoded to the same. Nothing asks for more memory than the packet has.
pub fn run(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let words: Vec<u64> = rest.as_chunks::<8>().0.iter().map(|word| u64::from_le_bytes(*word)).collect();
    match kind % 4 {
        0 | 1 => demand(&words),
        2 => reply(&words),
        _ => {
            if let Ok(stop) = StopRequest::of(&words) {
                assert_eq!(stop.words()[..], words);
            }
            // A packet is the begin of commands, of stops, or of nothing.
            let _ = Role::of(&words);
        }
    }
}

fn demand(words: &[u64]) {
    let Ok(demand) = Demand::of(words) else { return };
    let encoded = demand.words();
    // What a kind of point does not have is not encoded again, and a number may be none, which is not equal to itself.
    assert_eq!(encoded.len(), words.len());
    let again = Demand::of(&encoded).expect("it was encoded here");
    assert_eq!(again.words(), encoded);
    assert_eq!(again.number, demand.number);
}

fn reply(words: &[u64]) {
    let machine =
        Machine { name: "arm".to_owned(), cycle_ns: 1_000_000, axes: vec![], buses: vec![], groups: vec![] };
    let Ok(answer) = Answer::of(words, &machine) else { return };
    let encoded = answer.words();
    let again = Answer::of(&encoded, &machine).expect("it was encoded here");
    assert_eq!(again.words(), encoded);
    // Every refusal has words.
    let text = match answer.reply {
        Reply::Done | Reply::Motion(_) | Reply::Progress(_) | Reply::BringUpFailure(_) => return,
        Reply::Refused(error) => error.to_string(),
        Reply::NotTaken(error) => error.to_string(),
    };
    assert!(!text.is_empty());
}
