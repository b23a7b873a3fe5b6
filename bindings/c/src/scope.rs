//! The axes that a handle stands for.

use std::sync::{Arc, Mutex};

use takt::rt::RequestTarget;
use takt::{Controller, Handle, RunningController, VirtualController};

/// Axes of a controller.
pub(crate) struct Scope {
    /// The controller, of this process or of another one.
    pub controller: Arc<dyn RunningController>,
    /// The same, if it is of this process.
    pub own: Option<Handle>,
    /// All axes of the controller, or those of one group.
    pub target: RequestTarget,
    /// The numbers of the axes among those of the controller.
    pub axes: Vec<usize>,
    /// The run, if the handle owns it. Closing takes it.
    pub owner: Mutex<Option<Owner>>,
}

impl Scope {
    /// All axes of a controller, which `own` is a handle of if it is of this process.
    pub(crate) fn all(
        controller: Arc<dyn RunningController>,
        own: Option<Handle>,
        owner: Option<Owner>,
    ) -> Self {
        let target = RequestTarget::All;
        let axes = controller.axes_of(target);
        Self { controller, own, target, axes, owner: Mutex::new(owner) }
    }

    /// Those of one of its groups.
    pub(crate) fn group(&self, target: RequestTarget) -> Self {
        let axes = self.controller.axes_of(target);
        let (controller, own) = (Arc::clone(&self.controller), self.own.clone());
        Self { controller, own, target, axes, owner: Mutex::new(None) }
    }

    /// The names of its axes, in their order.
    pub(crate) fn axis_names(&self) -> Vec<&str> {
        let known = &self.controller.machine().axes;
        self.axes.iter().filter_map(|axis| known.get(*axis)).map(|axis| axis.name.as_str()).collect()
    }

    /// The name of its group; `None` for all axes.
    pub(crate) fn group_name(&self) -> Option<&str> {
        match self.target {
            RequestTarget::Group(group) => {
                self.controller.machine().groups.get(usize::from(group)).map(String::as_str)
            }
            RequestTarget::All => None,
        }
    }
}

/// The owner of a run.
pub(crate) enum Owner {
    Real(Controller),
    Virtual(VirtualController),
}
