//! `takt doctor`: whole machines, judged from copies of their files, and this one, as a user meets it.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use proptest::prelude::*;
use serde_json::Value;
use takt::config::Config;
use takt::telemetry::Emphasis;
use takt_rt::linux::{Outcome, Policy, STEP_COUNT, Scheduling, Step, StepResult, ThreadReport};
use takt_tools::doctor::{Examination, Finding, Source, Subject, Verdict, examine};
use tempfile::TempDir;

const IP: &str = "ip -details -statistics -json link show";

/// A copy of some machine's files, with four CPUs of which the loop runs on the last.
struct Machine {
    root: TempDir,
    answers: BTreeMap<String, String>,
}

impl Machine {
    fn new(files: &[(&str, &str)]) -> Self {
        let machine = Self { root: tempfile::tempdir().unwrap(), answers: BTreeMap::new() };
        files.iter().for_each(|(path, text)| machine.file(path, text.as_bytes()));
        machine
    }

    fn file(&self, path: &str, bytes: &[u8]) {
        let path = self.root.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    fn link(&self, path: &str, to: &str) {
        let path = self.root.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        symlink(to, path).unwrap();
    }

    fn examine(&self, subject: &Subject, attempt: &ThreadReport) -> Examination {
        examine(&Source::recorded(self.root.path(), self.answers.clone()), subject, attempt)
    }
}

fn subject() -> Subject {
    Subject { cpu: 3, ..Subject::new(None) }
}

/// What came of an attempt at real time where everything was `outcome`.
fn attempt(outcome: Outcome) -> ThreadReport {
    let is_granted = outcome == Outcome::Granted;
    let steps: [Step; STEP_COUNT] = [
        Step::TimerSlack,
        Step::CpuAffinity,
        Step::LockMemory,
        Step::PrefaultStack,
        Step::DmaLatency,
        Step::Fifo,
    ];
    let policy = if is_granted { Policy::Fifo } else { Policy::Other };
    ThreadReport {
        steps: steps.map(|step| StepResult { step, outcome }),
        scheduling: Scheduling { policy, priority: if is_granted { 80 } else { 0 }, reset_on_fork: true },
        cpu: is_granted.then_some(3),
        memory_locked: is_granted,
        stack_bytes: 0,
        timer_slack_ns: 1,
        dma_latency_held: is_granted,
        preempt_rt: true,
    }
}

fn finding<'a>(examination: &'a Examination, check: &str) -> &'a Finding {
    examination
        .checks
        .iter()
        .find(|finding| finding.check == check)
        .unwrap_or_else(|| panic!("{check} is not among the checks"))
}

fn worse_than_good(examination: &Examination) -> Vec<&str> {
    let worse = examination.checks.iter().filter(|finding| finding.verdict > Verdict::Good);
    worse.map(|finding| finding.check).collect()
}

