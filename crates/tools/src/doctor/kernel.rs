//! The kernel: its preemption model, its clock, the share that it leaves to real-time threads, and what it runs on.

use takt_rt::linux::is_preempt_rt_version;

use super::distribution::Distribution;
use super::finding::{Check, Finding, Group};
use super::source::Source;

const PREEMPT_RT: Check = Check {
    key: "preempt_rt",
    group: Group::Kernel,
    title: "PREEMPT_RT",
    source: "/proc/version",
    why: "without it the kernel holds a real-time thread off for as long as its own work takes: milliseconds under load, without a bound",
};

const RT_RUNTIME: Check = Check {
    key: "sched_rt_runtime_us",
    group: Group::Kernel,
    title: "real-time share",
    source: "/proc/sys/kernel/sched_rt_runtime_us",
    why: "when real-time threads have used up their share of a period, the kernel stops them for the rest of it; a loop that takes less is never touched",
};

const CLOCK_SOURCE: Check = Check {
    key: "clocksource",
    group: Group::Kernel,
    title: "clock source",
    source: "/sys/devices/system/clocksource/clocksource0/current_clocksource",
    why: "the loop reads the clock thousands of times a second: from the processor's counter in 30 ns, from a chip beside it in a microsecond and by a system call",
};

const HYPERVISOR: Check = Check {
    key: "hypervisor",
    group: Group::Kernel,
    title: "hypervisor",
    source: "/proc/cpuinfo, /proc/stat",
    why: "a host may stop a guest's processor at any time and for any time, whatever the guest's own kernel promises",
};

const CONTAINER: Check = Check {
    key: "container",
    group: Group::Kernel,
    title: "container",
    source: "/.dockerenv, /run/.containerenv",
    why: "the kernel is the host's: what concerns it is mended there, by the commands of the host's distribution",
};

pub fn findings(source: &Source, cpu: usize) -> Vec<Finding> {
    let text = |path: &str| source.text(path);
    let clock = |name: &str| text(&format!("/sys/devices/system/clocksource/clocksource0/{name}"));
    vec![
        preempt_rt(text("/proc/version").as_deref(), Distribution::of(source)),
        real_time_share(
            text(RT_RUNTIME.source).as_deref(),
            text("/proc/sys/kernel/sched_rt_period_us").as_deref(),
        ),
        clock_source(
            clock("current_clocksource").as_deref(),
            &clock("available_clocksource").unwrap_or_default(),
        ),
        hypervisor(
            &text("/proc/cpuinfo").unwrap_or_default(),
            text("/sys/hypervisor/type").as_deref(),
            source.exists("/proc/device-tree/hypervisor"),
            &text("/proc/stat").unwrap_or_default(),
            cpu,
        ),
        container(source.is_container()),
    ]
}

fn container(is_container: bool) -> Finding {
    if is_container {
        CONTAINER.not_known("yes: what follows about kernel and processor is to be mended on the host")
    } else {
        CONTAINER.good("none")
    }
}

fn preempt_rt(version: Option<&str>, distribution: Distribution) -> Finding {
    let Some(version) = version else { return PREEMPT_RT.not_known("the kernel's version cannot be read") };
    // From the build number on: what `uname -v` says. Before it stand the compiler and the builder.
    let build = version.rfind(" #").map_or(version, |at| &version[at + 1..]);
    let release = version.split_whitespace().nth(2).unwrap_or("?");
    let read = format!("{release} {build}");
    if is_preempt_rt_version(build.as_bytes()) {
        PREEMPT_RT.good(read).applied(true)
    } else {
        PREEMPT_RT.forbids(read).applied(false).mend(distribution.realtime_kernel())
    }
}

