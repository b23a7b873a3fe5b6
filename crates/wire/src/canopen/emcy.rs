//! Emergency messages (CiA 301, 7.2.7), and the names of error codes (CiA 301, table 26; CiA 402, object 603F).

use std::fmt;

use takt_rt::{Frame, Id};

use super::{function_code, node_of};

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// The sender's node ID, 1 to 127.
    pub node: u8,
    /// The error code; a code 00xx means that the error has been reset.
    pub code: ErrorCode,
    /// Object 1001 of the sender.
    pub register: ErrorRegister,
    /// Five manufacturer-specific bytes.
    pub manufacturer: [u8; 5],
}

impl Emergency {
    /// Decodes a message with the pre-defined identifier 0x80 + node ID; `None` for other frames.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = node_of(frame, function_code::EMERGENCY)?;
        let &[low, high, register, a, b, c, d, e] = frame.payload() else { return None };
        Some(Self {
            node,
            code: ErrorCode(u16::from_le_bytes([low, high])),
            register: ErrorRegister(register),
            manufacturer: [a, b, c, d, e],
        })
    }

    /// The message as a frame.
    pub fn frame(self) -> Frame {
        let [low, high] = self.code.0.to_le_bytes();
        let [a, b, c, d, e] = self.manufacturer;
        let id = Id::canopen(function_code::EMERGENCY, self.node);
        Frame::of(id, [low, high, self.register.0, a, b, c, d, e])
    }
}

impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, error register: {}", self.code, self.register)?;
        if self.manufacturer != [0; 5] {
            write!(f, ", manufacturer's bytes {:02X?}", self.manufacturer)?;
        }
        Ok(())
    }
}

/// The error register, object 1001 (CiA 301, 7.5.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorRegister(pub u8);

impl ErrorRegister {
    /// Generic error.
    pub const GENERIC: u8 = 0x01;
    /// Current.
    pub const CURRENT: u8 = 0x02;
    /// Voltage.
    pub const VOLTAGE: u8 = 0x04;
    /// Temperature.
    pub const TEMPERATURE: u8 = 0x08;
    /// Communication.
    pub const COMMUNICATION: u8 = 0x10;
    /// Specific to the device profile.
    pub const DEVICE_PROFILE: u8 = 0x20;
    /// Specific to the manufacturer.
    pub const MANUFACTURER: u8 = 0x80;

    const NAMES: [(u8, &'static str); 7] = [
        (Self::GENERIC, "generic"),
        (Self::CURRENT, "current"),
        (Self::VOLTAGE, "voltage"),
        (Self::TEMPERATURE, "temperature"),
        (Self::COMMUNICATION, "communication"),
        (Self::DEVICE_PROFILE, "device profile"),
        (Self::MANUFACTURER, "manufacturer"),
    ];
}

impl fmt::Display for ErrorRegister {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> =
            Self::NAMES.iter().filter(|(bit, _)| self.0 & bit != 0).map(|(_, name)| *name).collect();
        if names.is_empty() { f.write_str("no error") } else { f.write_str(&names.join(" + ")) }
    }
}

/// An error code of emergency messages and object 603F.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ErrorCode(pub u16);

impl ErrorCode {
    /// No error, or the error has been reset.
    pub const NONE: Self = Self(0);

    /// The name of the code; for codes that the standards do not list, the name of its class.
    pub fn words(self) -> &'static str {
        self.bilingual().0
    }

    /// The name of the code in English and in Chinese.
    pub fn bilingual(self) -> (&'static str, &'static str) {
        let exact = SPECIFIC.iter().find(|(code, ..)| *code == self.0).map(|(_, en, zh)| (*en, *zh));
        let class = || CLASSES.iter().find(|(mask, code, ..)| self.0 & mask == *code);
        exact.or_else(|| class().map(|(_, _, en, zh)| (*en, *zh))).unwrap_or(("unknown error", "未知错误"))
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.0, self.words())
    }
}