/// A computer that somebody has prepared for a robot: PREEMPT_RT, the last CPU set aside, a CAN card on PCI Express.
fn prepared() -> Machine {
    let mut machine = Machine::new(&[
        ("proc/version", "Linux version 6.12.30-rt-amd64 (deb@x) (gcc) #1 SMP PREEMPT_RT Debian 6.12.30-1\n"),
        (
            "proc/cmdline",
            "BOOT_IMAGE=/vmlinuz quiet isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2\n",
        ),
        ("proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu vme constant_tsc\n"),
        ("proc/stat", "cpu 1 2 3\ncpu3 1 0 1 100 0 0 0 0\n"),
        ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
        ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
        (
            "proc/self/limits",
            "Max locked memory         unlimited            unlimited            bytes\n\
             Max realtime priority     95                   95\n",
        ),
        ("proc/self/status", "Name:\ttakt\nCapEff:\t0000000000000000\n"),
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
        ("sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet acpi_pm\n"),
        ("sys/devices/system/cpu/online", "0-3\n"),
        ("sys/devices/system/cpu/isolated", "3\n"),
        ("sys/devices/system/cpu/nohz_full", "3\n"),
        ("sys/devices/system/cpu/cpu3/topology/thread_siblings_list", "3\n"),
        ("sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance\n"),
        ("sys/devices/system/cpu/cpu3/cpufreq/scaling_available_governors", "performance powersave\n"),
        ("sys/devices/system/cpu/cpu3/cpuidle/state0/name", "POLL\n"),
        ("sys/devices/system/cpu/cpu3/cpuidle/state0/latency", "0\n"),
        ("sys/devices/system/cpu/cpu3/cpuidle/state1/name", "C8\n"),
        ("sys/devices/system/cpu/cpu3/cpuidle/state1/latency", "200\n"),
        ("sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "0\n"),
        ("sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n"),
        ("proc/zoneinfo", "  pagesets\n    cpu: 0\n              high:  252\n              batch: 63\n"),
        ("proc/interrupts", "      CPU0 CPU1 CPU2 CPU3\n 16:  9  0  0  0  IR-IO-APIC  16-fasteoi   can0\n"),
        ("proc/irq/16/effective_affinity_list", "0\n"),
        ("proc/irq/17/effective_affinity_list", "3\n"),
        ("proc/net/can/version", "rev 20170425\n"),
        ("sys/class/net/eth0/type", "1\n"),
        ("sys/class/net/can0/type", "280\n"),
        ("sys/class/net/can0/flags", "0x40081\n"),
    ]);
    for (id, name, priority, cpus) in
        [(30, "rcuop/3", 0, "0-2"), (40, "migration/3", 99, "3"), (50, "irq/16-can0", 70, "0")]
    {
        machine.file(&format!("proc/{id}/task/{id}/stat"), stat(id, name, priority).as_bytes());
        let status = format!("Name:\t{name}\nCpus_allowed_list:\t{cpus}\n");
        machine.file(&format!("proc/{id}/task/{id}/status"), status.as_bytes());
    }
    machine.link("sys/class/net/can0/device", "../../../0000:03:00.0");
    machine.file("sys/class/0000:03:00.0", b"");
    machine.answers.insert(IP.to_owned(), can0("ERROR-ACTIVE", 100, "pfifo_fast", 0));
    machine.answers.insert("ethtool -c can0".to_owned(), "rx-usecs: n/a\nrx-usecs-irq: 0\n".to_owned());
    machine
}

/// A line of `/proc/PID/stat` of a thread of the kernel.
fn stat(id: u32, name: &str, priority: u32) -> String {
    let policy = u32::from(priority > 0);
    format!(
        "{id} ({name}) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -51 0 1 0 9 0 0 18446744073709551615 0 0 0 0 0 0 0 \
         2147483647 0 0 0 0 17 0 {priority} {policy} 0 0 0 0 0 0 0 0 0 0 0"
    )
}

fn can0(state: &str, restart_ms: u32, queueing: &str, bus_off: u32) -> String {
    format!(
        r#"[{{"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"qdisc":"{queueing}","txqlen":10,"link_type":"can",
        "linkinfo":{{"info_kind":"can","info_data":{{"state":"{state}","berr_counter":{{"tx":0,"rx":0}},"restart_ms":{restart_ms},
        "bittiming":{{"bitrate":1000000,"sample_point":"0.750"}},"bittiming_const":{{"name":"kvaser_pci"}}}},
        "info_xstats":{{"restarts":0,"bus_error":0,"bus_off":{bus_off}}}}},
        "stats64":{{"rx":{{"errors":0,"dropped":0}},"tx":{{"errors":0}}}}}}]"#
    )
}

#[test]
fn a_prepared_machine_is_good_in_every_respect() {
    let examination = prepared().examine(&subject(), &attempt(Outcome::Granted));
    assert_eq!(worse_than_good(&examination), Vec::<&str>::new());
    assert_eq!(examination.verdict, Verdict::Good);
    for check in ["isolcpus", "nohz_full", "rcu_nocbs"] {
        let finding = finding(&examination, check);
        assert_eq!((finding.permitted, finding.applied), (Some(true), Some(true)), "{check}");
    }
    let can: Vec<_> = examination
        .checks
        .iter()
        .filter(|finding| finding.interface.is_some())
        .map(|finding| finding.check)
        .collect();
    assert_eq!(
        can,
        [
            "can_driver",
            "can_state",
            "can_bit_rate",
            "can_restart_ms",
            "can_errors",
            "can_queue",
            "can_interrupt",
            "can_rx_coalescing"
        ]
    );
    assert_eq!(finding(&examination, "can_driver").verdict, Verdict::Good);
}

