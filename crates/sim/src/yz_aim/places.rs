//! Where the objects stand in the dictionary that the drive itself uses.

crate::cia402::places::places! {
    /// The places.
    Places {
        error_register = 0x1001: 0,
        modbus_enable = 0x2600: 0,
        output_enable = 0x2601: 0,
        gear_numerator = 0x260A: 0,
        gear_denominator = 0x260B: 0,
        alarm_code = 0x260E: 0,
        output = 0x2613: 0,
        save_flag = 0x2614: 0,
        node_address = 0x2615: 0,
        standstill_output = 0x2618: 0,
        special_function = 0x2619: 0,
        maximum_current = 0x261D: 0,
        battery_level = 0x261E: 0,
        controlword = 0x6040: 0,
        statusword = 0x6041: 0,
        operation_mode = 0x6060: 0,
        position_internal = 0x6063: 0,
        position = 0x6064: 0,
        velocity = 0x606C: 0,
        current = 0x6078: 0,
        voltage = 0x6079: 0,
        target_position = 0x607A: 0,
        profile_velocity = 0x6081: 0,
        acceleration = 0x6083: 0,
        homing_method = 0x6098: 0,
        inputs = 0x60FD: 0,
        target_velocity = 0x60FF: 0,
    }
}
