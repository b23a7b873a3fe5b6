//! Opening a controller: from a file or a text, on its buses or simulated.

use std::ffi::c_char;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use takt::config::{Interface, Urdf};
use takt::{
    Config, Controller, Error, FaultInjector, RecordingDestination, Scenario, SessionOptions,
    VirtualController,
};

use crate::border::{self, Growing};
use crate::errors::{Failure, takt_result};
use crate::handles::{self, Entry, takt_handle};
use crate::scope::{Owner, Scope};

/// Where the drives of a controller are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_drives {
    /// On the interfaces of the configuration; a bus without one is simulated.
    TAKT_CONFIGURED = 0,
    /// All simulated, in real time, whatever interfaces the configuration has.
    TAKT_SIMULATED = 1,
    /// All simulated, in virtual time: time passes only while the program waits, and in takt_advance(), as fast as this machine can. The
    /// same calls give the same run bit for bit.
    TAKT_VIRTUAL = 2,
}

/// How a controller is opened. Set `size` to `sizeof(takt_options)` and the rest to 0 for what is usual.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_options {
    /// `sizeof(takt_options)`
    pub size: u32,
    /// Where the drives are: a takt_drives.
    pub drives: i32,
    /// 1 if it is a failure that the operating system refuses a right to the real-time thread; 0 if takt goes on without it.
    pub is_realtime_required: u8,
    /// 1 to leave the drives disabled: takt_open() returns when each of them reports its position, and takt_enable() enables them. 0 to
    /// enable them.
    pub is_left_disabled: u8,
    /// 0; for later.
    pub reserved: [u8; 6],
    /// The folder for a recording of the run; NULL for what the configuration says. In virtual time it must be NULL, and nothing is
    /// recorded.
    pub recording: *const c_char,
    /// A file of faults to inject, to see what happens then; NULL for none. In virtual time it must be NULL.
    pub faults: *const c_char,
}

impl Default for takt_options {
    fn default() -> Self {
        Self {
            size: size_of::<Self>() as u32,
            drives: 0,
            is_realtime_required: 0,
            is_left_disabled: 0,
            reserved: [0; 6],
            recording: std::ptr::null(),
            faults: std::ptr::null(),
        }
    }
}

// SAFETY: it begins with its size, and has only numbers and pointers.
unsafe impl Growing for takt_options {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Opens a controller by a configuration file: brings its drives up and enables them, and returns when the axes hold their position. With
/// `options->is_left_disabled` it leaves them disabled.
///
/// takt owns the real-time thread from then on. The program may be slow, late or stopped: the axes keep their limits, and a stream that
/// runs dry comes to rest. `options` may be NULL.
///
/// Any thread; blocks until the drives are enabled: up to seconds, as they need. takt_close() ends the run.
///
/// Errors: TAKT_ERROR_CONFIGURATION (the text shows each problem at its line), TAKT_ERROR_START, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL
/// (256 handles are open). Nothing has moved then.
///
/// # Safety
/// The pointers are null, or point to what they should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_open(
    path: *const c_char,
    options: *const takt_options,
    handle: *mut takt_handle,
) -> takt_result {
    border::carry_out(|| {
        // SAFETY: the caller promises it.
        let path = unsafe { border::text(path, "path") }?;
        // SAFETY: the caller promises it.
        unsafe { open(|| Config::load(Path::new(path)).map_err(Error::from), options, handle) }
    })
}

/// As takt_open(), by the text of a configuration. Files that it names are looked for in the working directory.
///
/// # Safety
/// As takt_open().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_open_text(
    configuration: *const c_char,
    options: *const takt_options,
    handle: *mut takt_handle,
) -> takt_result {
    border::carry_out(|| {
        // SAFETY: the caller promises it.
        let text = unsafe { border::text(configuration, "configuration") }?;
        // SAFETY: the caller promises it.
        unsafe { open(|| Config::parse("configuration", text).map_err(Error::from), options, handle) }
    })
}