#[test]
fn serial_adapters_are_examined_for_their_latency_and_their_rate() {
    let mut machine = prepared();
    for (name, driver) in [("ttyUSB0", "ftdi_sio"), ("ttyUSB1", "ch341-uart"), ("ttyUSB2", "ftdi_sio")] {
        machine
            .link(&format!("sys/bus/usb-serial/devices/{name}/driver"), &format!("../../drivers/{driver}"));
        machine.answers.insert(format!("stty -F /dev/{name} speed"), "115200\n".to_owned());
    }
    machine.file("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", b"16\n");
    machine.file("sys/bus/usb-serial/devices/ttyUSB2/latency_timer", b"1\n");
    let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
    assert_eq!(worse_than_good(&examination), ["serial_latency"]);
    let of_adapters: Vec<_> = examination
        .checks
        .iter()
        .filter(|finding| finding.check.starts_with("serial"))
        .map(|finding| (finding.interface.as_deref().unwrap(), finding.check, finding.read.as_str()))
        .collect();
    let rate = "115200 bit/s, as the last program has left it: reading a position by Modbus takes 5.0 ms and the time of the drive";
    assert_eq!(
        of_adapters,
        [
            ("ttyUSB0", "serial_latency", "16 ms (ftdi_sio)"),
            ("ttyUSB0", "serial_rate", rate),
            ("ttyUSB1", "serial_latency", "ch341-uart has none"),
            ("ttyUSB1", "serial_rate", rate),
            ("ttyUSB2", "serial_latency", "1 ms (ftdi_sio)"),
            ("ttyUSB2", "serial_rate", rate),
        ]
    );
    let text = examination.render(Emphasis::None);
    assert!(text.contains("latency_timer   # until it is unplugged"), "{text}");
}

#[test]
fn each_thing_that_is_spoilt_is_found_and_nothing_else() {
    let spoil: [(&str, &str, &[&str], Verdict); 12] = [
        (
            "proc/version",
            "Linux version 6.8.0-60-generic (b@l) (gcc) #63-Ubuntu SMP PREEMPT_DYNAMIC Tue",
            &["preempt_rt"],
            Verdict::ForbidsRealTime,
        ),
        ("proc/sys/kernel/sched_rt_runtime_us", "0", &["sched_rt_runtime_us"], Verdict::ForbidsRealTime),
        (
            "sys/devices/system/clocksource/clocksource0/current_clocksource",
            "hpet",
            &["clocksource"],
            Verdict::CouldBeBetter,
        ),
        ("proc/cpuinfo", "flags\t: fpu hypervisor\n", &["hypervisor"], Verdict::CouldBeBetter),
        (
            "sys/devices/system/cpu/cpu3/topology/thread_siblings_list",
            "2-3",
            &["smt_sibling"],
            Verdict::CouldBeBetter,
        ),
        (
            "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
            "powersave",
            &["governor"],
            Verdict::CouldBeBetter,
        ),
        ("sys/devices/system/cpu/isolated", "", &["isolcpus"], Verdict::CouldBeBetter),
        ("proc/irq/16/effective_affinity_list", "0,3", &["irqaffinity"], Verdict::CouldBeBetter),
        ("proc/50/task/50/stat", &stat(50, "irq/16-can0", 50), &["can_interrupt"], Verdict::CouldBeBetter),
        (
            "sys/kernel/mm/transparent_hugepage/enabled",
            "[always] madvise never",
            &["transparent_hugepage"],
            Verdict::CouldBeBetter,
        ),
        (
            "proc/zoneinfo",
            "  pagesets\n    cpu: 0\n              high:  1211\n              batch: 63\n",
            &["page_lists"],
            Verdict::CouldBeBetter,
        ),
        (
            "proc/self/limits",
            "Max locked memory         65536                65536                bytes\nMax realtime priority     0                    0\n",
            &["rlimit_rtprio", "rlimit_memlock"],
            Verdict::CouldBeBetter,
        ),
    ];
    for (path, text, checks, verdict) in spoil {
        let machine = prepared();
        machine.file(path, text.as_bytes());
        let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
        assert_eq!(worse_than_good(&examination), checks, "{path}");
        assert_eq!(examination.verdict, verdict, "{path}");
        for check in checks {
            assert!(!finding(&examination, check).mend.is_empty(), "{check} says what mends it");
        }
    }
}

#[test]
fn a_bus_that_has_gone_off_and_would_stay_off_is_told_with_its_past() {
    let mut machine = prepared();
    machine.answers.insert(IP.to_owned(), can0("BUS-OFF", 0, "fq_codel", 7));
    machine.answers.insert("ethtool -c can0".to_owned(), "rx-usecs-irq: 1000\n".to_owned());
    let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
    assert_eq!(
        worse_than_good(&examination),
        ["can_state", "can_restart_ms", "can_errors", "can_queue", "can_rx_coalescing"]
    );
    assert_eq!(examination.verdict, Verdict::ForbidsRealTime);
    assert_eq!(finding(&examination, "can_errors").read, "bus off 7");
}

