//! The thread that handles an interface's interrupt.

use super::driver::{Class, Device};
use crate::doctor::finding::{Check, Finding, Group};
use crate::doctor::threads::Thread;

const INTERRUPT: Check = Check {
    key: "can_interrupt",
    group: Group::Can,
    title: "interrupt",
    source: "/proc/interrupts, threads irq/*",
    why: "the driver's interrupt thread waits behind those of disks and networks when it has no more priority than they have, and SYNC waits behind a frame of another sender that this thread has yet to finish",
};

/// The priority that the kernel gives every interrupt thread.
const USUAL_PRIORITY: u32 = 50;

/// What is above belongs to the kernel's watchdogs and migration.
const HIGHEST_PRIORITY: u32 = 95;

pub fn finding(name: &str, device: &Device, table: &str, threads: &[Thread], priority: u8) -> Finding {
    let shared = if device.class == Class::Usb { " (the USB host's)" } else { "" };
    let numbers = numbers(name, device, table);
    let Some(number) = numbers.first() else {
        return INTERRUPT.not_known("none of the interface's own is shown");
    };
    let prefix = format!("irq/{number}-");
    let Some(thread) = threads.iter().find(|thread| thread.name.starts_with(&prefix)) else {
        return INTERRUPT
            .not_known(format!("number {number}{shared}; it has no thread, or none that can be seen"));
    };
    let read = format!("{}{shared} at priority {}", thread.name, thread.priority);
    let best = best_priority(device, priority);
    let finding = if thread.priority <= USUAL_PRIORITY && best > USUAL_PRIORITY {
        INTERRUPT.could_be_better(format!("{read}, as every other interrupt"))
    } else if device.class == Class::Usb && priority > 0 && thread.priority >= priority.into() {
        INTERRUPT.could_be_better(format!("{read}, not below the loop's {priority}"))
    } else {
        return INTERRUPT.good(read).applied(true);
    };
    finding.applied(false).mend(format!("sudo chrt --fifo --pid {best} {}", thread.id))
}

/// Above the loop's: the handler is short, and without it the controller sends no frame after the one that it has. But
/// that of a USB host serves other devices as well, and stays below.
fn best_priority(device: &Device, loop_priority: u8) -> u32 {
    match device.class {
        Class::Usb => u32::from(loop_priority).saturating_sub(1).clamp(1, USUAL_PRIORITY + 20),
        _ => (u32::from(loop_priority) + 5).min(HIGHEST_PRIORITY),
    }
}

/// The interrupts of an interface from `/proc/interrupts`: those named after it, after the address of its device or
/// after its driver; for an adapter on USB those of the host controllers.
fn numbers(name: &str, device: &Device, table: &str) -> Vec<u32> {
    let is_own = |word: &str| {
        let word = word.trim_end_matches(',');
        word == name
            || word == device.driver
            || device.address.as_deref() == Some(word)
            || (device.class == Class::Usb && (word.starts_with("xhci") || word.starts_with("ehci")))
    };
    let lines = table.lines().filter_map(|line| line.split_once(':'));
    lines
        .filter(|(_, rest)| rest.split_whitespace().any(is_own))
        .filter_map(|(number, _)| number.trim().parse().ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    const TABLE: &str = "           CPU0       CPU1\n 16:   882   0  IO-APIC  16-fasteoi   can0, can1\n \
        125:  44  0  IR-PCI-MSIX-0000:00:14.0    0-edge      xhci_hcd\n 186:  1  0  pinctrl-bcm2835  25 Level     spi0.0\nNMI:  0 0   Non-maskable interrupts\n";

    fn device(class: Class, address: &str) -> Device {
        Device { class, driver: "driver".to_owned(), address: Some(address.to_owned()) }
    }

    fn thread(name: &str, priority: u32) -> Thread {
        Thread { name: name.to_owned(), id: 333, policy: 1, priority, is_kernel: true, ..Thread::default() }
    }

    #[test]
    fn an_interrupt_is_found_by_interface_address_or_host() {
        assert_eq!(numbers("can1", &device(Class::Native, "0000:03:00.0"), TABLE), [16]);
        assert_eq!(numbers("can0", &device(Class::Native, ""), TABLE), [16]);
        assert_eq!(numbers("can5", &device(Class::Spi, "spi0.0"), TABLE), [186]);
        assert_eq!(numbers("can5", &device(Class::Usb, "1-4:1.0"), TABLE), [125]);
        assert_eq!(numbers("can5", &device(Class::Native, "0000:09:00.0"), TABLE), Vec::<u32>::new());
    }

    #[test]
    fn the_thread_belongs_above_other_interrupts_and_that_of_a_usb_host_below_the_loop() {
        let native = |priority| {
            finding("can0", &device(Class::Native, ""), TABLE, &[thread("irq/16-can0", priority)], 80)
        };
        assert_eq!(native(50).verdict, Verdict::CouldBeBetter);
        assert_eq!(native(50).mend, ["sudo chrt --fifo --pid 85 333"]);
        assert_eq!(native(85).verdict, Verdict::Good);
        let usb = |priority| {
            finding("can5", &device(Class::Usb, ""), TABLE, &[thread("irq/125-xhci_hcd", priority)], 80)
        };
        assert_eq!(usb(50).mend, ["sudo chrt --fifo --pid 70 333"]);
        assert_eq!(usb(70).verdict, Verdict::Good);
        assert_eq!(usb(80).verdict, Verdict::CouldBeBetter);
        let none = finding("can0", &device(Class::Native, ""), TABLE, &[thread("irq/160-can9", 50)], 80);
        assert_eq!(none.verdict, Verdict::NotKnown);
        // A loop at 40 cannot have the interrupt above all others and below itself.
        let low = finding("can0", &device(Class::Native, ""), TABLE, &[thread("irq/16-can0", 39)], 40);
        assert_eq!(low.verdict, Verdict::Good);
    }
}
