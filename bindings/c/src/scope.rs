//! The axes that a handle stands for.

use std::sync::Mutex;

use takt::rt::RequestTarget;
use takt::{AnyHandle, Controller, Handle, VirtualController};

/// Axes of a controller.
pub(crate) struct Scope {
    /// Commands them, in a controller of this process or of another one.
    pub controller: AnyHandle,
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
    pub(crate) fn all(controller: AnyHandle, own: Option<Handle>, owner: Option<Owner>) -> Self {
        let (target, axes) = (controller.target(), controller.axis_numbers());
        Self { controller, own, target, axes, owner: Mutex::new(owner) }
    }

    /// Those of one of its groups.
    pub(crate) fn group(&self, target: RequestTarget) -> Self {
        let (controller, own) = (self.controller.of(target), self.own.clone());
        let axes = controller.axis_numbers();
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
