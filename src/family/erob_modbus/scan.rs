//! How a drive is recognised on a Modbus line: by registers that say what only they can say together.

use takt_wire::modbus::frame::RegisterRange;

use super::FACTS;
use super::fault_code::FaultCode;
use super::register::Register;
use super::registers::{BIT_RATE, FAULT_CODE, SLAVE_ADDRESS};
use crate::family::erob_can;
use crate::family::scan::{Answered, FoundDevice};
use crate::procedure::ModbusSession;

/// Looks whether the slave has its own address in register 0000, a bit rate that there is in 0001, and a fault code.
pub async fn look(session: &ModbusSession, bit_rate: u32) -> Option<FoundDevice> {
    let node = session.slave().number();
    if number(session, &SLAVE_ADDRESS).await? != i64::from(node) {
        return None;
    }
    let rate = number(session, &BIT_RATE).await?;
    let fault = number(session, &FAULT_CODE).await.filter(|_| BIT_RATE.values.contain(rate))?;
    let mut device = FoundDevice::new(Some(node), Answered::Modbus { bit_rate }, FACTS.name);
    (device.vendor, device.drive) = (Some(erob_can::MAKER.to_owned()), Some(FACTS.word));
    if let Some(code) = u16::try_from(fault).ok().filter(|code| *code != 0) {
        device.remark(format!("it has a fault: {}", FaultCode(code).words()));
    }
    Some(device)
}

async fn number(session: &ModbusSession, register: &Register) -> Option<i64> {
    let range = RegisterRange::new(register.address, register.number.words())?;
    register.decode(&session.read_registers(range).await.ok()?)
}
