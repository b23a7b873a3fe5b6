//! What `ip -details -statistics -json link show` says of CAN interfaces; without `ip`, what the kernel says itself.

use serde_json::Value;
use takt_rt::BusState;

use takt::link::{ControllerTiming, InterfaceStatus};

/// The bytes that the kernel hands an interface for CAN FD frames (`CANFD_MTU`); for classic ones they are 16.
const FD_MTU: u64 = 72;

/// A CAN interface as the kernel describes it. What is not told is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Link {
    pub name: String,
    /// True if it was brought up.
    pub is_up: bool,
    /// True if it carries CAN FD frames.
    pub has_fd: bool,
    /// `can`, `vcan`, `vxcan` …
    pub kind: Option<String>,
    pub queue_length: Option<u64>,
    pub queueing: Option<String>,
    /// The controller's state: `ERROR-ACTIVE`, `BUS-OFF` …
    pub state: Option<String>,
    pub restart_ms: Option<u64>,
    pub timing: Option<LinkTiming>,
    pub data_timing: Option<LinkTiming>,
    /// The driver's name for its controller.
    pub controller: Option<String>,
    /// The controller's error counters: transmit, receive.
    pub error_counters: Option<(u64, u64)>,
    /// What has happened since the interface is there, with the kernel's names; only what is not zero.
    pub events: Vec<(String, u64)>,
}

/// A bit timing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkTiming {
    /// Bit/s.
    pub bit_rate: u64,
    /// Where in the bit its level is sampled, 0 to 1.
    pub sample_point: f64,
}

impl Link {
    /// What the kernel tells over netlink without the help of `ip`: less.
    pub fn of_status(status: &InterfaceStatus, queue_length: Option<u64>) -> Self {
        let timing = |timing: ControllerTiming| LinkTiming {
            bit_rate: timing.bit_rate.into(),
            sample_point: timing.sample_point,
        };
        let state = match status.state {
            BusState::ErrorActive => "ERROR-ACTIVE",
            BusState::ErrorPassive => "ERROR-PASSIVE",
            BusState::BusOff => "BUS-OFF",
            BusState::Down => "STOPPED",
        };
        Self {
            name: status.name.clone(),
            is_up: status.is_up,
            has_fd: status.has_fd,
            queue_length,
            state: Some(state.to_owned()),
            restart_ms: status.restart_ms.map(Into::into),
            timing: status.timing.map(timing),
            data_timing: status.data_timing.map(timing),
            error_counters: status.error_counters.map(|(tx, rx)| (tx.into(), rx.into())),
            ..Self::default()
        }
    }
}

/// The CAN interfaces of the list. Text that is no list has none.
pub fn links(json: &str) -> Vec<Link> {
    let list: Vec<Value> = serde_json::from_str(json).unwrap_or_default();
    list.iter().filter(|entry| entry["link_type"] == "can").filter_map(link).collect()
}

fn link(entry: &Value) -> Option<Link> {
    let info = &entry["linkinfo"];
    let data = &info["info_data"];
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let counters = &data["berr_counter"];
    let has_flag =
        |name: &str| entry["flags"].as_array().is_some_and(|flags| flags.iter().any(|flag| flag == name));
    Some(Link {
        name: entry["ifname"].as_str()?.to_owned(),
        is_up: has_flag("UP"),
        has_fd: entry["mtu"] == FD_MTU,
        kind: text(&info["info_kind"]),
        queue_length: entry["txqlen"].as_u64(),
        queueing: text(&entry["qdisc"]),
        state: text(&data["state"]),
        restart_ms: data["restart_ms"].as_u64(),
        timing: timing(&data["bittiming"]),
        data_timing: timing(&data["data_bittiming"]),
        controller: text(&data["bittiming_const"]["name"]),
        error_counters: counters["tx"].as_u64().zip(counters["rx"].as_u64()),
        events: events(entry),
    })
}

/// `ip` writes the sample point as a text with three decimals; some versions write a number.
fn timing(value: &Value) -> Option<LinkTiming> {
    let bit_rate = value["bitrate"].as_u64().filter(|rate| *rate > 0)?;
    let sample_point = &value["sample_point"];
    let sample_point = sample_point.as_f64().or_else(|| sample_point.as_str()?.parse().ok())?;
    Some(LinkTiming { bit_rate, sample_point })
}

