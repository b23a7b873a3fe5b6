//! How long the adapter of a serial line holds received bytes back.

use std::fs;
use std::path::Path;

use takt_rt::Nanoseconds;

/// Where the kernel describes serial adapters on USB.
const ADAPTERS: &str = "/sys/bus/usb-serial/devices";

/// The latency timer of the adapter behind a device, which may be named by a link (`/dev/serial/by-id/…`); `None` if it has none, or is
/// not on USB. The chips of FTDI have one, of 16 ms unless it was set to another time.
pub fn adapter_latency_ns(device: &str) -> Option<Nanoseconds> {
    let path = fs::canonicalize(device).ok()?;
    latency_in(Path::new(ADAPTERS), path.file_name()?.to_str()?)
}

fn latency_in(adapters: &Path, name: &str) -> Option<Nanoseconds> {
    let text = fs::read_to_string(adapters.join(name).join("latency_timer")).ok()?;
    text.trim().parse::<u64>().ok().map(|ms| ms.saturating_mul(1_000_000))
}

/// The command that makes the latency of an adapter as short as USB is, until it is unplugged.
pub fn shortest_latency_command(device: &str) -> String {
    let path = fs::canonicalize(device).unwrap_or_else(|_| device.into());
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    format!("echo 1 | sudo tee {ADAPTERS}/{name}/latency_timer")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latency_of_an_adapter_is_what_the_kernel_says() {
        let folder = std::env::temp_dir().join(format!("takt-latency-{}", std::process::id()));
        let adapter = folder.join("ttyUSB7");
        fs::create_dir_all(&adapter).unwrap();
        assert_eq!(latency_in(&folder, "ttyUSB7"), None);
        fs::write(adapter.join("latency_timer"), "16\n").unwrap();
        assert_eq!(latency_in(&folder, "ttyUSB7"), Some(16_000_000));
        fs::write(adapter.join("latency_timer"), "?").unwrap();
        assert_eq!(latency_in(&folder, "ttyUSB7"), None);
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(adapter_latency_ns("/dev/null"), None);
        assert_eq!(adapter_latency_ns("/dev/takt-none"), None);
    }

    #[test]
    fn the_command_names_the_device() {
        assert_eq!(
            shortest_latency_command("/dev/takt-none"),
            "echo 1 | sudo tee /sys/bus/usb-serial/devices/takt-none/latency_timer"
        );
    }
}
