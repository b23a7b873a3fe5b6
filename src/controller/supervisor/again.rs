//! The bring-up of groups that have gone back to passive.

use takt_rt::{Answer, Frame, Phase, RequestId, Snapshot};

use crate::config::Config;
use crate::family::bring_up::BringUp;

/// The bring-up of some groups.
pub(super) struct BringUpAgain {
    /// The numbers of the groups, and of their axes.
    pub groups: Vec<u8>,
    pub axes: Vec<usize>,
    pub bring_up: BringUp,
    pub step: Step,
    /// The requests that make the groups active again.
    pub activations: Vec<RequestId>,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Configure,
    Start,
    /// The groups are to be active. The drives have to report within the time of a stage.
    Report {
        since_ns: u64,
    },
    /// The groups are to be active, so that the drives show what is wrong with them.
    Failed,
}

impl BringUpAgain {
    /// Of the groups that are passive; `None` if there are none.
    pub fn of_passive(config: &Config, first: &BringUp, snapshot: &Snapshot) -> Option<Self> {
        let numbered = (0..).zip(snapshot.groups());
        let passive = numbered.filter(|(_, group)| group.phase == Phase::Passive).map(|(number, _)| number);
        let groups: Vec<u8> = passive.collect();
        if groups.is_empty() {
            return None;
        }
        let axes: Vec<usize> =
            groups.iter().flat_map(|group| config.axes_of_group((*group).into())).collect();
        let bring_up = first.again(&axes);
        Some(Self { groups, axes, bring_up, step: Step::Configure, activations: vec![] })
    }

    /// Takes a received frame.
    pub fn receive(&mut self, bus: usize, frame: &Frame) {
        self.bring_up.receive(bus, frame);
    }

    /// Returns `true` if the requests that make its groups active have been carried out.
    pub fn is_activated(&self, snapshot: &Snapshot) -> bool {
        let answers = &snapshot.answers;
        self.activations.iter().all(|id| answers.of(*id) != Answer::None || answers.have_forgotten(*id))
    }

    pub fn is_any_passive(&self, snapshot: &Snapshot) -> bool {
        let mut groups = self.groups.iter().filter_map(|group| snapshot.groups().get(usize::from(*group)));
        groups.any(|group| group.phase == Phase::Passive)
    }

    /// Returns `true` if it has the drive of this axis to itself.
    pub fn speaks_to(&self, axis: usize) -> bool {
        matches!(self.step, Step::Configure | Step::Start) && self.axes.contains(&axis)
    }
}
