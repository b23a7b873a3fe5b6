//! Fuzzes both sides of the packets between a controller and clients in other processes.

use takt_remote::packets::{Answer, Demand, Replied, Role, StopRequest};

/// What is decoded is encoded to a packet that is decoded to the same. Nothing asks for more memory than the packet can fill.
/// Returns whether it was decoded.
pub fn run(bytes: &[u8]) -> bool {
    let Some((kind, packet)) = bytes.split_first() else { return false };
    match kind % 4 {
        0 | 1 => demand(packet),
        2 => reply(packet),
        _ => {
            let stop = StopRequest::of(packet);
            if let Some(stop) = &stop {
                assert_eq!(stop.packet(), packet);
            }
            // A packet is the begin of commands, of stops, or of nothing.
            stop.is_some() || Role::of(packet).is_some()
        }
    }
}

fn demand(packet: &[u8]) -> bool {
    let Some(demand) = Demand::of(packet) else { return false };
    // A number may be NaN, which is not equal to itself.
    let encoded = demand.packet();
    let again = Demand::of(&encoded).expect("it was encoded here");
    assert_eq!(again.packet(), encoded);
    assert_eq!(again.number, demand.number);
    true
}

fn reply(packet: &[u8]) -> bool {
    let Some(answer) = Answer::of(packet) else { return false };
    let encoded = answer.packet();
    let again = Answer::of(&encoded).expect("it was encoded here");
    assert_eq!(again.packet(), encoded);
    // Every refusal has words.
    match answer.reply {
        Replied::Command(Ok(_)) | Replied::Points(Ok(())) => {}
        Replied::Command(Err(error)) => assert!(!error.to_string().is_empty()),
        Replied::Points(Err(error)) => assert!(!error.to_string().is_empty()),
    }
    true
}
