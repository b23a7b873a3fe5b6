//! The message `trajectory_msgs/msg/JointTrajectory` in YAML or JSON, as `ros2 topic echo`, rosbridge and MoveIt write it, alone or within
//! `RobotTrajectory` and the goal of `FollowJointTrajectory`.

use serde::Deserialize;
use serde_saphyr::Spanned;

use super::error::{FileProblem, PlayFileError};
use super::points::{JointColumns, JointPoint, LONGEST_S, PlayFile, PlayRow};

/// The keys that a message can begin with.
const KEYS: [&str; 6] = ["header", "joint_names", "points", "joint_trajectory", "trajectory", "goal"];

/// A message. Keys that are not named here do not count.
#[derive(Deserialize)]
struct Message {
    joint_names: Option<Vec<String>>,
    #[serde(default)]
    points: Vec<Spanned<Point>>,
    joint_trajectory: Option<Box<Message>>,
    trajectory: Option<Box<Message>>,
    goal: Option<Box<Message>>,
}

#[derive(Deserialize)]
struct Point {
    #[serde(default)]
    positions: Vec<f64>,
    #[serde(default)]
    velocities: Vec<f64>,
    #[serde(default)]
    accelerations: Vec<f64>,
    time_from_start: Time,
}

/// A duration: of ROS 2, of ROS 1, or in seconds.
#[derive(Deserialize)]
#[serde(untagged)]
enum Time {
    Seconds(f64),
    Parts {
        #[serde(alias = "secs")]
        sec: f64,
        #[serde(default, alias = "nsec", alias = "nsecs")]
        nanosec: f64,
    },
}

impl Time {
    fn seconds(&self) -> f64 {
        match self {
            Self::Seconds(seconds) => *seconds,
            Self::Parts { sec, nanosec } => sec + nanosec / 1e9,
        }
    }
}

/// Returns `true` if a text is such a message, and not a table.
pub(super) fn is_message(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let Some(first) = lines.find(|line| *line != "---") else { return false };
    let is_key = |key: &&str| first.strip_prefix(*key).is_some_and(|rest| rest.trim_start().starts_with(':'));
    first.starts_with('{') || KEYS.iter().any(|key| is_key(&key))
}

/// Reads a message for axes with these names.
///
/// # Errors
/// The first problem, with its line.
pub(super) fn parse(text: &str, axes: &[String]) -> Result<PlayFile, PlayFileError> {
    // `ros2 topic echo` ends each message so. The first one counts.
    let begin = text.trim_start_matches('\u{feff}');
    let begin = begin.strip_prefix("---\n").unwrap_or(begin);
    let first = begin.split("\n---").next().unwrap_or(begin);
    let message: Message = serde_saphyr::from_str(first).map_err(|error| {
        let location = error.location();
        let line = location.map_or(1, |location| usize::try_from(location.line()).unwrap_or(1));
        let words = error.to_string().lines().next().unwrap_or_default().to_owned();
        PlayFileError { line, column: None, problem: FileProblem::Message { words } }
    })?;
    message.play_file(axes)
}

impl Message {
    /// The trajectory in it.
    fn innermost(&self) -> &Self {
        let inner = self.joint_trajectory.as_ref().or(self.trajectory.as_ref()).or(self.goal.as_ref());
        inner.map_or(self, |inner| inner.innermost())
    }

    fn play_file(&self, axes: &[String]) -> Result<PlayFile, PlayFileError> {
        let Self { joint_names, points, .. } = self.innermost();
        let at = |line: usize, problem| PlayFileError { line, column: None, problem };
        let names = joint_names.as_deref().unwrap_or_default();
        if names.is_empty() {
            return Err(at(1, FileProblem::NoJoint { joints: axes.to_vec() }));
        }
        let mut joints: Vec<JointColumns> = vec![];
        let has = |of: fn(&Point) -> &Vec<f64>| points.iter().any(|point| !of(&point.value).is_empty());
        for name in names {
            let Some(axis) = axes.iter().position(|axis| axis == name) else {
                return Err(at(1, FileProblem::UnknownColumn { name: name.clone(), joints: axes.to_vec() }));
            };
            if joints.iter().any(|joint| joint.axis == axis) {
                return Err(at(1, FileProblem::RepeatedColumn { name: name.clone() }));
            }
            let has_velocity = has(|point| &point.velocities);
            // A trajectory takes accelerations only with velocities.
            let has_acceleration = has_velocity && has(|point| &point.accelerations);
            joints.push(JointColumns { axis, has_velocity, has_acceleration, has_torque: false });
        }
        let rows = points.iter().map(|point| row(point, names)).collect::<Result<Vec<_>, _>>()?;
        match rows.last() {
            Some(_) => Ok(PlayFile { joints, rows, torque_column: None, is_trajectory: true }),
            None => Err(at(1, FileProblem::NoRow)),
        }
    }
}

