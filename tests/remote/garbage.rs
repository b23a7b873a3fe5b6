//! Packets that no client of takt sends.

use super::*;

#[test]
fn garbage_from_clients_leaves_the_arm_within_its_limits_and_stops_nothing() {
    let served = Served::start("arm6-erob.toml");
    let path = format!("{}.command", served.name());
    let path = Path::new(&path);
    let client = served.connect();
    client.begin_stream().unwrap();
    let mut random = Random(0xBAD);
    let mut words = [0; PACKET_WORDS];
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
                match connection.receive(&mut words, true) {
                    Received::Words(_) => answered += 1,
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

/// Random words, or a command with some bits turned, neither of which may be a stop.
fn garbage(random: &mut Random, home: &[f64], role: Role) -> Vec<u64> {
    let of_length = |random: &mut Random, length: u64| (0..length).map(|_| random.next() | 1 << 40).collect();
    if role == Role::Stops || random.below(3) == 0 {
        let length = random.below(40);
        return of_length(random, length);
    }
    let axes: Vec<AxisPoint> =
        home.iter().map(|position| AxisPoint::position(position + 0.05 * random.below(100) as f64)).collect();
    let now_ns = ClientStream::now_ns();
    // Neither disabling nor another mode.
    let mut words = match random.below(5) {
        0 => [vec![1, now_ns, 12, 0, now_ns], entries(&axes)].concat(),
        1 => [vec![2, now_ns, 13, 0, now_ns, 1_000_000, 1], entries(&axes)].concat(),
        2 => vec![3, now_ns, 1, 1],
        3 => vec![5, now_ns, 20, 0, 1f64.to_bits(), 1f64.to_bits(), 0, 6, 0, 0, 0, 0, 0, 0],
        _ => vec![4, now_ns, 3, 0, 1f64.to_bits(), 1f64.to_bits(), 0, 6, 0, 0, 0, 0, 0, 0],
    };
    let kind = words[2];
    for _ in 0..random.below(4) {
        let at = random.below(words.len() as u64) as usize;
        words[at] ^= 1 << random.below(64);
    }
    words[2] = kind;
    words
}

fn entries(axes: &[AxisPoint]) -> Vec<u64> {
    let words = |point: &AxisPoint| {
        let AxisPoint::Position { motion, torque } = point else { unreachable!() };
        [0, motion.position.to_bits(), 0, 0, 0, 0, torque.to_bits()]
    };
    std::iter::once(axes.len() as u64).chain(axes.iter().flat_map(words)).collect()
}
