//! The messages in CDR.

use takt::telemetry::{CdrDecoder, CdrEncoder};

/// Joint states at a time: `sensor_msgs/msg/JointState`.
pub struct JointState<'a> {
    /// When they were so, in ns since 1970.
    pub at_ns: u64,
    /// The names of the joints.
    pub names: &'a [String],
    /// rad (m)
    pub positions: &'a [f64],
    /// rad/s (m/s)
    pub velocities: &'a [f64],
    /// N·m (N); empty where not every drive reports its torque.
    pub efforts: &'a [f64],
}

impl JointState<'_> {
    /// Writes the message.
    pub fn encode<'e>(&self, encoder: &'e mut CdrEncoder) -> &'e [u8] {
        let (seconds, nanoseconds) = (self.at_ns / 1_000_000_000, self.at_ns % 1_000_000_000);
        encoder.begin().i32(i32::try_from(seconds).unwrap_or(i32::MAX)).u32(nanoseconds as u32).string("");
        encoder.u32(self.names.len() as u32);
        for name in self.names {
            encoder.string(name);
        }
        for values in [self.positions, self.velocities, self.efforts] {
            encoder.u32(values.len() as u32);
            for value in values {
                encoder.f64(*value);
            }
        }
        encoder.bytes()
    }
}

/// A trajectory: `trajectory_msgs/msg/JointTrajectory`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointTrajectory {
    /// When it is to begin, in ns since 1970; 0 for at once.
    pub at_ns: i64,
    /// The names of its joints.
    pub names: Vec<String>,
    /// Its points.
    pub points: Vec<JointPoint>,
}

/// A point of a trajectory: `trajectory_msgs/msg/JointTrajectoryPoint`. Each list has a value for each joint, or none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointPoint {
    /// rad (m)
    pub positions: Vec<f64>,
    /// rad/s (m/s)
    pub velocities: Vec<f64>,
    /// rad/s² (m/s²)
    pub accelerations: Vec<f64>,
    /// N·m (N)
    pub efforts: Vec<f64>,
    /// Seconds after the beginning.
    pub time_s: f64,
}

impl JointTrajectory {
    /// Reads a message; `None` if it is cut short or something else.
    pub fn decode(message: &[u8]) -> Option<Self> {
        let mut fields = CdrDecoder::begin(message)?;
        let at_ns = i64::from(fields.i32()?) * 1_000_000_000 + i64::from(fields.u32()?);
        // The frame, which a trajectory of joints has no use for.
        fields.string()?;
        let names = sequence(&mut fields, CdrDecoder::string)?;
        let points = sequence(&mut fields, |fields| {
            Some(JointPoint {
                positions: sequence(fields, CdrDecoder::f64)?,
                velocities: sequence(fields, CdrDecoder::f64)?,
                accelerations: sequence(fields, CdrDecoder::f64)?,
                efforts: sequence(fields, CdrDecoder::f64)?,
                time_s: f64::from(fields.i32()?) + f64::from(fields.u32()?) / 1e9,
            })
        })?;
        Some(Self { at_ns, names, points })
    }
}

/// The elements of a sequence. Its length is not believed before its elements are there.
fn sequence<'a, T>(
    fields: &mut CdrDecoder<'a>,
    mut element: impl FnMut(&mut CdrDecoder<'a>) -> Option<T>,
) -> Option<Vec<T>> {
    let length = fields.u32()?;
    let mut elements = vec![];
    for _ in 0..length {
        elements.push(element(fields)?);
    }
    Some(elements)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message of two joints of which one point says all, byte by byte as in OMG CDR.
    fn encoded() -> Vec<u8> {
        let mut encoder = CdrEncoder::default();
        encoder.begin().i32(3).u32(500_000_000).string("base").u32(2).string("a").string("joint2").u32(1);
        for values in [&[0.5, -1.0][..], &[0.1, 0.2], &[], &[]] {
            encoder.u32(values.len() as u32);
            for value in values {
                encoder.f64(*value);
            }
        }
        encoder.i32(2).u32(250_000_000);
        encoder.bytes().to_vec()
    }

    #[test]
    fn a_trajectory_is_read_and_one_that_is_cut_short_is_none() {
        let message = encoded();
        let read = JointTrajectory::decode(&message).unwrap();
        let point = JointPoint {
            positions: vec![0.5, -1.0],
            velocities: vec![0.1, 0.2],
            time_s: 2.25,
            ..JointPoint::default()
        };
        let names = vec!["a".to_owned(), "joint2".to_owned()];
        assert_eq!(read, JointTrajectory { at_ns: 3_500_000_000, names, points: vec![point] });
        for length in 0..message.len() {
            assert_eq!(JointTrajectory::decode(&message[..length]), None, "{length} bytes");
        }
    }

    #[test]
    fn a_length_that_nothing_follows_is_no_memory() {
        let mut encoder = CdrEncoder::default();
        encoder.begin().i32(0).u32(0).string("").u32(u32::MAX);
        assert_eq!(JointTrajectory::decode(encoder.bytes()), None);
    }
}