#[test]
fn without_ip_what_the_files_tell_is_told_and_the_rest_is_said_to_be_unknown() {
    let mut machine = prepared();
    machine.answers.clear();
    let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
    assert_eq!(finding(&examination, "can_state").read, "up");
    for check in ["can_details", "can_rx_coalescing"] {
        let finding = finding(&examination, check);
        assert_eq!(finding.verdict, Verdict::NotKnown);
        assert!(finding.mend[0].starts_with("sudo apt-get install"), "{}", finding.mend[0]);
    }
    assert_eq!(examination.verdict, Verdict::Good);
}

#[test]
fn the_interfaces_of_a_configuration_must_be_there_and_at_its_bit_rate() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml"))
        .unwrap();
    let mut config = Config::parse("arm6", &text).unwrap();
    config.override_interface("base", "can0").unwrap();
    config.override_interface("wrist", "can1").unwrap();
    config.buses[0].bit_rate = 500_000;
    let subject = Subject { cpu: 3, ..Subject::new(Some(&config)) };
    let examination = prepared().examine(&subject, &attempt(Outcome::Granted));
    let forbidding: Vec<_> = examination
        .checks
        .iter()
        .filter(|finding| finding.verdict == Verdict::ForbidsRealTime)
        .map(|finding| (finding.interface.as_deref().unwrap(), finding.check))
        .collect();
    assert_eq!(forbidding, [("can0", "can_bit_rate"), ("can1", "can_interface")]);
}

#[test]
fn a_refused_attempt_forbids_real_time_whatever_the_limits_say() {
    let examination = prepared().examine(&subject(), &attempt(Outcome::Refused { errno: 1 }));
    assert_eq!(examination.verdict, Verdict::ForbidsRealTime);
    for check in ["sched_fifo", "mlockall"] {
        let finding = finding(&examination, check);
        assert_eq!((finding.permitted, finding.applied), (Some(false), Some(false)), "{check}");
        assert!(finding.mend[0].contains("cap_sys_nice,cap_ipc_lock=ep"), "{}", finding.mend[0]);
    }
    // Now that nothing holds the idle states off, they count too.
    assert_eq!(finding(&examination, "idle_states").verdict, Verdict::CouldBeBetter);
}

#[test]
fn a_machine_that_shows_nothing_is_judged_by_the_attempt_alone() {
    let machine = Machine::new(&[]);
    let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
    assert_eq!(worse_than_good(&examination), Vec::<&str>::new());
    let interface = finding(&examination, "can_interface");
    assert_eq!(interface.read, "there is none, and the kernel has no CAN loaded");
}

#[test]
fn the_text_shows_every_check_in_eighty_columns_and_colours_only_when_asked() {
    let mut machine = prepared();
    machine.answers.insert(IP.to_owned(), can0("ERROR-PASSIVE", 0, "fq_codel", 7));
    machine.file("proc/cmdline", b"quiet");
    machine.file("sys/devices/system/cpu/isolated", b"");
    machine.file("sys/devices/system/cpu/nohz_full", b"(null)");
    let examination = machine.examine(&subject(), &attempt(Outcome::Refused { errno: 12 }));
    let plain = examination.render(Emphasis::None);
    assert!(!plain.contains('\x1b'));
    assert!(examination.render(Emphasis::Ansi).contains('\x1b'));
    for check in &examination.checks {
        assert!(plain.contains(check.title), "{}", check.title);
    }
    for line in plain.lines().filter(|line| !line.contains('→')) {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert_eq!(plain.matches("isolcpus=managed_irq").count(), 1, "a command is shown once:\n{plain}");
    assert!(plain.contains("✗ 2 things forbid real time"), "{plain}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_content_of_a_file_brings_the_examination_down(
        which in 0usize..31,
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..200),
            "[-0-9,:() a-z\n]{0,80}".prop_map(String::into_bytes),
        ],
    ) {
        let mut machine = prepared();
        let mut files = vec![];
        collect(machine.root.path(), &mut files);
        files.sort();
        match files.get(which) {
            Some(path) => fs::write(path, &bytes).unwrap(),
            None => {
                machine.answers.insert(IP.to_owned(), String::from_utf8_lossy(&bytes).into_owned());
            }
        }
        let examination = machine.examine(&subject(), &attempt(Outcome::Granted));
        prop_assert!(examination.checks.len() > 15);
        prop_assert!(!examination.render(Emphasis::None).is_empty());
    }
}

fn collect(folder: &Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        match entry.file_type().unwrap() {
            kind if kind.is_dir() => collect(&entry.path(), files),
            kind if kind.is_file() => files.push(entry.path()),
            _ => {}
        }
    }
}

// ---- this machine, by the command line ----------------------------------------------------------------------