fn row(point: &Spanned<Point>, names: &[String]) -> Result<PlayRow, PlayFileError> {
    let line = usize::try_from(point.referenced.line()).unwrap_or(1);
    let wrong = |problem| PlayFileError { line, column: None, problem };
    let Point { positions, velocities, accelerations, time_from_start } = &point.value;
    let lists = [
        ("positions", positions, false),
        ("velocities", velocities, true),
        ("accelerations", accelerations, true),
    ];
    for (name, list, may_be_empty) in lists {
        if list.len() != names.len() && !(may_be_empty && list.is_empty()) {
            let words = format!("`{name}` has {} numbers for {} joints", list.len(), names.len());
            return Err(wrong(FileProblem::Message { words }));
        }
        if let Some(number) = list.iter().find(|number| !number.is_finite()) {
            return Err(wrong(FileProblem::NotANumber { name: name.to_owned(), text: number.to_string() }));
        }
    }
    let at_s = time_from_start.seconds();
    if !(0.0..=LONGEST_S).contains(&at_s) {
        return Err(wrong(FileProblem::Time { name: "time_from_start", time_s: at_s }));
    }
    let joint = |joint: usize| JointPoint {
        position: positions.get(joint).copied().unwrap_or(f64::NAN),
        velocity: velocities.get(joint).copied(),
        acceleration: accelerations.get(joint).copied(),
        torque: None,
    };
    Ok(PlayRow { line, arrive_s: at_s, at_s, chunk: None, points: (0..names.len()).map(joint).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Vec<String> {
        ["shoulder", "elbow"].map(str::to_owned).to_vec()
    }

    fn parse(text: &str) -> Result<PlayFile, PlayFileError> {
        assert!(is_message(text));
        super::parse(text, &axes())
    }

    const ECHOED: &str = "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: base_link\njoint_names:\n- elbow\n- shoulder\npoints:\n\
                          - positions:\n  - 0.0\n  - 0.1\n  velocities: []\n  accelerations: []\n  effort: []\n  time_from_start:\n    sec: 0\n    nanosec: 0\n\
                          - positions:\n  - 0.5\n  - 0.2\n  velocities: []\n  accelerations: []\n  effort: []\n  time_from_start:\n    sec: 1\n    nanosec: 500000000\n---\n";

    #[test]
    fn what_ros2_topic_echo_prints_is_read_by_the_names_of_the_joints() {
        let file = parse(ECHOED).unwrap();
        assert!(file.is_trajectory);
        assert_eq!(file.joints.iter().map(|joint| joint.axis).collect::<Vec<_>>(), [1, 0]);
        assert_eq!(file.rows.iter().map(|row| row.at_s).collect::<Vec<_>>(), [0.0, 1.5]);
        assert_eq!((file.rows[1].points[0].position, file.rows[1].points[1].position), (0.5, 0.2));
        assert_eq!(file.rows[1].points[0].velocity, None);
        assert_eq!(parse(&format!("---\n{ECHOED}")).as_ref(), Ok(&file));
    }

    #[test]
    fn json_of_a_goal_or_of_moveit_is_the_same() {
        let message = r#"{"joint_names": ["elbow"], "points": [
            {"positions": [1e-1], "velocities": [0.0], "time_from_start": {"secs": 0, "nsecs": 250000000}},
            {"positions": [0.2], "velocities": [0], "accelerations": [0], "time_from_start": 2.5}]}"#;
        let file = parse(message).unwrap();
        assert_eq!(file.rows.iter().map(|row| row.at_s).collect::<Vec<_>>(), [0.25, 2.5]);
        assert!(file.joints[0].has_velocity && file.joints[0].has_acceleration);
        for outer in ["{\"joint_trajectory\": M}", "{\"goal\": {\"trajectory\": M}}"] {
            assert_eq!(parse(&outer.replace('M', message)).unwrap().rows.len(), 2, "{outer}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (from, to, line, words) in [
            ("- elbow", "- knee", 1, "`knee` is not known"),
            ("  - 0.5\n", "", 19, "`positions` has 1 numbers for 2 joints"),
            ("- 0.5", "- .nan", 19, "not a finite number"),
            ("sec: 1", "sec: -1", 19, "`time_from_start` is -0.5 s"),
            ("- 0.5", "- fast", 20, ""),
        ] {
            let error = parse(&ECHOED.replacen(from, to, 1)).unwrap_err();
            assert!(error.problem.to_string().contains(words), "{to}: {}", error.problem);
            assert_eq!(error.line, line, "{to}: {}", error.problem);
        }
        assert!(
            parse("joint_names: [elbow]\npoints: []\n").unwrap_err().problem.to_string().contains("no row")
        );
    }
}
