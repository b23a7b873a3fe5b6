//! The limits of joints from a robot description (URDF).
//!
//! Units are those of the format: rad and N·m for joints that turn, m and N for those that slide. No joint can be moved within a limit of
//! 0, as programs for drawing write where they know none: it counts as missing.

use std::path::{Path, PathBuf};

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Decoder, Reader};
use takt_wire::printable::{excerpt, printable_path};

use super::model::{Axis, Config, Travel};
use super::quantities::Quantities;
use super::quantity::Quantity;
use super::spelling;
use super::urdf_error::{SLIDES, UrdfError};
use super::urdf_limits::LimitOrigin;

/// A robot description.
pub struct Urdf {
    path: PathBuf,
    joints: Vec<Joint>,
}

/// A joint as it is written.
#[derive(Default)]
struct Joint {
    name: String,
    kind: String,
    elements: Vec<String>,
    /// Elements of the joint, their attributes and values.
    values: Vec<(String, String, String)>,
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

/// The types of joints that an axis can move.
const MOVED: [&str; 3] = ["revolute", "continuous", SLIDES];
/// All types of joints.
const KINDS: [&str; 7] = ["revolute", "continuous", SLIDES, "fixed", "floating", "planar", "spherical"];
/// The elements of a joint that have its limits.
const READ: [&str; 3] = ["limit", "safety_controller", "mimic"];

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
        let joints = Joints::read(text).map_err(|reason| not_urdf(path, &reason))?;
        Ok(Self { path: path.to_owned(), joints })
    }

    /// Returns `true` if there is a joint of this name.
    pub fn has_joint(&self, name: &str) -> bool {
        self.joints.iter().any(|joint| joint.name == name)
    }

    /// Returns the description of the joint of an axis.
    ///
    /// # Errors
    /// There is no such joint, or no axis of this travel can move it, or its limits leave no room.
    pub fn joint(&self, name: &str, travel: Travel) -> Result<UrdfJoint, UrdfError> {
        let file = printable_path(&self.path);
        let Some(joint) = self.joints.iter().find(|joint| joint.name == name) else {
            return Err(self.unknown(file, name));
        };
        let name = excerpt(name);
        let Some(kind) = KINDS.into_iter().find(|kind| *kind == joint.kind) else {
            let reason = format!("the joint {name:?} has the type {:?}", excerpt(&joint.kind));
            return Err(not_urdf(&self.path, &reason));
        };
        if !MOVED.contains(&kind) {
            return Err(UrdfError::NotMoved { file, joint: name, kind });
        }
        if joint.has("mimic") {
            let mimicked = joint.value("mimic", "joint").unwrap_or_default();
            return Err(UrdfError::Mimics { file, joint: name, mimicked: excerpt(mimicked) });
        }
        let is_linear = kind == SLIDES;
        if is_linear != (travel != Travel::Rotary) {
            let travel = if is_linear { "rotary" } else { "linear" };
            return Err(UrdfError::OtherTravel { file, joint: name, kind, travel });
        }
        let number = |element, attribute| {
            joint.number(element, attribute).map_err(|reason| not_urdf(&self.path, &reason))
        };
        let limit = |attribute| {
            number("limit", attribute)
                .map(|value| value.filter(|value| *value != 0.0 && *value != f64::INFINITY))
        };
        let position = match kind {
            "continuous" => None,
            _ => {
                let bounds = |element, low, high| {
                    Ok([number(element, low)?.unwrap_or(0.0), number(element, high)?.unwrap_or(0.0)])
                };
                let hard = bounds("limit", "lower", "upper")?;
                let soft = bounds("safety_controller", "soft_lower_limit", "soft_upper_limit")?;
                Some(position(hard, soft, file, name.clone())?)
            }
        };
        let (velocity, effort) = (limit("velocity")?, limit("effort")?);
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
        let moves = |joint: &&Joint| MOVED.contains(&joint.kind.as_str());
        let known: Vec<&str> = self.joints.iter().filter(moves).map(|joint| joint.name.as_str()).collect();
        let nearest = spelling::nearest(name, known.iter().copied()).map(excerpt);
        let known = known.into_iter().map(excerpt).collect();
        UrdfError::UnknownJoint { file, joint: excerpt(name), nearest, known }
    }
}

