"""The bridge as a node of ROS 2 sees it. `rosbags` reads and writes the messages, and computes the hashes of their types: it shares nothing
with takt."""

import os
import queue
import re
import shlex
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest
import xxhash
import zenoh
from node import JOINTS, STATES, STORE, TRAJECTORIES, key, listening, trajectory
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[3]
TAKT = os.environ["TAKT"]
TAKT_ZENOH = os.environ["TAKT_ZENOH"]
PATIENCE = 60.0


class Lines:
    """What a program says on standard error."""

    def __init__(self, path, process):
        self.path, self.process = path, process

    def wait_for(self, words):
        until = time.monotonic() + PATIENCE
        while words not in self.path.read_text():
            assert self.process.poll() is None, self.path.read_text()
            assert time.monotonic() < until, f"{words!r} is not in: {self.path.read_text()}"
            time.sleep(0.02)


def start(arguments, said):
    with said.open("w") as error:
        process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=error, cwd=said.parent)
    return Lines(said, process)


def end(program):
    program.process.send_signal(signal.SIGINT)
    try:
        program.process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        program.process.kill()


@pytest.fixture(scope="module")
def peer():
    """A session on the loopback interface, and its endpoint."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with zenoh.open(listening(endpoint)) as session:
        yield session, endpoint


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    served = start([TAKT, "run", ROOT / "configs/arm6-erob.toml", "--serve", folder / "arm"], folder / "takt.txt")
    served.wait_for("served by the name")
    yield folder / "arm"
    end(served)


@pytest.fixture(scope="module")
def bridge(arm, peer, tmp_path_factory):
    _, endpoint = peer
    said = tmp_path_factory.mktemp("bridge") / "said.txt"
    listen = "tcp/127.0.0.1:0"
    words = [TAKT_ZENOH, arm, "--connect", endpoint, "--listen", listen, "--domain", "0", "--command"]
    program = start(words, said)
    program.wait_for("publishes /joint_states")
    yield program
    end(program)


@pytest.fixture
def states(peer, bridge):
    received = queue.Queue()
    subscriber = peer[0].declare_subscriber(STATES, received.put)
    yield received
    subscriber.undeclare()


def state(received):
    """The next message, and its sample; those that have waited are left out."""
    for _ in range(received.qsize()):
        received.get()
    sample = received.get(timeout=PATIENCE)
    return STORE.deserialize_cdr(sample.payload.to_bytes(), "sensor_msgs/msg/JointState"), sample


def wait_until(received, is_so):
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        message, _ = state(received)
        if is_so(message):
            return message
    raise AssertionError(f"it never came: {message}")


def test_joint_states_are_messages_of_ros_with_their_time_and_their_sender(states):
    before = time.time_ns()
    first, sample = state(states)
    assert list(first.name) == JOINTS
    assert len(first.position) == len(first.velocity) == 6 and len(first.effort) in (0, 6)
    stamp_ns = first.header.stamp.sec * 10**9 + first.header.stamp.nanosec
    assert abs(stamp_ns - before) < 5e9
    number, sent_ns, gid = zenoh.ext.z_deserialize(tuple[zenoh.ext.Int64, zenoh.ext.Int64, bytes], sample.attachment)
    assert abs(int(sent_ns) - before) < 5e9 and len(gid) == 16
    _, sample = state(states)
    later, _, same = zenoh.ext.z_deserialize(tuple[zenoh.ext.Int64, zenoh.ext.Int64, bytes], sample.attachment)
    assert int(later) > int(number) and same == gid


def test_the_graph_has_the_node_its_publisher_and_its_subscription(peer, states):
    _, sample = state(states)
    _, _, gid = zenoh.ext.z_deserialize(tuple[zenoh.ext.Int64, zenoh.ext.Int64, bytes], sample.attachment)
    replies = peer[0].liveliness().get("@ros2_lv/0/**", timeout=10.0)
    tokens = sorted(str(reply.ok.key_expr) for reply in replies)
    session = tokens[0].split("/")[2]
    assert re.fullmatch("[0-9a-f]{1,32}", session)
    of = f"@ros2_lv/0/{session}/0"
    qos = "1:2:1,10:,:,:,,"
    states_of, trajectories_of = STATES.split("/", 2), TRAJECTORIES.split("/", 3)
    publisher = f"{of}/1/MP/%/%/takt/%joint_states/{states_of[2]}/{qos}"
    subscription = f"{of}/2/MS/%/%/takt/%joint_trajectory_controller%joint_trajectory/{trajectories_of[3]}/{qos}"
    assert tokens == sorted([f"{of}/0/NN/%/%/takt", publisher, subscription])
    # What `ros2 topic info --verbose` shows is the identifier in the messages.
    digest = xxhash.xxh3_128(publisher.encode()).digest()
    assert gid == digest[8:][::-1] + digest[:8][::-1]


def test_a_trajectory_moves_the_arm_there(peer, bridge, states):
    home, _ = state(states)
    target = [position + 0.06 for position in home.position]
    there = trajectory(JOINTS, [(1.0, [position + 0.03 for position in home.position]), (2.0, target)])
    peer[0].put(TRAJECTORIES, there)
    bridge.wait_for("a trajectory of 2 points has begun")
    arrived = wait_until(states, lambda now: all(abs(now.position[axis] - target[axis]) < 0.005 for axis in range(6)))
    # Joints in another order, with velocities, and not all of them: the others stay.
    back = trajectory(["joint3", "joint1"], [(1.5, [home.position[2], home.position[0]], [0.0, 0.0])])
    peer[0].put(TRAJECTORIES, back)
    wait_until(states, lambda now: all(abs(now.position[axis] - home.position[axis]) < 0.005 for axis in (0, 2)))
    now, _ = state(states)
    assert all(abs(now.position[axis] - arrived.position[axis]) < 0.005 for axis in (1, 3, 4, 5))


def test_what_is_not_possible_is_refused_and_nothing_moves(peer, bridge, states):
    home, _ = state(states)
    refused = [
        (b"\x00\x01\x00\x00rubbish", "no trajectory_msgs/msg/JointTrajectory in CDR"),
        (trajectory(["elbow"], [(1.0, [0.0])]), 'there is no axis "elbow"'),
        (trajectory(["joint1"], [(1.0, [99.0])]), "point 0, joint1: position 99"),
        (trajectory(["joint1"], [(1.0, [0.0])], stamp=(1, 0)), "Synchronize both clocks"),
    ]
    for message, words in refused:
        before = bridge.path.read_text().count("a trajectory was refused")
        peer[0].put(TRAJECTORIES, message)
        until = time.monotonic() + PATIENCE
        while bridge.path.read_text().count("a trajectory was refused") == before:
            assert time.monotonic() < until, bridge.path.read_text()
            time.sleep(0.02)
        last = [line for line in bridge.path.read_text().splitlines() if "a trajectory was refused" in line][-1]
        assert words in last
    now, _ = state(states)
    assert all(abs(now.position[axis] - home.position[axis]) < 0.005 for axis in range(6))


def test_a_trajectory_without_points_stops_the_arm(peer, bridge, states):
    home, _ = state(states)
    far = home.position[0] - 1.0
    peer[0].put(TRAJECTORIES, trajectory(["joint1"], [(10.0, [far])]))
    moving = wait_until(states, lambda now: now.position[0] < home.position[0] - 0.05)
    peer[0].put(TRAJECTORIES, trajectory([], []))
    bridge.wait_for("come to rest")
    still = wait_until(states, lambda now: abs(now.velocity[0]) < 1e-3)
    assert far + 0.2 < still.position[0] <= moving.position[0] + 0.01


def test_the_tokens_go_with_the_bridge(arm, peer, bridge):
    listener, gone = queue.Queue(), []
    subscriber = peer[0].liveliness().declare_subscriber("@ros2_lv/0/**", listener.put)
    end(bridge)
    while len(gone) < 3:
        sample = listener.get(timeout=PATIENCE)
        if sample.kind == zenoh.SampleKind.DELETE:
            gone.append(sample)
    subscriber.undeclare()


def test_the_commands_of_the_page_move_the_arm(peer, tmp_path):
    session, endpoint = peer
    page = (ROOT / "extras/zenoh/README.md").read_text()
    robot, other = (rest.split("```")[0].replace("\\\n", " ") for rest in page.split("```sh\n")[1:])
    here = {"arm": tmp_path / "arm", "tcp/ROUTER:7447": endpoint}

    def program(line):
        words = [here.get(word, ROOT / word if word.startswith("configs/") else word) for word in shlex.split(line, comments=True)]
        return [{"takt": TAKT, "takt-zenoh": TAKT_ZENOH}[Path(words[0]).name], *words[1:]]

    run, connect = (program(line) for line in robot.splitlines() if line.startswith("target/release/"))
    echo, publish = (shlex.split(line) for line in other.splitlines() if line.startswith("ros2 topic"))
    received = queue.Queue()
    subscriber = session.declare_subscriber(key(echo[3].strip("/"), "sensor_msgs/msg/JointState"), received.put)
    served = start(run, tmp_path / "takt.txt")
    served.wait_for("served by the name")
    bridge = start(connect, tmp_path / "bridge.txt")
    bridge.wait_for("publishes /joint_states")
    assert publish[:4] == ["ros2", "topic", "pub", "--once"] and publish[5] == "trajectory_msgs/msg/JointTrajectory"
    wanted = YAML(typ="safe").load(publish[6])
    [point] = wanted["points"]
    message = trajectory(wanted["joint_names"], [(point["time_from_start"]["sec"], point["positions"])])
    home, _ = state(received)
    assert abs(home.position[0] - 0.3) > 0.1
    session.put(key(publish[4].strip("/"), publish[5]), message)
    wait_until(received, lambda now: abs(now.position[0] - 0.3) < 0.005)
    subscriber.undeclare()
    end(bridge)
    end(served)


def test_without_command_it_only_publishes(peer, tmp_path):
    served = start([TAKT, "run", ROOT / "configs/arm6-erob.toml", "--serve", tmp_path / "arm"], tmp_path / "takt.txt")
    served.wait_for("served by the name")
    words = [TAKT_ZENOH, tmp_path / "arm", "--connect", peer[1], "--listen", "tcp/127.0.0.1:0", "--domain", "7"]
    bridge = start(words, tmp_path / "bridge.txt")
    bridge.wait_for("takes no commands")
    replies = peer[0].liveliness().get("@ros2_lv/7/**", timeout=10.0)
    assert sorted(str(reply.ok.key_expr).split("/")[5] for reply in replies) == ["MP", "NN"]
    end(bridge)
    end(served)
