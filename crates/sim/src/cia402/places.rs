//! Where the profile objects of one axis stand in the dictionary. An object that the data sheet lacks has no place.

/// The distance between the objects of two axes in one node (CiA 402-2, multi-axis devices).
pub const AXIS_OFFSET: u16 = 0x800;

macro_rules! places {
    ($(#[$doc:meta])* $type:ident { $($name:ident = $index:literal : $subindex:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $type {
            $(pub $name: Option<usize>,)*
        }

        impl $type {
            /// The places of the axis with this number, counted from 0.
            pub fn of(dictionary: &$crate::object_dictionary::SimulatedDictionary, axis: u16) -> Self {
                let offset = axis * $crate::cia402::AXIS_OFFSET;
                Self { $($name: dictionary.place($index + offset, $subindex),)* }
            }
        }
    };
}
pub(crate) use places;

places! {
    /// The places of one axis, by the names of CiA 402.
    Places {
        abort_connection_option = 0x6007: 0,
        error_code = 0x603F: 0,
        controlword = 0x6040: 0,
        statusword = 0x6041: 0,
        quick_stop_option = 0x605A: 0,
        shutdown_option = 0x605B: 0,
        disable_option = 0x605C: 0,
        halt_option = 0x605D: 0,
        fault_reaction_option = 0x605E: 0,
        mode = 0x6060: 0,
        mode_display = 0x6061: 0,
        position_demand = 0x6062: 0,
        position_increments = 0x6063: 0,
        position = 0x6064: 0,
        following_error_window = 0x6065: 0,
        following_error_time = 0x6066: 0,
        position_window = 0x6067: 0,
        position_window_time = 0x6068: 0,
        velocity_demand = 0x606B: 0,
        velocity = 0x606C: 0,
        velocity_window = 0x606D: 0,
        velocity_window_time = 0x606E: 0,
        velocity_threshold = 0x606F: 0,
        target_torque = 0x6071: 0,
        max_torque = 0x6072: 0,
        torque_demand = 0x6074: 0,
        rated_current = 0x6075: 0,
        rated_torque = 0x6076: 0,
        torque = 0x6077: 0,
        current = 0x6078: 0,
        target_position = 0x607A: 0,
        home_offset = 0x607C: 0,
        software_limit_low = 0x607D: 1,
        software_limit_high = 0x607D: 2,
        polarity = 0x607E: 0,
        max_profile_velocity = 0x607F: 0,
        max_motor_speed = 0x6080: 0,
        profile_velocity = 0x6081: 0,
        profile_acceleration = 0x6083: 0,
        profile_deceleration = 0x6084: 0,
        quick_stop_deceleration = 0x6085: 0,
        torque_slope = 0x6087: 0,
        encoder_increments = 0x608F: 1,
        encoder_revolutions = 0x608F: 2,
        gear_motor = 0x6091: 1,
        gear_shaft = 0x6091: 2,
        feed = 0x6092: 1,
        feed_shaft = 0x6092: 2,
        velocity_numerator = 0x6096: 1,
        velocity_divisor = 0x6096: 2,
        homing_method = 0x6098: 0,
        homing_speed_switch = 0x6099: 1,
        homing_speed_zero = 0x6099: 2,
        homing_acceleration = 0x609A: 0,
        velocity_unit = 0x60A9: 0,
        position_offset = 0x60B0: 0,
        velocity_offset = 0x60B1: 0,
        torque_offset = 0x60B2: 0,
        interpolation_data = 0x60C1: 1,
        interpolation_period = 0x60C2: 1,
        interpolation_exponent = 0x60C2: 2,
        max_acceleration = 0x60C5: 0,
        max_deceleration = 0x60C6: 0,
        positive_torque_limit = 0x60E0: 0,
        negative_torque_limit = 0x60E1: 0,
        following_error = 0x60F4: 0,
        digital_inputs = 0x60FD: 0,
        target_velocity = 0x60FF: 0,
        supported_modes = 0x6502: 0,
    }
}

/// Returns `true` if an object of any axis is a measured or demanded value, which changes all the time.
pub fn is_measured(index: u16) -> bool {
    match index {
        0x6000..=0x9FFF => matches!(
            0x6000 + (index - 0x6000) % AXIS_OFFSET,
            0x6062..=0x6064 | 0x6069 | 0x606B | 0x606C | 0x6074 | 0x6077..=0x6079 | 0x60F4 | 0x60FA | 0x60FC
        ),
        _ => true,
    }
}
