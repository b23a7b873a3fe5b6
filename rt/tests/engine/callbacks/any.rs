//! Whatever a callback commands.

use super::rig::{BUDGET_NS, COMMANDED, FINISHED, at, holding, lead, run};
use crate::fixture::PERIOD_S;
use proptest::prelude::*;
use takt_rt::plan::State;
use takt_rt::{AxisTarget, CallbackReturn, CallbackRun, Follow, Phase};

/// What a callback may do in a call.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Command(State),
    Velocity(f64),
    Torque(f64),
    Nothing,
    Late,
}

fn deeds() -> impl Strategy<Value = Vec<(Deed, usize)>> {
    let numbers = prop_oneof![
        -4.0f64..4.0,
        -1e3f64..1e3,
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(1e300),
        Just(f64::MIN),
        Just(f64::MAX)
    ];
    let likely = -2.5f64..2.5;
    let rate = |usual: f64| prop_oneof![20 => -usual..usual, 1 => Just(1e300), 1 => Just(f64::MIN)];
    let state = (prop_oneof![9 => likely, 1 => numbers], rate(3.0), rate(20.0));
    let commanded = state.prop_map(|(position, velocity, acceleration)| {
        Deed::Command(State { position, velocity, acceleration })
    });
    let deed = prop_oneof![
        8 => commanded,
        2 => prop_oneof![-2.5f64..2.5, -1e3f64..1e3, Just(f64::NAN), Just(f64::MAX)].prop_map(Deed::Velocity),
        1 => (-50.0f64..50.0).prop_map(Deed::Torque),
        2 => Just(Deed::Nothing),
        1 => Just(Deed::Late),
    ];
    prop::collection::vec((deed, 1usize..150), 1..20)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn whatever_a_callback_commands_no_limit_is_broken(
        deeds in deeds(),
        jerk in prop_oneof![50.0f64..1000.0, Just(f64::INFINITY)],
        follow in prop::sample::select(&[Follow::Smooth, Follow::Exact][..]),
    ) {
        let mut rig = holding(jerk);
        let mut script = deeds.into_iter().flat_map(|(deed, times)| std::iter::repeat_n(deed, times));
        let cycles = script.size_hint().0.max(500);
        let mut target = State::rest(0.0);
        lead(&mut rig, CallbackRun { follow: Some(follow), overruns_allowed: 10, ..run(1) }, move |_, _, targets| {
            match script.next() {
                None => return FINISHED,
                Some(Deed::Nothing) => {}
                Some(Deed::Torque(torque)) => targets[0] = Some(AxisTarget::Torque(torque)),
                Some(Deed::Velocity(velocity)) => {
                    targets[0] = Some(AxisTarget::Velocity { velocity, acceleration: 0.0 });
                }
                Some(Deed::Late) => return CallbackReturn { spent_ns: 2 * BUDGET_NS, ..COMMANDED },
                Some(Deed::Command(state)) => {
                    target = if follow == Follow::Smooth { state } else { target.after(PERIOD_S) };
                    targets[0] = at(target);
                }
            }
            COMMANDED
        });
        for _ in 0..cycles + 3_000 {
            rig.run(1);
            let axis = &rig.host.snapshot.axes[0];
            let set = [axis.position_set, axis.velocity_set, axis.torque_set];
            prop_assert!(set.iter().all(|number| number.is_finite()), "{set:?}");
        }
        prop_assert!(matches!(rig.phase(), Phase::Holding), "{:?}", rig.phase());
        rig.assert_differences_kept(if follow == Follow::Smooth { jerk } else { f64::INFINITY });
    }
}