/// Codes with their own name, in English and in Chinese.
const SPECIFIC: [(u16, &str, &str); 92] = [
    (0x0000, "no error", "无错误"),
    (0x2110, "short circuit or earth leakage at the input", "输入侧短路或对地漏电"),
    (0x2120, "earth leakage at the input", "输入侧对地漏电"),
    (0x2121, "earth leakage, phase L1", "L1 相对地漏电"),
    (0x2122, "earth leakage, phase L2", "L2 相对地漏电"),
    (0x2123, "earth leakage, phase L3", "L3 相对地漏电"),
    (0x2130, "short circuit at the input", "输入侧短路"),
    (0x2211, "internal current no. 1", "内部电流 1"),
    (0x2212, "internal current no. 2", "内部电流 2"),
    (0x2213, "over-current in the ramp function", "斜坡功能过流"),
    (0x2214, "over-current in the sequence", "运行序列过流"),
    (0x2220, "continuous over-current inside the device", "设备内部持续过流"),
    (0x2230, "short circuit or earth leakage inside the device", "设备内部短路或对地漏电"),
    (0x2240, "earth leakage inside the device", "设备内部对地漏电"),
    (0x2250, "short circuit inside the device", "设备内部短路"),
    (0x2310, "continuous over-current at the motor", "电机持续过流"),
    (0x2311, "current at the motor no. 1", "电机电流 1"),
    (0x2312, "current at the motor no. 2", "电机电流 2"),
    (0x2320, "short circuit or earth leakage at the motor", "电机侧短路或对地漏电"),
    (0x2330, "earth leakage at the motor", "电机侧对地漏电"),
    (0x2331, "earth leakage at the motor, phase U", "电机 U 相对地漏电"),
    (0x2332, "earth leakage at the motor, phase V", "电机 V 相对地漏电"),
    (0x2333, "earth leakage at the motor, phase W", "电机 W 相对地漏电"),
    (0x2340, "short circuit at the motor", "电机侧短路"),
    (0x2350, "overload (I²t, thermal state) at the motor", "电机过载（I²t 热状态）"),
    (0x3110, "mains over-voltage", "电网过压"),
    (0x3120, "mains under-voltage", "电网欠压"),
    (0x3130, "phase failure", "缺相"),
    (0x3140, "mains frequency", "电网频率异常"),
    (0x3210, "DC link over-voltage", "母线过压"),
    (0x3220, "DC link under-voltage", "母线欠压"),
    (0x3230, "load error", "负载错误"),
    (0x3310, "output over-voltage", "输出过压"),
    (0x3320, "armature circuit", "电枢回路"),
    (0x3330, "field circuit", "励磁回路"),
    (0x4110, "excess ambient temperature", "环境温度过高"),
    (0x4120, "too low ambient temperature", "环境温度过低"),
    (0x4210, "excess temperature of the device", "设备温度过高"),
    (0x4220, "too low temperature of the device", "设备温度过低"),
    (0x4310, "excess temperature of the drive", "驱动器温度过高"),
    (0x4320, "too low temperature of the drive", "驱动器温度过低"),
    (0x4410, "excess temperature of the supply", "电源温度过高"),
    (0x5111, "±15 V supply", "±15 V 电源"),
    (0x5112, "+24 V supply", "+24 V 电源"),
    (0x5113, "+5 V supply", "+5 V 电源"),
    (0x5210, "measurement circuit", "测量电路"),
    (0x5220, "computing circuit", "运算电路"),
    (0x5300, "operating unit", "操作单元"),
    (0x5410, "output stages", "输出级"),
    (0x5430, "input stages", "输入级"),
    (0x5441, "contact no. 1", "触点 1"),
    (0x5530, "non-volatile memory (EEPROM)", "非易失存储器 (EEPROM) 错误"),
    (0x6010, "software reset (watchdog)", "软件复位（看门狗）"),
    (0x6310, "loss of parameters", "参数丢失"),
    (0x6320, "parameter error", "参数错误"),
    (0x6330, "parameter initialisation error", "参数初始化错误"),
    (0x7110, "brake chopper", "制动斩波器"),
    (0x7111, "failure of the brake chopper", "制动斩波器失效"),
    (0x7112, "over-current of the brake chopper", "制动斩波器过流"),
    (0x7113, "protective circuit of the brake chopper", "制动斩波器保护电路"),
    (0x7121, "motor blocked", "电机堵转"),
    (0x7122, "motor error or wrong commutation", "电机错误或换相错误"),
    (0x7123, "motor tilted", "电机倾覆失步"),
    (0x7301, "tachometer fault", "测速机故障"),
    (0x7302, "tachometer with wrong polarity", "测速机极性错误"),
    (0x7303, "resolver 1 fault", "旋转变压器 1 故障"),
    (0x7304, "resolver 2 fault", "旋转变压器 2 故障"),
    (0x7305, "incremental sensor 1 fault", "增量编码器 1 故障"),
    (0x7306, "incremental sensor 2 fault", "增量编码器 2 故障"),
    (0x7307, "incremental sensor 3 fault", "增量编码器 3 故障"),
    (0x7310, "speed sensor", "速度传感器"),
    (0x7320, "position sensor", "位置传感器"),
    (0x7380, "sensor position difference", "传感器位置偏差"),
    (0x7400, "computation circuit", "计算电路"),
    (0x7500, "communication module", "通信模块"),
    (0x7510, "serial interface no. 1", "串行接口 1"),
    (0x7520, "serial interface no. 2", "串行接口 2"),
    (0x7600, "data storage", "数据存储"),
    (0x8110, "CAN overrun, messages lost", "CAN 溢出，报文丢失"),
    (0x8120, "CAN in error passive mode", "CAN 处于被动错误状态"),
    (0x8130, "heartbeat or life guard of the master lost", "主站心跳或生命守护丢失"),
    (0x8140, "recovered from bus off", "从总线关闭状态恢复"),
    (0x8150, "CAN identifier collision", "CAN 标识符冲突"),
    (0x8210, "PDO not processed, wrong length", "PDO 长度错误，未处理"),
    (0x8220, "PDO length exceeded", "PDO 超长"),
    (0x8230, "DAM MPDO not processed, no such object", "DAM MPDO 的对象不存在，未处理"),
    (0x8240, "unexpected SYNC data length", "SYNC 数据长度异常"),
    (0x8250, "RPDO not received in time", "RPDO 接收超时"),
    (0x8311, "excess torque", "转矩过大"),
    (0x8480, "excess difference between target and actual speed", "目标速度与实际速度偏差过大"),
    (0x8611, "following error", "跟随误差"),
    (0x8612, "reference limit reached", "到达位置限位"),
];

