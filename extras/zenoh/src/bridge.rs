//! The session in zenoh, and the controller of another process.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use takt::rt::StopCategory;
use takt::telemetry::CdrEncoder;
use takt::{Snapshot, WaitError};
use takt_remote::{Client, ConnectError};
use thiserror::Error;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::{Session, Wait};

use crate::arrival::{Arrival, Stops};
use crate::attachment::attachment;
use crate::carrier::{Carrier, LOOK, Message};
use crate::clock::{day_ns_of, time_of_day_ns};
use crate::inbox::Inbox;
use crate::messages::{JointState, JointTrajectory};
use crate::motion::AxisPlace;
use crate::names::{Gid, JOINT_STATE, JOINT_TRAJECTORY, Kind, Node, gid, is_topic};

/// Where the controller is, and what it is in the graph.
#[derive(Clone, Debug)]
pub struct Options {
    /// The name by which the controller is served.
    pub controller: String,
    /// `ROS_DOMAIN_ID`
    pub domain: u32,
    /// The name of the node.
    pub node: String,
    /// The topic of the joint states, from the root.
    pub states: String,
    /// The topic of the joint trajectories, from the root. `None`: nobody commands the axes by it.
    pub trajectories: Option<String>,
    /// Joint states a second, at most one a cycle.
    pub rate_hz: f64,
    /// The endpoints that are connected to: `tcp/localhost:7447` is the router of rmw_zenoh.
    pub connect: Vec<String>,
    /// The endpoints that are listened at.
    pub listen: Vec<String>,
    /// True if the other computers have ROS 2 Humble, which has no hashes of types.
    pub is_humble: bool,
}

/// Why there is no bridge, or no longer.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BridgeError {
    /// The controller cannot be reached.
    #[error(transparent)]
    Controller(#[from] ConnectError),
    /// The process of the controller has ended.
    #[error("the controller {name:?} has ended")]
    Ended {
        /// The name by which it was served.
        name: String,
    },
    /// A name that ROS 2 does not have.
    #[error(
        "{given:?} is no topic: write it from the root, in letters, digits and _, as in /arm/joint_states"
    )]
    Topic {
        /// The name.
        given: String,
    },
    /// A rate that cannot be.
    #[error("the rate is {given} Hz; it is from 0.1 to 1000 Hz")]
    Rate {
        /// The rate.
        given: f64,
    },
    /// zenoh has refused something.
    #[error("zenoh: {what}: {reason}")]
    Zenoh {
        /// What it has refused.
        what: &'static str,
        /// What it said.
        reason: String,
    },
}

fn refused<E: ToString>(what: &'static str) -> impl Fn(E) -> BridgeError {
    move |reason| BridgeError::Zenoh { what, reason: reason.to_string() }
}

/// A controller in the graph of ROS 2, until it is dropped.
pub struct Bridge {
    controller: Client,
    options: Options,
    axes: Vec<AxisPlace>,
    publisher: Publisher<'static>,
    gid: Gid,
    inbox: Arc<Inbox<Message>>,
    stops: Mutex<Stops>,
    // In the graph for as long as they are here. The session closes after what it has declared.
    _subscriber: Option<Subscriber<()>>,
    _tokens: Vec<LivelinessToken>,
    _session: Session,
}

impl Bridge {
    /// Connects to the controller and to the graph. If trajectories are taken, one without points stops the axes at once from now on, and
    /// those with points wait for [`Bridge::run`]. `lost` is called for each one that is lost because too many wait.
    ///
    /// # Errors
    /// See [`BridgeError`].
    pub fn open(options: Options, lost: impl Fn() + Send + Sync + 'static) -> Result<Self, BridgeError> {
        for topic in [&options.states].into_iter().chain(&options.trajectories) {
            if !is_topic(topic) {
                return Err(BridgeError::Topic { given: topic.clone() });
            }
        }
        if !(0.1..=1000.0).contains(&options.rate_hz) {
            return Err(BridgeError::Rate { given: options.rate_hz });
        }
        let controller = takt_remote::connect(&options.controller)?;
        let described = &controller.machine().axes;
        let axes =
            described.iter().map(|axis| AxisPlace { name: axis.name.clone(), group: axis.group }).collect();
        let session = session(&options)?;
        let node = Node {
            domain: options.domain,
            session: session.zid().to_string(),
            namespace: "/".to_owned(),
            name: options.node.clone(),
            is_humble: options.is_humble,
        };
        let states = node.endpoint(1, Kind::Publisher, &options.states, &JOINT_STATE);
        let gid = gid(&states);
        let publisher = session
            .declare_publisher(node.topic(&options.states, &JOINT_STATE))
            .wait()
            .map_err(refused("the topic of the joint states"))?;
        // Before a trajectory can come.
        let stops = Mutex::new(Stops::new(&controller));
        let inbox = Arc::new(Inbox::default());
        let subscriber = options.trajectories.as_ref().map(|topic| {
            let (receiving, controller) = (Arc::clone(&inbox), controller.clone());
            subscribe(&session, node.topic(topic, &JOINT_TRAJECTORY), receiving, controller, lost)
        });
        let subscriber = subscriber.transpose()?;
        let token = |key: String| {
            session.liveliness().declare_token(key).wait().map_err(refused("a liveliness token"))
        };
        let trajectories = options.trajectories.as_ref();
        let trajectories =
            trajectories.map(|topic| node.endpoint(2, Kind::Subscription, topic, &JOINT_TRAJECTORY));
        let tokens = [node.token(), states].into_iter().chain(trajectories);
        let tokens = tokens.map(token).collect::<Result<_, _>>()?;
        Ok(Self {
            controller,
            options,
            axes,
            publisher,
            gid,
            inbox,
            stops,
            _subscriber: subscriber,
            _tokens: tokens,
            _session: session,
        })
    }

