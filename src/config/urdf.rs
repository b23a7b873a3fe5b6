//! The limits of joints from a robot description (URDF).
//!
//! Units are those of the format: rad and N·m for joints that turn, m and N for those that slide. `urdf-rs` reads the file, and cannot tell
//! an attribute that is absent from one that is 0. No joint can be moved within a limit of 0, so that 0 is taken as not said.

use std::path::{Path, PathBuf};

use takt_wire::printable::{excerpt, printable_path};
use urdf_rs::{Joint, JointType, Robot};

use super::model::{Axis, Config, Travel};
use super::quantities::Quantities;
use super::quantity::Quantity;
use super::spelling;
use super::urdf_error::{SLIDES, UrdfError};
use super::urdf_limits::LimitOrigin;

/// Deepest nesting of elements. A URDF needs five levels, extensions of simulators some more. `urdf-rs` needs time that grows with the
/// square of the depth.
const DEEPEST: usize = 100;

/// A robot description.
pub struct Urdf {
    path: PathBuf,
    robot: Robot,
}

/// The joint that an axis moves, by a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfJoint {
    /// Its name.
    pub name: String,
    /// The file.
    pub file: PathBuf,
    /// True if it slides.
    pub is_linear: bool,
    /// Lowest and highest position: rad (m), and where they are from; `None` for a joint that turns without end.
    pub position: Option<([f64; 2], LimitOrigin)>,
    /// rad/s (m/s); `None` where the file does not say it.
    pub velocity: Option<f64>,
    /// N·m (N); `None` where the file does not say it.
    pub effort: Option<f64>,
}