fn real_time_share(runtime: Option<&str>, period: Option<&str>) -> Finding {
    let Some(runtime) = runtime.and_then(|text| text.parse::<i64>().ok()) else {
        return RT_RUNTIME.not_known("this kernel has no limit on real-time threads, or does not show it");
    };
    let period = period.and_then(|text| text.parse::<i64>().ok()).filter(|us| *us > 0).unwrap_or(1_000_000);
    let mend = "sudo sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000";
    let share = runtime.saturating_mul(100) / period;
    match runtime {
        -1 => RT_RUNTIME.good("unlimited"),
        ..=0 => RT_RUNTIME.forbids("real-time threads are given no time at all").mend(mend),
        _ if share < 50 => RT_RUNTIME.could_be_better(format!("{share} % of {period} µs")).mend(mend),
        _ => RT_RUNTIME.good(format!("{share} % of {period} µs, far more than the loop takes")),
    }
}

fn clock_source(current: Option<&str>, available: &str) -> Finding {
    let Some(current) = current else { return CLOCK_SOURCE.not_known("the kernel does not show it") };
    let read = format!("{current} (available: {available})");
    let finding = match current {
        "jiffies" | "refined-jiffies" => CLOCK_SOURCE.forbids(read),
        "hpet" | "acpi_pm" | "pit" | "xen" => CLOCK_SOURCE.could_be_better(read),
        _ => return CLOCK_SOURCE.good(read),
    };
    match available.split_whitespace().find(|name| *name == "tsc") {
        Some(name) => finding.mend(format!("echo {name} | sudo tee {}", CLOCK_SOURCE.source)),
        None => finding.mend("sudo dmesg | grep -iE 'tsc|clocksource'   # says why the counter was given up"),
    }
}

fn hypervisor(cpuinfo: &str, kind: Option<&str>, is_in_device_tree: bool, stat: &str, cpu: usize) -> Finding {
    let has_flag = cpuinfo
        .lines()
        .filter(|line| line.starts_with("flags"))
        .any(|line| line.split_whitespace().any(|flag| flag == "hypervisor"));
    if !has_flag && kind.is_none() && !is_in_device_tree {
        return HYPERVISOR.good("none");
    }
    let kind = kind.map_or_else(String::new, |kind| format!(" ({kind})"));
    let stolen = match stolen_permille(stat, cpu) {
        Some(permille) => {
            format!("; it has taken {}.{} % of CPU {cpu}'s time", permille / 10, permille % 10)
        }
        None => String::new(),
    };
    HYPERVISOR
        .could_be_better(format!("this is a guest{kind}{stolen}"))
        .mend("virsh vcpupin DOMAIN VCPU CPU   # on the host: a physical CPU for each of the guest's, and nothing else on it")
}

