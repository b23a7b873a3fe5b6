//! Drives made from electronic data sheets: every file of `tests/eds/vendors` gives one that boots, moves in each of its
//! modes, faults and is reset; what a file lacks is absent.

mod from_files;
mod motion;
mod services;

use std::path::{Path, PathBuf};

use takt::config::quirks::Quirks;
use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters, counts_per_turn};
use takt::sim::homing_switches::{ReferenceSwitches, Switch};
use takt::sim::plant::{Encoder, JointParameters};
use takt_rt::OperationMode;
use takt_wire::canopen::eds;

use crate::bench::{Bench, MILLISECOND_NS, NODE};

/// The data sheets that are tried: those of the vendors, and the one of the eRob.
pub fn sheets() -> Vec<(String, eds::ObjectDictionary)> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let entries = std::fs::read_dir(folder.join("tests/eds/vendors")).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "eds"));
    paths.push(folder.join("configs/eds/erob-canopen.eds"));
    paths.sort();
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), eds::load(path).unwrap().dictionary)).collect()
}

/// The data sheet with this name.
pub fn sheet(name: &str) -> eds::ObjectDictionary {
    sheets().into_iter().find(|(known, _)| known == name).unwrap().1
}

/// A joint with switches at −3 and 3 rad, a home switch from 0.5 to 1 rad, and an index pulse each turn.
pub fn joint(counts_per_turn: f64) -> Cia402AxisParameters {
    Cia402AxisParameters {
        joint: JointParameters {
            inertia: 0.05,
            viscous_friction: 0.05,
            coulomb_friction: 0.2,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 40.0,
        },
        encoder: Encoder { counts_per_unit: counts_per_turn / std::f64::consts::TAU, zero_counts: 0.0 },
        counts_per_turn,
        initial_position: 0.0,
        rated_torque: 10.0,
        peak_torque: 20.0,
        highest_velocity: 12.0,
        switches: ReferenceSwitches {
            negative_limit: Some(Switch::below(-3.0)),
            positive_limit: Some(Switch::above(3.0)),
            home: Some(Switch { from: 0.5, to: 1.0 }),
            index_distance: Some(std::f64::consts::TAU),
        },
        end_stops: None,
    }
}

/// The parameters of the drive with one joint.
pub fn parameters(sheet: eds::ObjectDictionary, quirks: Quirks) -> Cia402Parameters {
    let counts = counts_per_turn(&sheet, NODE, 0).unwrap_or(65_536.0);
    Cia402Parameters {
        sheet,
        node: NODE,
        quirks,
        axes: vec![joint(counts)],
        power_up_ns: 5 * MILLISECOND_NS,
        feedback_delay_ns: 20_000,
        seed: 7,
    }
}

/// A bus with this drive, and what the test has to know of it.
pub struct Tried {
    pub bench: Bench,
    pub sheet: eds::ObjectDictionary,
    pub counts_per_unit: f64,
}

impl Tried {
    pub fn new(sheet: eds::ObjectDictionary) -> Self {
        Self::with(sheet, Quirks::default())
    }

    pub fn with(sheet: eds::ObjectDictionary, quirks: Quirks) -> Self {
        Self::of(parameters(sheet, quirks))
    }

    pub fn of(parameters: Cia402Parameters) -> Self {
        let sheet = parameters.sheet.clone();
        let counts_per_unit = parameters.axes[0].encoder.counts_per_unit;
        let drive = Cia402Drive::new(parameters).unwrap();
        Self { bench: Bench::of(vec![Box::new(drive)]), sheet, counts_per_unit }
    }

    pub fn has(&self, index: u16) -> bool {
        self.sheet.object(index).is_some()
    }

    /// Writes an object with the length that the data sheet gives it.
    pub fn write(&mut self, index: u16, subindex: u8, value: i64) -> Result<(), u32> {
        let address = takt_wire::canopen::object::ObjectAddress::new(index, subindex);
        let bits = self.sheet.entry(address).unwrap().data_type.unwrap().bits().unwrap();
        self.bench.write(index, subindex, bits / 8, value)
    }

    /// Writes an object if the drive has it.
    pub fn write_if(&mut self, index: u16, subindex: u8, value: i64) {
        if self.has(index) {
            self.write(index, subindex, value).unwrap();
        }
    }

    pub fn set_mode(&mut self, mode: OperationMode) {
        self.write(0x6060, 0, i64::from(mode as i8)).unwrap();
        self.bench.run_ms(2);
        assert_eq!(self.bench.observe().operation_mode, mode as i8, "{mode:?}");
    }

    /// Enables the drive by SDO, with its targets where it stands.
    pub fn enable(&mut self) {
        self.hold_targets();
        for controlword in [0x06, 0x07, 0x0F] {
            self.write(0x6040, 0, controlword).unwrap();
            self.bench.run_ms(5);
        }
        assert_eq!(self.bench.observe().state, takt_rt::DriveState::OperationEnabled);
    }

    /// Sets every target so that nothing moves.
    pub fn hold_targets(&mut self) {
        let position = i64::from(self.bench.observe().position_counts);
        self.write_if(0x607A, 0, position);
        self.write_if(0x60FF, 0, 0);
        self.write_if(0x6071, 0, 0);
    }

    /// Disables the drive and waits until its joint stands.
    pub fn disable(&mut self) {
        self.write(0x6040, 0, 0).unwrap();
        self.bench.run_ms(100);
        assert_eq!(self.bench.observe().state, takt_rt::DriveState::SwitchOnDisabled);
    }

    /// The modes that the drive has, by 6502 or, without it, by its objects.
    pub fn modes(&self) -> Vec<OperationMode> {
        use OperationMode as Mode;
        let address = takt_wire::canopen::object::ObjectAddress::new(0x6502, 0);
        let supported = self.sheet.number(address, Some(NODE)).filter(|modes| *modes != 0);
        let simulated = Mode::ALL.into_iter().filter(|mode| *mode != Mode::Velocity);
        simulated
            .filter(|mode| match supported {
                Some(modes) => modes as u32 & mode.supported_bit() != 0,
                None => match mode {
                    Mode::ProfilePosition => self.has(0x607A) && self.has(0x6081),
                    Mode::ProfileVelocity => self.has(0x60FF) && self.has(0x6083),
                    Mode::ProfileTorque => self.has(0x6071) && self.has(0x6087),
                    Mode::Homing => self.has(0x6098),
                    Mode::InterpolatedPosition => self.has(0x60C1),
                    _ => false,
                },
            })
            .collect()
    }
}