impl Joint {
    fn has(&self, element: &str) -> bool {
        self.elements.iter().any(|name| name == element)
    }

    fn value(&self, element: &str, attribute: &str) -> Option<&str> {
        let mut values = self.values.iter();
        values.find(|(of, name, _)| of == element && name == attribute).map(|(.., value)| value.as_str())
    }

    fn number(&self, element: &str, attribute: &str) -> Result<Option<f64>, String> {
        let Some(value) = self.value(element, attribute) else { return Ok(None) };
        let number = value.trim().parse().map_err(|_| {
            let (joint, value) = (excerpt(&self.name), excerpt(value));
            format!("{attribute} in <{element}> of the joint {joint:?} is {value:?}, not a number")
        });
        number.map(Some)
    }
}

/// The joints of a robot description while it is read.
#[derive(Default)]
struct Joints {
    read: Vec<Joint>,
    depth: usize,
    is_in_joint: bool,
    has_begun: bool,
}

impl Joints {
    /// Reads the joints of a robot description. The rest may be any XML: simulators and programs for drawing write textures without
    /// files, shapes without sizes, and elements of their own.
    fn read(text: &str) -> Result<Vec<Joint>, String> {
        let (mut reader, mut joints) = (Reader::from_str(text), Self::default());
        reader.config_mut().expand_empty_elements = true;
        loop {
            let step = match reader.read_event() {
                Ok(Event::Start(element)) => joints.begin(&element, reader.decoder()),
                Ok(Event::End(_)) => {
                    joints.depth -= 1;
                    Ok(())
                }
                Ok(Event::Eof) if joints.depth > 0 => Err("it ends within an element".to_owned()),
                Ok(Event::Eof) if !joints.has_begun => Err("it has no element \"robot\"".to_owned()),
                Ok(Event::Eof) => return Ok(joints.read),
                Ok(_) => Ok(()),
                Err(error) => Err(error.to_string()),
            };
            step.map_err(|reason| {
                let position = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
                let lines = text.bytes().take(position).filter(|byte| *byte == b'\n').count();
                format!("line {}: {reason}", lines + 1)
            })?;
        }
    }

