//! Problems of a robot description.

use thiserror::Error;

/// The reason for which a robot description cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// The file cannot be read.
    #[error("{file} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// It is no URDF.
    #[error("{file} is no URDF: {reason}")]
    NotUrdf {
        /// The file.
        file: String,
        /// The parser's message.
        reason: String,
    },
    /// There is no such joint.
    #[error("{file} has no joint {joint:?}")]
    UnknownJoint {
        /// The file.
        file: String,
        /// The name.
        joint: String,
        /// The most similar known name.
        nearest: Option<String>,
        /// The joints that move.
        known: Vec<String>,
    },
    /// The joint is of a type that no axis moves.
    #[error("the joint {joint:?} of {file} is {kind}: no axis moves it")]
    NotMoved {
        /// The file.
        file: String,
        /// The joint.
        joint: String,
        /// Its type, in words.
        kind: &'static str,
    },
    /// The joint mimics another one.
    #[error("the joint {joint:?} of {file} mimics {mimicked:?}: it has no drive of its own")]
    Mimics {
        /// The file.
        file: String,
        /// The joint.
        joint: String,
        /// The joint that it follows.
        mimicked: String,
    },
    /// The axis turns and the joint slides, or the other way round.
    #[error("the joint {joint:?} of {file} is {kind}, and the axis is {travel}")]
    OtherTravel {
        /// The file.
        file: String,
        /// The joint.
        joint: String,
        /// Kind of the joint.
        kind: &'static str,
        /// Kind of the axis.
        travel: &'static str,
    },
    /// An axis may do more than the joint of its name.
    #[error(
        "the axis {axis:?} has a {limit} of {value}, and the joint of that name in {file} allows {allowed}"
    )]
    Wider {
        /// The file.
        file: String,
        /// The axis.
        axis: String,
        /// `position`, `velocity` or `torque`.
        limit: &'static str,
        /// Value of the axis.
        value: String,
        /// Value of the joint.
        allowed: String,
    },
    /// The limits of the position leave no room, or are not finite.
    #[error("the joint {joint:?} of {file} has no room between {low} and {high}{}", if *.are_soft { ", its soft limits" } else { "" })]
    NoRoom {
        /// The file.
        file: String,
        /// The joint.
        joint: String,
        /// Its lowest position: rad (m).
        low: f64,
        /// Its highest position: rad (m).
        high: f64,
        /// True if its soft limits are the cause.
        are_soft: bool,
    },
}

impl UrdfError {
    /// Returns the remedy.
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { .. } => {
                "give the path of a URDF, from the folder of the configuration; of a xacro file, what xacro makes of it".into()
            }
            Self::NotUrdf { .. } => "check_urdf of ROS shows what is wrong with it; a xacro file must be expanded first".into(),
            Self::UnknownJoint { nearest: Some(nearest), .. } => {
                format!("did you mean urdf_joint = {nearest:?}? An axis that is no joint of the file has urdf_joint = \"off\"")
            }
            Self::UnknownJoint { known, .. } => {
                format!("urdf_joint names the joint of the axis, or is \"off\"; the joints that move are: {}", known.join(", "))
            }
            Self::NotMoved { .. } => "name another joint by urdf_joint, or write urdf_joint = \"off\"".into(),
            Self::Mimics { mimicked, .. } => format!(
                "leave it to the mechanism, and configure {mimicked:?}; an axis with a drive of its own has urdf_joint = \"off\" and limits here"
            ),
            Self::OtherTravel { kind, .. } if *kind == SLIDES => "write travel = \"linear\", and the lead".into(),
            Self::OtherTravel { .. } => "leave travel out, or name another joint by urdf_joint".into(),
            Self::Wider { .. } => "narrow the limit of the configuration, or correct the robot description".into(),
            Self::NoRoom { are_soft: true, .. } => "check soft_lower_limit and soft_upper_limit of its <safety_controller>".into(),
            Self::NoRoom { .. } => {
                "check lower and upper of its <limit>: rad or m, finite, the lower one first; a joint that turns without end is of type continuous"
                    .into()
            }
        }
    }
}

pub const SLIDES: &str = "prismatic";