/// Compares a configuration with the text of a robot description (URDF): an axis that has the name of a joint may do no more than it. The
/// limits of positions, velocities and torques are compared; narrower ones are no contradiction. Nothing is opened.
///
/// Any thread; blocks while it reads the file.
///
/// Errors: TAKT_ERROR_CONFIGURATION, with each contradiction in the text; TAKT_ERROR_ARGUMENT for a NULL.
///
/// # Safety
/// The pointers are null, or point to texts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_check_urdf(path: *const c_char, urdf: *const c_char) -> takt_result {
    border::carry_out(|| {
        // SAFETY: the caller promises it.
        let path = unsafe { border::text(path, "path") }?;
        // SAFETY: the caller promises it.
        let text = unsafe { border::text(urdf, "urdf") }?;
        let config = Config::load(Path::new(path)).map_err(Error::from)?;
        let contradictions = match Urdf::parse(Path::new("the robot description"), text) {
            Ok(urdf) => urdf.contradictions(&config),
            Err(error) => vec![error],
        };
        let words: Vec<String> =
            contradictions.iter().map(|error| format!("{error} ({})", error.help())).collect();
        if words.is_empty() {
            return Ok(());
        }
        Err(Failure::new(takt_result::TAKT_ERROR_CONFIGURATION, words.join("\n")))
    })
}

/// # Safety
/// As takt_open().
unsafe fn open(
    configured: impl FnOnce() -> Result<Config, Error>,
    options: *const takt_options,
    handle: *mut takt_handle,
) -> Result<(), Failure> {
    border::check_pointer(handle, "handle")?;
    // SAFETY: the caller promises it.
    let options: takt_options = unsafe { border::take_growing(options, "options") }?;
    // SAFETY: the caller promises it of what the options point to, as well.
    let recording = unsafe { border::optional_text(options.recording, "options->recording") }?;
    // SAFETY: as before.
    let faults = unsafe { border::optional_text(options.faults, "options->faults") }?;
    let is_virtual = options.drives == takt_drives::TAKT_VIRTUAL as i32;
    let is_simulated = is_virtual || options.drives == takt_drives::TAKT_SIMULATED as i32;
    if !is_simulated && options.drives != takt_drives::TAKT_CONFIGURED as i32 {
        return Err(Failure::argument(format!(
            "options->drives is {}, which is no takt_drives",
            options.drives
        )));
    }
    if is_virtual && (recording.is_some() || faults.is_some()) {
        return Err(Failure::argument("in virtual time nothing is recorded, and no faults are injected"));
    }
    let mut config = configured()?;
    if is_simulated {
        config.buses.iter_mut().for_each(|bus| bus.interface = Interface::Simulated);
    }
    let scenario = faults.map(|path| Scenario::load(Path::new(path), &config)).transpose();
    let scenario = scenario.map_err(Error::from)?;
    let session = SessionOptions {
        recording: recording.map(|folder| RecordingDestination::Directory(PathBuf::from(folder))),
        is_realtime_required: options.is_realtime_required != 0,
        fault_injector: scenario.map(|scenario| Arc::new(FaultInjector::new(scenario))),
        ..SessionOptions::default()
    };
    let owner = match (is_virtual, options.is_left_disabled != 0) {
        (true, false) => VirtualController::start(&config, None).map(Owner::Virtual),
        (true, true) => VirtualController::start_disabled(&config, None).map(Owner::Virtual),
        (false, false) => Controller::start(config, session).map(Owner::Real),
        (false, true) => Controller::start_disabled(config, session).map(Owner::Real),
    };
    let owner = owner.map_err(Error::from)?;
    let own = match &owner {
        Owner::Real(controller) => controller.handle(),
        Owner::Virtual(controller) => controller.handle(),
    };
    let scope = Scope::all(own.clone().into(), Some(own), Some(owner));
    let number = handles::open(Entry::Scope(scope))?;
    // SAFETY: the caller promises it.
    unsafe { border::put(handle, takt_handle { number }, "handle") }
}