    fn begin(&mut self, element: &BytesStart<'_>, decoder: Decoder) -> Result<(), String> {
        self.depth += 1;
        self.has_begun = true;
        let name = String::from_utf8_lossy(element.name().as_ref()).into_owned();
        match self.depth {
            1 if name != "robot" => Err(format!("its first element is {:?}, not \"robot\"", excerpt(&name))),
            2 => {
                self.is_in_joint = name == "joint";
                if self.is_in_joint {
                    let mut joint = Joint::default();
                    for (key, value) in attributes(element, decoder)? {
                        match key.as_str() {
                            "name" => joint.name = value,
                            "type" => joint.kind = value,
                            _ => {}
                        }
                    }
                    self.read.push(joint);
                }
                Ok(())
            }
            3 if self.is_in_joint && READ.contains(&name.as_str()) => {
                let Some(joint) = self.read.last_mut() else { return Ok(()) };
                joint.elements.push(name.clone());
                let attributes = attributes(element, decoder)?;
                joint.values.extend(attributes.into_iter().map(|(key, value)| (name.clone(), key, value)));
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

fn attributes(element: &BytesStart<'_>, decoder: Decoder) -> Result<Vec<(String, String)>, String> {
    let read = element.attributes().map(|attribute| {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let value = attribute.decode_and_unescape_value(decoder).map_err(|error| error.to_string())?;
        Ok((String::from_utf8_lossy(attribute.key.as_ref()).into_owned(), value.into_owned()))
    });
    read.collect()
}

fn not_urdf(path: &Path, reason: &str) -> UrdfError {
    UrdfError::NotUrdf { file: printable_path(path), reason: excerpt(reason) }
}

/// Returns `true` if a value is above another one, by more than the rounding of a unit.
pub fn exceeds(value: f64, most: f64, scale: f64) -> bool {
    value - most > 1e-9 * scale.abs()
}

/// Returns the limits of the position: the narrower ones of `<limit>` and `<safety_controller>`.
fn position(
    [low, high]: [f64; 2],
    soft: [f64; 2],
    file: String,
    joint: String,
) -> Result<([f64; 2], LimitOrigin), UrdfError> {
    // A comparison with NaN is false.
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(UrdfError::NoRoom { file, joint, low, high, are_soft: false });
    }
    // Both are 0 where the file does not have them.
    if soft == [0.0, 0.0] || !(soft[0] > low || soft[1] < high) {
        return Ok(([low, high], LimitOrigin::Limit));
    }
    let (low, high) = (low.max(soft[0]), high.min(soft[1]));
    if low < high {
        Ok(([low, high], LimitOrigin::SafetyController))
    } else {
        Err(UrdfError::NoRoom { file, joint, low, high, are_soft: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(text: &str) -> Option<String> {
        Urdf::parse(Path::new("arm.urdf"), text).err().map(|error| error.to_string())
    }

    #[test]
    fn a_file_that_is_no_robot_description_is_refused_with_its_line() {
        let deep = format!("<robot name='r'>{}", "<a>".repeat(1_000_000));
        for (text, reason_of) in [
            ("", "line 1: it has no element \"robot\""),
            ("plain text", "line 1: it has no element \"robot\""),
            ("<sdf/>", "line 1: its first element is \"sdf\", not \"robot\""),
            (
                "<robot>\n<link></robot>",
                "line 2: ill-formed document: expected `</link>`, but `</robot>` was found",
            ),
            (deep.as_str(), "line 1: it ends within an element"),
        ] {
            assert_eq!(reason(text), Some(format!("arm.urdf is no URDF: {reason_of}")));
        }
    }

    #[test]
    fn nothing_but_its_joints_can_refuse_a_robot_description() {
        let text = "<?xml version='1.0'?><!DOCTYPE robot><robot name='r'><link name='a &gt; b'><visual><material><texture/></material>\
                    <geometry><box size=''/></geometry></visual></link><sensor:camera name='c' name='c' size/>\
                    <joint name='other' type='screw'><limit lower='a'/></joint><transmission><joint name='t'/></transmission>\
                    <joint name='j' type='revolute'><limit lower='-1' upper='2' effort='3' velocity='4'/></joint></robot>";
        let urdf = Urdf::parse(Path::new("arm.urdf"), text).unwrap();
        let joint = urdf.joint("j", Travel::Rotary).unwrap();
        assert_eq!(joint.position, Some(([-1.0, 2.0], LimitOrigin::Limit)));
        assert_eq!((joint.effort, joint.velocity), (Some(3.0), Some(4.0)));
        assert!(!urdf.has_joint("t"));
        let mimics = text.replace("<limit lower='-1'", "<mimic/><limit lower='-1'");
        let refused = Urdf::parse(Path::new("arm.urdf"), &mimics).unwrap().joint("j", Travel::Rotary);
        assert!(matches!(refused, Err(UrdfError::Mimics { .. })), "{refused:?}");
        let refused = urdf.joint("other", Travel::Rotary).unwrap_err().to_string();
        assert_eq!(refused, "arm.urdf is no URDF: the joint \"other\" has the type \"screw\"");
        let urdf = Urdf::parse(Path::new("arm.urdf"), &text.replace("upper='2'", "upper='2 rad'")).unwrap();
        let refused = urdf.joint("j", Travel::Rotary).unwrap_err().to_string();
        assert_eq!(
            refused,
            "arm.urdf is no URDF: upper in <limit> of the joint \"j\" is \"2 rad\", not a number"
        );
    }
}
