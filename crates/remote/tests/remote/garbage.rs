//! Packets that no client of takt sends.

use std::mem;

use super::*;

#[test]
fn garbage_from_clients_leaves_the_arm_within_its_limits_and_stops_nothing() {
    let served = Served::start("arm6-erob.toml");
    let path = format!("{}.command", served.name());
    let path = Path::new(&path);
    let client = served.connect();
    client.begin_stream().unwrap();
    let mut random = Random(0xBAD);
    let mut received = [0; PACKET_BYTES];
    let (mut refused, mut answered) = (0, 0);
    let home = positions(&client);
    for round in 0..3000 {
        let role = if round % 8 == 0 { Role::Stops } else { Role::Commands };
        let Ok(connection) = Packets::connect_as(path, role) else { continue };
        let _ = connection.wait_at_most(LONG);
        for _ in 0..4 {
            let packet = garbage(&mut random, &home, role);
            if connection.send(&packet).is_err() {
                break;
            }
            if role == Role::Commands {
                match connection.receive(&mut received, true) {
                    Received::Bytes(_) => answered += 1,
                    Received::Nothing | Received::Closed => {
                        refused += 1;
                        break;
                    }
                }
            }
        }
        if round % 50 == 0 {
            within_limits(&client);
            let group = client.state().groups[0];
            assert_eq!(group.stop, None, "round {round}");
        }
    }
    assert!(refused > 300 && answered > 300, "{refused} were refused, {answered} answered");
    client.stop(StopCategory::Two).unwrap();
    client.take_over().unwrap();
    client.next_cycle(LONG).unwrap();
    client.next_cycle(LONG).unwrap();
    client.wait_for(Phase::Holding, LONG).unwrap();
    let motion = client.move_to(&[0.0; 6]).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
}

/// Random bytes, or a command with some bits turned, neither of which may be a stop.
fn garbage(random: &mut Random, home: &[f64], role: Role) -> Vec<u8> {
    if role == Role::Stops || random.below(3) == 0 {
        // Longer than a stop.
        let length = 3 + random.below(320);
        return (0..length).map(|_| random.next() as u8).collect();
    }
    let axes: Vec<AxisPoint> =
        home.iter().map(|position| AxisPoint::position(position + 0.05 * random.below(100) as f64)).collect();
    let (target, options, positions) = (RequestTarget::All, MoveOptions::default(), vec![0.0; 6]);
    let (asked_ns, interval) = (now_ns(), Duration::from_millis(1));
    let asked = match random.below(5) {
        0 => Asked::Point { target, at_ns: asked_ns, axes },
        1 => Asked::Chunk { target, from_ns: asked_ns, interval, points: vec![axes] },
        2 => takt::Command::Lease { is_taken_over: true }.into(),
        3 => takt::Command::MoveBy { target, options, distances: positions }.into(),
        _ => takt::Command::Move { target, options, positions }.into(),
    };
    let kind_of = |asked: &Asked| match asked {
        Asked::Command(command) => (mem::discriminant(asked), Some(mem::discriminant(command))),
        asked => (mem::discriminant(asked), None),
    };
    let kind = kind_of(&asked);
    let packet = Demand { number: 1, asked_ns, asked }.packet();
    let mut turned = packet.clone();
    for _ in 0..random.below(4) {
        let at = random.below(packet.len() as u64) as usize;
        turned[at] ^= 1 << random.below(8);
    }
    // Neither disabling nor another mode.
    let is_other = Demand::of(&turned).is_some_and(|demand| kind_of(&demand.asked) != kind);
    if is_other { packet } else { turned }
}
