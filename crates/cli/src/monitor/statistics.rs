//! Rates and load, in words and as an object.

use serde_json::json;
use takt_rt::Nanoseconds;

use super::watched_bus::WatchedBus;
use crate::table::Table;
use takt_tools::monitor::{BusStatistics, Decoded};

/// One bus in a sentence.
pub fn summary(bus: &WatchedBus, is_named: bool) -> String {
    let statistics = &bus.statistics;
    let frames = match statistics.frames() {
        1 => "1 frame".to_owned(),
        frames => format!("{frames} frames"),
    };
    let mut words = if is_named { format!("bus `{}`: {frames}", bus.name) } else { frames };
    if let (Some(rate), Some(load)) = (statistics.rate(), statistics.load()) {
        let seconds = statistics.duration_ns() as f64 / 1e9;
        words.push_str(&format!(" in {seconds:.3} s, {rate:.1} frames/s, bus load {}", percent(load)));
        if let Some(busiest) = statistics.busiest() {
            words.push_str(&format!(" (busiest 0.1 s: {})", percent(busiest)));
        }
    }
    words
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

fn of_interest(bus: &WatchedBus) -> impl Iterator<Item = (&takt_tools::monitor::IdStatistics, &Decoded)> {
    bus.statistics.ids().filter_map(|id| Some((id, bus.shown.get(&id.last.id().arbitration_key())?)))
}

/// The identifiers of each bus as a table.
pub fn text(buses: &[WatchedBus]) -> String {
    let mut text = String::new();
    for bus in buses {
        let mut table = Table::new(["id", ">frames", ">mean ms", ">shortest", ">longest", ">load %", "what"]);
        for (id, decoded) in of_interest(bus) {
            let share = share(&bus.statistics, id.busy_ns);
            let who = if decoded.who.is_empty() { String::new() } else { format!(" {}", decoded.who) };
            table.row([
                format!("{:?}", id.last.id()),
                id.frames.to_string(),
                milliseconds(id.mean_ns().filter(|_| id.frames > 1)),
                milliseconds(id.shortest_ns),
                milliseconds(id.longest_ns),
                share.map_or_else(String::new, |share| format!("{:.2}", share * 100.0)),
                format!("{}{who}", decoded.service.name()),
            ]);
        }
        text.push_str(&format!("{}\n\n{table}\n", summary(bus, buses.len() > 1)));
    }
    text
}

fn share(statistics: &BusStatistics, busy_ns: Nanoseconds) -> Option<f64> {
    let duration_ns = statistics.duration_ns();
    (duration_ns > 0).then(|| busy_ns as f64 / duration_ns as f64)
}

fn milliseconds(ns: Option<Nanoseconds>) -> String {
    ns.map_or_else(String::new, |ns| format!("{:.3}", ns as f64 / 1e6))
}

/// The identifiers of each bus as one JSON object, in a line.
pub fn json(buses: &[WatchedBus]) -> String {
    let buses: Vec<_> = buses
        .iter()
        .map(|bus| {
            let statistics = &bus.statistics;
            let ids: Vec<_> = of_interest(bus)
                .map(|(id, decoded)| {
                    json!({
                        "id": id.last.id().value(),
                        "extended": id.last.id().is_extended(),
                        "frames": id.frames,
                        "mean_ns": id.mean_ns().filter(|_| id.frames > 1),
                        "shortest_ns": id.shortest_ns,
                        "longest_ns": id.longest_ns,
                        "load": share(statistics, id.busy_ns),
                        "service": decoded.service.name(),
                        "node": decoded.node,
                        "who": decoded.who,
                    })
                })
                .collect();
            json!({
                "bus": bus.name,
                "frames": statistics.frames(),
                "duration_s": statistics.duration_ns() as f64 / 1e9,
                "rate": statistics.rate(),
                "load": statistics.load(),
                "busiest": statistics.busiest(),
                "ids": ids,
            })
        })
        .collect();
    format!("{}\n", json!({ "buses": buses }))
}
