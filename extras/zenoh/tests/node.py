"""What a node of ROS 2 says to the bridge: `rosbags` reads and writes the messages, and computes the hashes of their types."""

import numpy
import zenoh
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS = [f"joint{number}" for number in range(1, 7)]


def key(topic, message):
    package, _, name = message.split("/")
    return f"0/{topic}/{package}::msg::dds_::{name}_/{STORE.hash_rihs01(message)}"


STATES = key("joint_states", "sensor_msgs/msg/JointState")
TRAJECTORIES = key("joint_trajectory_controller/joint_trajectory", "trajectory_msgs/msg/JointTrajectory")


def listening(endpoint):
    """What zenoh is told of a session that listens there, and looks for nobody."""
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return config


def trajectory(names, points, stamp=(0, 0)):
    """Points are (time in s, positions) or (time in s, positions, velocities)."""
    types = STORE.types

    def numbers(values):
        return numpy.array(values, dtype="float64")

    def point_of(time_s, positions, velocities=()):
        return types["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=numbers(positions),
            velocities=numbers(velocities),
            accelerations=numbers([]),
            effort=numbers([]),
            time_from_start=types["builtin_interfaces/msg/Duration"](sec=int(time_s), nanosec=int(time_s % 1 * 1e9)),
        )

    header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](*stamp), frame_id="")
    points = [point_of(*point) for point in points]
    message = types["trajectory_msgs/msg/JointTrajectory"](header=header, joint_names=names, points=points)
    return bytes(STORE.serialize_cdr(message, "trajectory_msgs/msg/JointTrajectory"))