impl Urdf {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is no URDF.
    pub fn load(path: &Path) -> Result<Self, UrdfError> {
        let unreadable =
            |reason: String| UrdfError::Unreadable { file: printable_path(path), reason: excerpt(&reason) };
        let bytes = takt_wire::text_file::read(path).map_err(|error| unreadable(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|_| unreadable("it is not text in UTF-8".to_owned()))?;
        Self::parse(path, &text)
    }

    /// Reads a text. `path` is what messages call it.
    ///
    /// # Errors
    /// It is no URDF.
    pub fn parse(path: &Path, text: &str) -> Result<Self, UrdfError> {
        let not_urdf =
            |reason: &str| UrdfError::NotUrdf { file: printable_path(path), reason: excerpt(reason) };
        if is_too_deep(text) {
            return Err(not_urdf(&format!("its elements are nested more than {DEEPEST} deep")));
        }
        let robot = urdf_rs::read_from_string(text).map_err(|error| not_urdf(&error.to_string()))?;
        Ok(Self { path: path.to_owned(), robot })
    }

    /// Returns `true` if there is a joint of this name.
    pub fn has_joint(&self, name: &str) -> bool {
        self.robot.joints.iter().any(|joint| joint.name == name)
    }

    /// Returns the description of the joint of an axis.
    ///
    /// # Errors
    /// There is no such joint, or no axis of this travel can move it, or its limits leave no room.
    pub fn joint(&self, name: &str, travel: Travel) -> Result<UrdfJoint, UrdfError> {
        let file = printable_path(&self.path);
        let Some(joint) = self.robot.joints.iter().find(|joint| joint.name == name) else {
            return Err(self.unknown(file, name));
        };
        let name = excerpt(name);
        let kind = match joint.joint_type {
            JointType::Revolute => "revolute",
            JointType::Continuous => "continuous",
            JointType::Prismatic => SLIDES,
            JointType::Fixed => return Err(UrdfError::NotMoved { file, joint: name, kind: "fixed" }),
            JointType::Floating => return Err(UrdfError::NotMoved { file, joint: name, kind: "floating" }),
            JointType::Planar => return Err(UrdfError::NotMoved { file, joint: name, kind: "planar" }),
            JointType::Spherical => return Err(UrdfError::NotMoved { file, joint: name, kind: "spherical" }),
        };
        if let Some(mimic) = &joint.mimic {
            return Err(UrdfError::Mimics { file, joint: name, mimicked: excerpt(&mimic.joint) });
        }
        let is_linear = kind == SLIDES;
        if is_linear != (travel != Travel::Rotary) {
            let travel = if is_linear { "rotary" } else { "linear" };
            return Err(UrdfError::OtherTravel { file, joint: name, kind, travel });
        }
        let said = |value: f64| Some(value).filter(|value| *value != 0.0 && *value != f64::INFINITY);
        let position = match joint.joint_type {
            JointType::Continuous => None,
            _ => Some(position(joint, file, name.clone())?),
        };
        let (velocity, effort) = (said(joint.limit.velocity), said(joint.limit.effort));
        Ok(UrdfJoint { name, file: self.path.clone(), is_linear, position, velocity, effort })
    }

    /// In what axes may do more than the joints of their names; empty where nothing contradicts the description. An axis without a joint
    /// of its name is none of it.
    pub fn contradictions(&self, config: &Config) -> Vec<UrdfError> {
        config
            .axes
            .iter()
            .filter(|axis| self.has_joint(&axis.name))
            .flat_map(|axis| self.wider(axis))
            .collect()
    }

    fn wider(&self, axis: &Axis) -> Vec<UrdfError> {
        let joint = match self.joint(&axis.name, axis.travel) {
            Ok(joint) => joint,
            Err(error) => return vec![error],
        };
        let (q, limits) = (Quantities::of(axis.travel), &axis.limits);
        let wider = |limit, value, allowed| {
            let (file, axis) = (printable_path(&self.path), axis.name.clone());
            UrdfError::Wider { file, axis, limit, value, allowed }
        };
        let magnitude = |limit, quantity: Quantity, value: f64, most: Option<f64>| {
            let most = most.filter(|most| exceeds(value, *most, *most))?;
            Some(wider(limit, quantity.show(value), quantity.show(most)))
        };
        let range = limits.position_max - limits.position_min;
        let position = joint.position.filter(|([low, high], _)| {
            exceeds(*low, limits.position_min, range) || exceeds(limits.position_max, *high, range)
        });
        let show = |[low, high]: [f64; 2]| format!("{} to {}", q.position.show(low), q.position.show(high));
        let position = position.map(|(allowed, _)| {
            wider("position", show([limits.position_min, limits.position_max]), show(allowed))
        });
        let velocity = magnitude("velocity", q.velocity, limits.velocity, joint.velocity);
        let torque = magnitude("torque", q.effort, limits.torque, joint.effort);
        [position, velocity, torque].into_iter().flatten().collect()
    }

    fn unknown(&self, file: String, name: &str) -> UrdfError {
        let moves = |joint: &&Joint| {
            let kind = &joint.joint_type;
            matches!(kind, JointType::Revolute | JointType::Continuous | JointType::Prismatic)
        };
        let known: Vec<&str> =
            self.robot.joints.iter().filter(moves).map(|joint| joint.name.as_str()).collect();
        let nearest = spelling::nearest(name, known.iter().copied()).map(excerpt);
        let known = known.into_iter().map(excerpt).collect();
        UrdfError::UnknownJoint { file, joint: excerpt(name), nearest, known }
    }
}

/// Returns `true` if elements are nested more than [`DEEPEST`] deep.
fn is_too_deep(text: &str) -> bool {
    let (mut rest, mut depth) = (text, 0_usize);
    while let Some((_, markup)) = rest.split_once('<') {
        let end = match markup {
            _ if markup.starts_with("!--") => markup.find("-->"),
            _ if markup.starts_with("![CDATA[") => markup.find("]]>"),
            _ => tag_end(markup),
        };
        let (inner, behind) = markup.split_at(end.unwrap_or(markup.len()));
        if inner.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !inner.starts_with(['!', '?']) && !inner.ends_with('/') {
            depth += 1;
        }
        if depth > DEEPEST {
            return true;
        }
        rest = behind;
    }
    false
}

/// Returns the end of a tag: the first `>` that is not within quotes.
fn tag_end(markup: &str) -> Option<usize> {
    let mut quote = None;
    markup.find(|letter| {
        match quote {
            None if matches!(letter, '"' | '\'') => quote = Some(letter),
            Some(open) if open == letter => quote = None,
            _ => {}
        }
        quote.is_none() && letter == '>'
    })
}

/// Returns `true` if a value is above another one, by more than the rounding of a unit.
pub fn exceeds(value: f64, most: f64, scale: f64) -> bool {
    value - most > 1e-9 * scale.abs()
}

/// The limits of the position: the narrower ones of `<limit>` and `<safety_controller>`.
fn position(joint: &Joint, file: String, name: String) -> Result<([f64; 2], LimitOrigin), UrdfError> {
    let (low, high) = (joint.limit.lower, joint.limit.upper);
    // A comparison with NaN is false.
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(UrdfError::NoRoom { file, joint: name, low, high, are_soft: false });
    }
    // Both are 0 where the file does not say them.
    let soft = joint.safety_controller.as_ref().filter(|soft| {
        (soft.soft_lower_limit, soft.soft_upper_limit) != (0.0, 0.0)
            && (soft.soft_lower_limit > low || soft.soft_upper_limit < high)
    });
    let Some(soft) = soft else { return Ok(([low, high], LimitOrigin::Limit)) };
    let (low, high) = (low.max(soft.soft_lower_limit), high.min(soft.soft_upper_limit));
    if low < high {
        Ok(([low, high], LimitOrigin::SafetyController))
    } else {
        Err(UrdfError::NoRoom { file, joint: name, low, high, are_soft: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(text: &str) -> Option<String> {
        Urdf::parse(Path::new("arm.urdf"), text).err().map(|error| error.to_string())
    }

    /// The parser needs time that grows with the square of the depth: hours for this one.
    #[test]
    fn elements_that_are_nested_deeper_than_any_robot_description_are_refused_before_they_are_parsed() {
        let reason = reason(&format!("<robot name='r'>{}", "<a>".repeat(1_000_000))).unwrap();
        assert_eq!(reason, "arm.urdf is no URDF: its elements are nested more than 100 deep");
    }

    #[test]
    fn what_is_no_nested_element_counts_as_none() {
        let flat =
            "<!-- <a> --><link name='a > b'/><link name=\"c > '\"></link><x><![CDATA[<a>]]></x>".repeat(200);
        assert!(!is_too_deep(&format!("<?xml version='1.0'?><robot name='r'>{flat}</robot>")));
        assert_eq!(
            reason("<?xml version='1.0'?><!-- <a> --><robot name='r'><link name='a > b'/></robot>"),
            None
        );
    }
}