fn events(entry: &Value) -> Vec<(String, u64)> {
    let controller = entry["linkinfo"]["info_xstats"].as_object();
    let controller = controller.into_iter().flatten().map(|(name, count)| (name.replace('_', " "), count));
    let statistics = [("rx", "received"), ("tx", "sent")].into_iter().flat_map(|(key, way)| {
        let of_way = entry["stats64"][key].as_object().into_iter().flatten();
        of_way
            .filter(|(name, _)| matches!(name.as_str(), "dropped" | "over_errors" | "errors"))
            .map(move |(name, count)| (format!("{way}: {}", name.replace('_', " ")), count))
    });
    let counts = controller.chain(statistics).filter_map(|(name, count)| Some((name, count.as_u64()?)));
    counts.filter(|(_, count)| *count > 0).collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// An MCP2518FD on a Raspberry Pi, as iproute2 6.1 describes it.
    pub const MCP251XFD: &str = r#"[{"ifindex":1,"ifname":"lo","flags":["LOOPBACK","UP"],"mtu":65536,"qdisc":"noqueue","operstate":"UNKNOWN","link_type":"loopback"},
        {"ifindex":4,"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"mtu":72,"qdisc":"pfifo_fast","operstate":"UP","linkmode":"DEFAULT","group":"default","txqlen":10,"link_type":"can","promiscuity":0,
        "linkinfo":{"info_kind":"can","info_data":{"ctrlmode":["BERR-REPORTING","FD"],"state":"ERROR-ACTIVE","berr_counter":{"tx":0,"rx":3},"restart_ms":100,
        "bittiming":{"bitrate":1000000,"sample_point":"0.750","tq":25,"prop_seg":14,"phase_seg1":15,"phase_seg2":10,"sjw":1,"brp":1},
        "bittiming_const":{"name":"mcp251xfd","tseg1":{"min":2,"max":256}},
        "data_bittiming":{"bitrate":5000000,"sample_point":"0.750","tq":25},"clock":40000000},
        "info_xstats":{"restarts":0,"bus_error":12,"arbitration_lost":0,"error_warning":1,"error_passive":0,"bus_off":0}},
        "num_tx_queues":1,"parentbus":"spi","parentdev":"spi0.0",
        "stats64":{"rx":{"bytes":80,"packets":10,"errors":0,"dropped":0,"over_errors":2,"multicast":0},"tx":{"bytes":8,"packets":1,"errors":0,"dropped":0,"carrier_errors":0,"collisions":0}}}]"#;

    #[test]
    fn a_controller_is_described_with_all_that_ip_tells() {
        let links = links(MCP251XFD);
        let [can0] = links.as_slice() else { panic!("{links:?}") };
        assert_eq!((can0.name.as_str(), can0.is_up, can0.restart_ms), ("can0", true, Some(100)));
        assert_eq!(can0.timing, Some(LinkTiming { bit_rate: 1_000_000, sample_point: 0.75 }));
        assert_eq!(can0.data_timing.map(|timing| timing.bit_rate), Some(5_000_000));
        assert_eq!((can0.controller.as_deref(), can0.error_counters), (Some("mcp251xfd"), Some((0, 3))));
        let event = |name: &str, count| (name.to_owned(), count);
        assert_eq!(
            can0.events,
            [event("bus error", 12), event("error warning", 1), event("received: over errors", 2)]
        );
    }

    #[test]
    fn what_was_never_configured_has_no_bit_rate_and_what_is_virtual_has_no_controller() {
        let down = r#"[{"ifname":"can1","flags":["NOARP","ECHO"],"qdisc":"noop","txqlen":10,"link_type":"can",
            "linkinfo":{"info_kind":"can","info_data":{"state":"STOPPED","restart_ms":0,"bittiming":{"bitrate":0,"sample_point":"0.000"}}}},
            {"ifname":"vcan0","flags":["NOARP","UP","LOWER_UP"],"qdisc":"noqueue","txqlen":1000,"link_type":"can","linkinfo":{"info_kind":"vcan"}},
            {"ifname":"old0","link_type":"can","linkinfo":{"info_kind":"can","info_data":{"bittiming":{"bitrate":500000,"sample_point":0.875}}}},
            {"link_type":"can"}]"#;
        let links = links(down);
        let names: Vec<_> = links.iter().map(|link| link.name.as_str()).collect();
        assert_eq!(names, ["can1", "vcan0", "old0"]);
        assert_eq!((links[0].is_up, links[0].timing, links[0].restart_ms), (false, None, Some(0)));
        assert_eq!((links[1].state.as_deref(), links[1].kind.as_deref()), (None, Some("vcan")));
        assert_eq!(links[2].timing.map(|timing| timing.sample_point), Some(0.875));
    }

    #[test]
    fn the_kernels_own_answer_gives_the_same_picture_with_less_in_it() {
        let status = InterfaceStatus {
            name: "can0".to_owned(),
            is_up: true,
            has_fd: false,
            timing: Some(ControllerTiming { bit_rate: 1_000_000, sample_point: 0.75 }),
            data_timing: None,
            restart_ms: Some(100),
            state: BusState::ErrorPassive,
            error_counters: Some((128, 0)),
            has_controller: true,
            unfit_modes: vec![],
        };
        let link = Link::of_status(&status, Some(10));
        assert_eq!(link.timing, Some(LinkTiming { bit_rate: 1_000_000, sample_point: 0.75 }));
        assert_eq!((link.state.as_deref(), link.restart_ms), (Some("ERROR-PASSIVE"), Some(100)));
        assert_eq!((link.error_counters, link.queue_length), (Some((128, 0)), Some(10)));
    }

    #[test]
    fn what_is_no_list_has_no_interfaces() {
        for text in ["", "[]", "{}", "[1, null]", "2: can0: <NOARP,UP>"] {
            assert_eq!(links(text), [], "{text}");
        }
    }
}