fn takt(options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("doctor").args(options).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn report(output: &Output) -> Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

#[test]
fn the_exit_code_follows_the_verdict_and_every_check_has_its_keys() {
    let output = takt(&["--json", "--self-test-s", "0"]).output().unwrap();
    let report = report(&output);
    let expected = if report["verdict"] == "forbids_real_time" { 1 } else { 0 };
    assert_eq!(output.status.code(), Some(expected));
    assert_eq!((&report["self_test"], &report["cycle_ns"]), (&Value::Null, &Value::from(1_000_000)));
    let checks = report["checks"].as_array().unwrap();
    for key in [
        "preempt_rt",
        "sched_rt_runtime_us",
        "clocksource",
        "hypervisor",
        "sched_fifo",
        "mlockall",
        "rlimit_rtprio",
        "rlimit_memlock",
        "smt_sibling",
        "governor",
        "idle_states",
        "cpu_dma_latency",
        "isolcpus",
        "nohz_full",
        "rcu_nocbs",
        "irqaffinity",
        "irqbalance",
        "competing_threads",
        "transparent_hugepage",
        "page_lists",
    ] {
        assert!(checks.iter().any(|check| check["check"] == key), "{key}");
    }
    for check in checks {
        for key in ["group", "interface", "title", "permitted", "applied"] {
            assert!(check.get(key).is_some(), "{key} of {check}");
        }
        for key in ["verdict", "read", "source", "why"] {
            assert!(check[key].as_str().is_some_and(|text| !text.is_empty()), "{key} of {check}");
        }
        if check["verdict"] == "forbids_real_time" || check["verdict"] == "could_be_better" {
            assert!(!check["mend"].as_array().unwrap().is_empty(), "{check}");
        }
    }
}

#[test]
fn the_self_test_grades_the_loop_itself() {
    let output = takt(&["--json", "--self-test-s", "1"]).output().unwrap();
    let test = &report(&output)["self_test"];
    assert!(["excellent", "good", "fair", "poor"].iter().any(|grade| test["grade"] == *grade), "{test}");
    assert_eq!((&test["cycles"], &test["is_whole"]), (&Value::from(1_000), &Value::from(true)));
    assert!(test["sync_ns"]["max"].is_u64() && test["missed_slots"].is_u64(), "{test}");
    assert_eq!(test["grade"] == "poor", test["missed_slots"].as_u64().unwrap() > 0, "{test}");
}

#[test]
fn without_rights_it_says_what_was_refused_and_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    // Where the binary lies may be closed to others, so a copy runs.
    let program = folder.path().join("takt");
    fs::copy(env!("CARGO_BIN_EXE_takt"), &program).unwrap();
    let mut command = if nix::unistd::geteuid().is_root() {
        let mut command = Command::new("setpriv");
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all", "prlimit"]);
        command
    } else {
        Command::new("prlimit")
    };
    command.args(["--rtprio=0:0", "--memlock=65536:65536"]).arg(&program);
    let output = command.args(["doctor", "--self-test-s", "0"]).stdin(Stdio::null()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["✗ SCHED_FIFO", "✗ locked memory", "! RLIMIT_RTPRIO", "! RLIMIT_MEMLOCK", "forbid real time"]
    {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn a_configuration_brings_its_own_period_priority_and_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let text = fs::read_to_string(example).unwrap();
    let path = folder.path().join("one.toml");
    let text = text.lines().filter(|line| !line.starts_with("period")).collect::<Vec<_>>().join("\n");
    assert!(!text.contains("[realtime]"));
    fs::write(&path, format!("{text}\n[realtime]\npriority = 60\ncpu = 0\n")).unwrap();
    let path = path.to_str().unwrap();
    let output = takt(&["--json", "--self-test-s", "0", path]).output().unwrap();
    let report = report(&output);
    assert_eq!((&report["priority"], &report["cpu"]), (&Value::from(60), &Value::from(0)));
    let checks = report["checks"].as_array().unwrap();
    let can: Vec<_> = checks.iter().filter(|check| check["group"] == "can").collect();
    assert_eq!(can.len(), 1);
    assert_eq!(
        can[0]["read"].as_str().unwrap().split(';').next(),
        Some("every bus of the configuration is simulated")
    );

    fs::write(path, "name = 1").unwrap();
    assert_eq!(takt(&[path]).output().unwrap().status.code(), Some(2));
    assert_eq!(takt(&["--self-test-s", "-1"]).output().unwrap().status.code(), Some(2));
}

#[test]
fn ctrl_c_cuts_the_self_test_short_and_ends_with_130_and_what_there_is() {
    let child = takt(&["--json", "--self-test-s", "600"]).spawn().unwrap();
    thread::sleep(Duration::from_millis(1_000));
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(report(&output)["self_test"]["is_whole"], false);
}