/// The share of time that the host gave to others while the CPU wanted to run, from `/proc/stat`.
fn stolen_permille(stat: &str, cpu: usize) -> Option<u64> {
    let name = format!("cpu{cpu}");
    let line = stat.lines().find(|line| line.split_whitespace().next() == Some(&name))?;
    let ticks: Vec<u64> = line.split_whitespace().skip(1).map_while(|word| word.parse().ok()).collect();
    // user nice system idle iowait irq softirq steal; what follows is contained in the first two.
    let total: u64 = ticks.iter().take(8).sum();
    (ticks.get(7)? * 1_000).checked_div(total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn only_the_version_string_decides_about_preempt_rt() {
        for (version, verdict, read) in [
            (
                "Linux version 6.1.0-37-rt-amd64 (debian-kernel@lists.debian.org) (gcc-12 (Debian 12.2.0-14) 12.2.0, GNU ld 2.40) #1 SMP PREEMPT_RT Debian 6.1.140-1 (2025-05-22)",
                Verdict::Good,
                "6.1.0-37-rt-amd64 #1 SMP PREEMPT_RT Debian 6.1.140-1 (2025-05-22)",
            ),
            (
                "Linux version 4.19.0-5-rt-amd64 (debian-kernel@lists.debian.org) (gcc version 8.3.0 (Debian 8.3.0-7)) #1 SMP PREEMPT RT Debian 4.19.37-1 (2019-05-05)",
                Verdict::Good,
                "4.19.0-5-rt-amd64 #1 SMP PREEMPT RT Debian 4.19.37-1 (2019-05-05)",
            ),
            (
                "Linux version 6.8.0-60-generic (buildd@lcy02) (x86_64-linux-gnu-gcc-13) #63-Ubuntu SMP PREEMPT_DYNAMIC Tue Apr 15 19:04:15 UTC 2025",
                Verdict::ForbidsRealTime,
                "6.8.0-60-generic #63-Ubuntu SMP PREEMPT_DYNAMIC Tue Apr 15 19:04:15 UTC 2025",
            ),
            // Somebody called the machine so; the kernel is another.
            (
                "Linux version 5.15.0-PREEMPT_RT (me@box) (gcc) #2 SMP Mon Jan 1 00:00:00 UTC 2024",
                Verdict::ForbidsRealTime,
                "5.15.0-PREEMPT_RT #2 SMP Mon Jan 1 00:00:00 UTC 2024",
            ),
        ] {
            let finding = preempt_rt(Some(version), Distribution::Debian);
            assert_eq!((finding.verdict, finding.read.as_str()), (verdict, read));
            assert_eq!(finding.mend.is_empty(), verdict == Verdict::Good);
        }
        assert_eq!(preempt_rt(None, Distribution::Other).verdict, Verdict::NotKnown);
    }

    #[test]
    fn the_share_of_real_time_threads_is_judged_as_a_share() {
        for (runtime, period, verdict) in [
            (Some("-1"), Some("1000000"), Verdict::Good),
            (Some("950000"), Some("1000000"), Verdict::Good),
            (Some("95000"), Some("1000000"), Verdict::CouldBeBetter),
            (Some("95000"), Some("100000"), Verdict::Good),
            (Some("0"), Some("1000000"), Verdict::ForbidsRealTime),
            (Some("950000"), Some("0"), Verdict::Good),
            (Some("?"), None, Verdict::NotKnown),
            (None, None, Verdict::NotKnown),
        ] {
            assert_eq!(real_time_share(runtime, period).verdict, verdict, "{runtime:?} of {period:?}");
        }
    }

    #[test]
    fn a_clock_beside_the_processor_is_slow_and_the_tick_is_none() {
        for (current, available, verdict) in [
            ("tsc", "tsc hpet acpi_pm", Verdict::Good),
            ("arch_sys_counter", "arch_sys_counter", Verdict::Good),
            ("kvm-clock", "kvm-clock tsc", Verdict::Good),
            ("hpet", "hpet acpi_pm", Verdict::CouldBeBetter),
            ("acpi_pm", "tsc acpi_pm", Verdict::CouldBeBetter),
            ("jiffies", "jiffies", Verdict::ForbidsRealTime),
        ] {
            let finding = clock_source(Some(current), available);
            assert_eq!(finding.verdict, verdict, "{current}");
            assert_eq!(finding.mend.is_empty(), verdict == Verdict::Good);
        }
        assert!(clock_source(Some("hpet"), "tsc hpet").mend[0].starts_with("echo tsc | sudo tee /sys/"));
    }

    #[test]
    fn a_guest_is_known_by_any_of_its_signs_and_tells_the_time_that_was_taken() {
        let x86 = "processor\t: 0\nflags\t\t: fpu vme hypervisor lahf_lm\n";
        let stat = "cpu  9 9 9 9 9 9 9 9 0 0\ncpu0 1 0 1 100 0 0 0 0 0 0\ncpu1 100 0 50 800 20 0 10 20 0 0\n";
        let finding = hypervisor(x86, None, false, stat, 1);
        assert_eq!(finding.verdict, Verdict::CouldBeBetter);
        assert_eq!(finding.read, "this is a guest; it has taken 2.0 % of CPU 1's time");
        assert_eq!(hypervisor("", Some("xen"), false, "", 1).read, "this is a guest (xen)");
        assert_eq!(hypervisor("", None, true, "cpu1 0 0 0 0 0 0 0 0", 1).read, "this is a guest");
        let metal = "flags\t: fpu vmx hypervisor_of_something\nmodel name : hypervisor\n";
        assert_eq!(hypervisor(metal, None, false, stat, 1).verdict, Verdict::Good);
    }
}