/// Mask, value and name of the classes, narrower ones first.
const CLASSES: [(u16, u16, &str, &str); 41] = [
    (0xFF00, 0x0000, "error reset", "错误已复位"),
    (0xFF00, 0x1000, "generic error", "一般错误"),
    (0xFF00, 0x2100, "current at the input", "输入侧电流"),
    (0xFF00, 0x2200, "current inside the device", "设备内部电流"),
    (0xFF00, 0x2300, "current at the output", "输出侧电流"),
    (0xF000, 0x2000, "current", "电流"),
    (0xFF00, 0x3100, "mains voltage", "电网电压"),
    (0xFF00, 0x3200, "voltage inside the device", "设备内部电压"),
    (0xFF00, 0x3300, "output voltage", "输出电压"),
    (0xF000, 0x3000, "voltage", "电压"),
    (0xFF00, 0x4100, "ambient temperature", "环境温度"),
    (0xFF00, 0x4200, "temperature of the device", "设备温度"),
    (0xFF00, 0x4300, "temperature of the drive", "驱动器温度"),
    (0xFF00, 0x4400, "temperature of the supply", "电源温度"),
    (0xF000, 0x4000, "temperature", "温度"),
    (0xFF00, 0x5100, "supply of the electronics", "电子部分供电"),
    (0xFF00, 0x5200, "control electronics", "控制电路"),
    (0xFF00, 0x5400, "power section", "功率部分"),
    (0xFF00, 0x5500, "data storage", "数据存储"),
    (0xF000, 0x5000, "device hardware", "设备硬件"),
    (0xFF00, 0x6100, "internal software", "内部软件"),
    (0xFF00, 0x6200, "user software", "用户软件"),
    (0xFF00, 0x6300, "data set", "数据集"),
    (0xF000, 0x6000, "device software", "设备软件"),
    (0xFF00, 0x7100, "power module", "功率模块"),
    (0xFF00, 0x7200, "measurement circuit module", "测量电路模块"),
    (0xFF00, 0x7300, "sensor", "传感器"),
    (0xFF00, 0x7400, "computation module", "计算模块"),
    (0xFF00, 0x7500, "communication module", "通信模块"),
    (0xFF00, 0x7600, "data storage module", "数据存储模块"),
    (0xF000, 0x7000, "additional module", "附加模块"),
    (0xFF00, 0x8100, "communication", "通信"),
    (0xFF00, 0x8200, "protocol", "协议"),
    (0xFF00, 0x8300, "torque control", "转矩控制"),
    (0xFF00, 0x8400, "speed control", "速度控制"),
    (0xFF00, 0x8500, "position control", "位置控制"),
    (0xFF00, 0x8600, "positioning controller", "定位控制器"),
    (0xF000, 0x8000, "monitoring", "监控"),
    (0xFF00, 0x9000, "external error", "外部错误"),
    (0xFF00, 0xF000, "additional function", "附加功能"),
    (0xFF00, 0xFF00, "specific to the manufacturer", "厂商自定义"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_emergency_message_is_decoded_field_by_field() {
        let bytes = [0x0F, 0x73, 0x81, 1, 2, 3, 4, 5];
        let emergency = Emergency::decode(&Frame::of(Id::canopen(0x80, 2), bytes)).unwrap();
        let expected = Emergency {
            node: 2,
            code: ErrorCode(0x730F),
            register: ErrorRegister(0x81),
            manufacturer: [1, 2, 3, 4, 5],
        };
        assert_eq!(emergency, expected);
        assert_eq!(Emergency::decode(&emergency.frame()), Some(expected));
        assert_eq!(
            emergency.to_string(),
            "0x730F (sensor), error register: generic + manufacturer, \
             manufacturer's bytes [01, 02, 03, 04, 05]"
        );
    }

    #[test]
    fn sync_and_short_frames_are_not_emergency_messages() {
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x80, 0), [0; 8])), None);
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x80, 1), [0; 7])), None);
        assert_eq!(Emergency::decode(&Frame::of(Id::canopen(0x100, 0), [0; 8])), None);
    }

    #[test]
    fn codes_are_named_by_the_narrowest_entry() {
        assert_eq!(ErrorCode(0x8130).words(), "heartbeat or life guard of the master lost");
        assert_eq!(ErrorCode(0x3210).words(), "DC link over-voltage");
        assert_eq!(ErrorCode(0x3299).words(), "voltage inside the device");
        assert_eq!(ErrorCode(0x3999).words(), "voltage");
        assert_eq!(ErrorCode(0xFF12).words(), "specific to the manufacturer");
        assert_eq!(ErrorCode(0xA000).words(), "unknown error");
    }

    #[test]
    fn every_class_of_table_26_has_a_name() {
        let table = [
            (0x0000, "no error"),
            (0x1000, "generic error"),
            (0x2000, "current"),
            (0x2100, "current at the input"),
            (0x2200, "current inside the device"),
            (0x2300, "current at the output"),
            (0x3000, "voltage"),
            (0x3100, "mains voltage"),
            (0x3200, "voltage inside the device"),
            (0x3300, "output voltage"),
            (0x4000, "temperature"),
            (0x4100, "ambient temperature"),
            (0x4200, "temperature of the device"),
            (0x5000, "device hardware"),
            (0x6000, "device software"),
            (0x6100, "internal software"),
            (0x6200, "user software"),
            (0x6300, "data set"),
            (0x7000, "additional module"),
            (0x8000, "monitoring"),
            (0x8100, "communication"),
            (0x8110, "CAN overrun, messages lost"),
            (0x8120, "CAN in error passive mode"),
            (0x8130, "heartbeat or life guard of the master lost"),
            (0x8140, "recovered from bus off"),
            (0x8150, "CAN identifier collision"),
            (0x8200, "protocol"),
            (0x8210, "PDO not processed, wrong length"),
            (0x8220, "PDO length exceeded"),
            (0x8230, "DAM MPDO not processed, no such object"),
            (0x8240, "unexpected SYNC data length"),
            (0x8250, "RPDO not received in time"),
            (0x9000, "external error"),
            (0xF000, "additional function"),
            (0xFF00, "specific to the manufacturer"),
        ];
        for (code, words) in table {
            assert_eq!(ErrorCode(code).words(), words, "{code:04X}");
        }
    }

    #[test]
    fn every_code_has_a_chinese_name() {
        for code in 0..=u16::MAX {
            let (en, zh) = ErrorCode(code).bilingual();
            assert!(zh.chars().any(|letter| ('\u{4e00}'..='\u{9fff}').contains(&letter)), "{en}: {zh}");
        }
    }

    #[test]
    fn every_bit_of_the_register_in_the_standard_has_a_name() {
        let named: Vec<String> =
            (0..8).map(|bit| ErrorRegister(1 << bit).to_string()).filter(|name| name != "no error").collect();
        let expected = [
            "generic",
            "current",
            "voltage",
            "temperature",
            "communication",
            "device profile",
            "manufacturer",
        ];
        assert_eq!(named, expected, "bit 6 is reserved");
    }

    #[test]
    fn the_tables_have_no_code_twice_and_no_class_hides_a_narrower_one() {
        for (place, (code, ..)) in SPECIFIC.iter().enumerate() {
            assert!(!SPECIFIC[..place].iter().any(|(other, ..)| other == code), "{code:#06x} twice");
        }
        for (place, (mask, code, ..)) in CLASSES.iter().enumerate() {
            let hidden = CLASSES[..place].iter().any(|(wider, other, ..)| code & wider == *other);
            assert!(!hidden, "{mask:#06x} {code:#06x} is never reached");
        }
    }

    #[test]
    fn a_register_without_bits_means_no_error() {
        assert_eq!(ErrorRegister(0).to_string(), "no error");
        assert_eq!(ErrorRegister(0x15).to_string(), "generic + voltage + communication");
    }
}
