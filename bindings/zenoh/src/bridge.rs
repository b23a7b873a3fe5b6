//! The session in zenoh, and the controller of another process.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use takt::rt::linux::MonotonicClock;
use takt::rt::{Clock, StopCategory};
use takt::telemetry::CdrEncoder;
use takt::{Client, CommandError, ConnectError, Snapshot, WaitError};
use thiserror::Error;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::{Session, Wait};

use crate::attachment::attachment;
use crate::inbox::{Inbox, Taken};
use crate::messages::{JointState, JointTrajectory};
use crate::motion::{AxisPlace, Unfit, Wanted, wanted};
use crate::names::{Gid, JOINT_STATE, JOINT_TRAJECTORY, Kind, Node, gid, is_topic};

/// How often the end is looked for.
const LOOK: Duration = Duration::from_millis(100);

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
    /// Whether the other computers have ROS 2 Humble, which has no hashes of types.
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
    inbox: Arc<Inbox>,
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
        let controller = takt::connect(&options.controller)?;
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
        let inbox = Arc::new(Inbox::default());
        let subscriber = options.trajectories.as_ref().map(|topic| {
            let (receiving, stopping) = (Arc::clone(&inbox), controller.clone());
            subscribe(&session, node.topic(topic, &JOINT_TRAJECTORY), receiving, stopping, lost)
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
        let mut later: Vec<Later> = vec![];
        while !is_over() {
            let next = later.iter().map(|later| later.due.saturating_duration_since(Instant::now())).min();
            let taken = self.inbox.take(next.map_or(LOOK, |next| next.min(LOOK)));
            if let Some(Taken { message, stops }) = taken {
                match JointTrajectory::decode(&message) {
                    Some(trajectory) => self.receive(trajectory, stops, &mut later, tell),
                    None => tell(&format!("a trajectory was refused: {}", Unfit::NotCdr)),
                }
            }
            // Whatever waits at the time of a stop is discarded.
            later.retain(|later| later.stops == self.inbox.stops());
            let now = Instant::now();
            for Later { trajectory, stops, .. } in later.extract_if(.., |later| later.due <= now) {
                self.carry_out_now(&trajectory, stops, tell);
            }
        }
    }

    /// Begins a trajectory, or lets it wait for its time. It takes the place of those of its group that wait.
    fn receive(&self, trajectory: JointTrajectory, stops: u64, later: &mut Vec<Later>, tell: &impl Fn(&str)) {
        if let Ok(Wanted::Execute { group, delay, .. }) = self.wanted(&trajectory) {
            later.retain(|later| later.group != group);
            if !delay.is_zero() {
                tell(&format!("a trajectory begins in {:.3} s", delay.as_secs_f64()));
                let due = Instant::now() + delay;
                later.push(Later {
                    due,
                    group,
                    stops,
                    trajectory: JointTrajectory { at_ns: 0, ..trajectory },
                });
                return;
            }
        }
        self.carry_out_now(&trajectory, stops, tell);
    }

    fn carry_out_now(&self, trajectory: &JointTrajectory, stops: u64, tell: &impl Fn(&str)) {
        match self.wanted(trajectory) {
            Err(reason) => tell(&format!("a trajectory was refused: {reason}")),
            Ok(wanted) => match self.begin(&wanted) {
                Err(reason) => {
                    let reason = reason.naming(&self.axes_of(&wanted));
                    tell(&format!("a trajectory was refused: {reason}"));
                }
                Ok(()) => tell(&words_of(&wanted)),
            },
        }
        // A stop that has come meanwhile may have overtaken what has just begun.
        if self.inbox.stops() != stops {
            let _ = self.controller.stop(StopCategory::Two);
        }
    }

    fn wanted(&self, trajectory: &JointTrajectory) -> Result<Wanted, Unfit> {
        let groups = &self.controller.machine().groups;
        wanted(trajectory, &self.axes, groups, &self.controller.state(), time_of_day_ns())
    }

    /// The names of the axes that it is for.
    fn axes_of(&self, wanted: &Wanted) -> Vec<&str> {
        let is_for = |axis: &&AxisPlace| match wanted {
            Wanted::Stop => true,
            Wanted::Execute { group, .. } => axis.group == *group,
        };
        self.axes.iter().filter(is_for).map(|axis| axis.name.as_str()).collect()
    }

    fn begin(&self, wanted: &Wanted) -> Result<(), CommandError> {
        match wanted {
            Wanted::Stop => self.controller.stop(StopCategory::Two),
            Wanted::Execute { group, points, .. } => match self.controller.machine().groups.get(*group) {
                Some(group) => self.controller.group(group)?.execute(points).map(drop),
                None => self.controller.execute(points).map(drop),
            },
        }
    }
}

/// Receives trajectories from now on.
fn subscribe(
    session: &Session,
    topic: String,
    receiving: Arc<Inbox>,
    stopping: Client,
    lost: impl Fn() + Send + Sync + 'static,
) -> Result<Subscriber<()>, BridgeError> {
    session
        .declare_subscriber(topic)
        .callback(move |sample| {
            let message = sample.payload().to_bytes().into_owned();
            if JointTrajectory::decode(&message).is_some_and(|trajectory| trajectory.points.is_empty()) {
                receiving.put_stop(message);
                // It waits for nobody. The thread that carries commands out stops once more, and says why it cannot.
                let _ = stopping.stop(StopCategory::Two);
            } else if !receiving.put(message) {
                lost();
            }
        })
        .wait()
        .map_err(refused("the topic of the trajectories"))
}

/// A trajectory that waits for its time.
struct Later {
    due: Instant,
    group: usize,
    /// The stops that had come before it.
    stops: u64,
    trajectory: JointTrajectory,
}

fn words_of(wanted: &Wanted) -> String {
    match wanted {
        Wanted::Stop => "a trajectory without points: the axes come to rest and hold".to_owned(),
        Wanted::Execute { points, .. } => {
            let seconds = points.last().map_or(0.0, |point| point.time_s);
            format!("a trajectory of {} points has begun, {seconds:.3} s", points.len())
        }
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

/// The time of day in ns since 1970.
fn time_of_day_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The time of day of a moment on the clock of the controller, which is that of this computer.
fn day_ns_of(monotonic_ns: u64) -> u64 {
    let age_ns = MonotonicClock::default().now_ns().saturating_sub(monotonic_ns);
    u64::try_from(time_of_day_ns()).unwrap_or_default().saturating_sub(age_ns)
}