    /// Publishes joint states and carries trajectories out until `is_over`. `tell` is called with what people want to know: which trajectory
    /// was begun, and why one was refused.
    ///
    /// # Errors
    /// [`BridgeError::Ended`], and [`BridgeError::Zenoh`] when nothing can be published.
    pub fn run(
        &self,
        is_over: impl Fn() -> bool + Sync,
        tell: impl Fn(&str) + Sync,
    ) -> Result<(), BridgeError> {
        let is_either_over = || is_over() || self.controller.has_ended();
        thread::scope(|scope| {
            // Its own thread, since the states go on while a command waits for its answer.
            scope.spawn(|| self.carry_out(&is_either_over, &tell));
            self.publish(&is_over)
        })
    }

    fn publish(&self, is_over: &impl Fn() -> bool) -> Result<(), BridgeError> {
        let cycle_s = self.controller.machine().cycle_ns as f64 / 1e9;
        let cycles = (1.0 / self.options.rate_hz / cycle_s).round().max(1.0) as u64;
        let names: Vec<String> = self.axes.iter().map(|axis| axis.name.clone()).collect();
        let (mut encoder, mut number, mut slot) = (CdrEncoder::default(), 0, self.controller.state().slot);
        while !is_over() {
            let state = match self.controller.cycle_after(slot + cycles - 1, LOOK) {
                Ok(state) => state,
                Err(WaitError::NotInTime) => continue,
                Err(_) => return Err(BridgeError::Ended { name: self.options.controller.clone() }),
            };
            slot = state.slot;
            if !state.axes().iter().all(|axis| axis.is_heard) {
                continue;
            }
            number += 1;
            let message = encode(&mut encoder, &names, &state);
            let attached = attachment(number, time_of_day_ns(), self.gid);
            let sent = self.publisher.put(message).attachment(attached).wait();
            sent.map_err(refused("a joint state"))?;
        }
        Ok(())
    }

    fn carry_out(&self, is_over: &impl Fn() -> bool, tell: &impl Fn(&str)) {
        // A panic of another holder of the lock leaves the stops as they are.
        let mut stops = self.stops.lock().unwrap_or_else(PoisonError::into_inner);
        Carrier::new(&self.controller, &self.axes, &self.inbox, &mut stops, tell).run(is_over);
    }
}

/// Receives trajectories from now on.
fn subscribe(
    session: &Session,
    topic: String,
    receiving: Arc<Inbox<Message>>,
    controller: Client,
    lost: impl Fn() + Send + Sync + 'static,
) -> Result<Subscriber<()>, BridgeError> {
    session
        .declare_subscriber(topic)
        .callback(move |sample| {
            let message = match JointTrajectory::decode(&sample.payload().to_bytes()) {
                Some(trajectory) if trajectory.points.is_empty() => {
                    receiving.stop();
                    return stop_at_once(&controller, &receiving);
                }
                Some(trajectory) => Message::Trajectory(trajectory, Arrival::now(&controller)),
                None => Message::Unreadable,
            };
            if !receiving.put(message) {
                lost();
            }
        })
        .wait()
        .map_err(refused("the topic of the trajectories"))
}

/// Stops the axes. It waits for no message before it, and until the stop shows: it discards none that comes after it.
fn stop_at_once(controller: &Client, receiving: &Inbox<Message>) {
    let newest = || controller.newest_stop();
    let before = newest();
    let is_sent = controller.stop(StopCategory::Two).is_ok();
    // The thread that carries messages out tries again, and says why it cannot.
    let _ = receiving.put(Message::Stop { is_sent });
    if is_sent {
        let taken_in = |state: &Snapshot| (newest() != before).then_some(state.slot);
        let slot = controller.wait_until(LOOK, taken_in);
        let _ = slot.and_then(|slot| controller.cycle_after(slot, LOOK));
    }
}

/// A peer of the endpoints, without scouting by multicast.
fn session(options: &Options) -> Result<Session, BridgeError> {
    let mut config = zenoh::Config::default();
    let mut set = |key, value: &str| config.insert_json5(key, value).map_err(refused(key));
    set("mode", "\"peer\"")?;
    set("scouting/multicast/enabled", "false")?;
    set("connect/endpoints", &format!("{:?}", options.connect))?;
    set("listen/endpoints", &format!("{:?}", options.listen))?;
    zenoh::open(config).wait().map_err(refused("a session"))
}

fn encode<'e>(encoder: &'e mut CdrEncoder, names: &[String], state: &Snapshot) -> &'e [u8] {
    let axes = state.axes();
    let efforts: Option<Vec<f64>> = axes.iter().map(|axis| axis.torque).collect();
    let message = JointState {
        at_ns: day_ns_of(state.at_ns),
        names,
        positions: &axes.iter().map(|axis| axis.position).collect::<Vec<_>>(),
        velocities: &axes.iter().map(|axis| axis.velocity).collect::<Vec<_>>(),
        efforts: &efforts.unwrap_or_default(),
    };
    message.encode(encoder)
}

#[cfg(test)]
mod tests;
