//! A dictionary as text.

use std::fmt::Write as _;

use super::view::{EntryView, ObjectView, PdoView, ValueView, View};
use crate::table::Table;

/// The whole text.
pub fn whole(view: &View) -> String {
    let mut text = heading(view);
    let _ = write!(text, "\nObjects\n{}", objects(&view.objects));
    if !view.pdos.is_empty() {
        let _ = write!(text, "\nPDOs{}\n{}", for_node(view.node), pdos(&view.pdos));
    }
    if !view.comments.is_empty() {
        text.push_str("\nComments\n");
        for line in &view.comments {
            let _ = writeln!(text, "  {line}");
        }
    }
    let entries: usize = view.objects.iter().map(|object| object.entries.len()).sum();
    let warnings = match view.warnings.len() {
        0 => String::new(),
        1 => ", 1 warning".to_owned(),
        count => format!(", {count} warnings"),
    };
    let _ = writeln!(text, "\n{} objects, {entries} entries{warnings}", view.objects.len());
    text
}

fn for_node(node: Option<u8>) -> String {
    node.map_or(" ($NODEID is not known: --node N says it)".to_owned(), |node| format!(" of node {node}"))
}

fn heading(view: &View) -> String {
    let (device, identity, file) = (&view.device, &view.identity, &view.file);
    let word = |text: &Option<String>| text.clone().unwrap_or_else(|| "?".to_owned());
    let pattern = |number: Option<u32>| number.map_or("?".to_owned(), |number| format!("0x{number:08X}"));
    let mut text = format!("{}: {}\n", word(&device.vendor_name), word(&device.product_name));
    if let Some(description) = &file.description {
        let _ = writeln!(text, "  {description}");
    }
    let _ = writeln!(
        text,
        "  device type {}, vendor {}, product {}, revision {}",
        pattern(identity.device_type),
        pattern(identity.vendor),
        pattern(identity.product),
        pattern(identity.revision)
    );
    let rates: Vec<String> = device.bit_rates.iter().map(|rate| (rate / 1000).to_string()).collect();
    if !rates.is_empty() {
        let _ = writeln!(text, "  bit rates {} kbit/s", rates.join(", "));
    }
    let mapping = match device.granularity {
        0 => "cannot be changed".to_owned(),
        bits => format!("in steps of {bits} bits"),
    };
    let _ = writeln!(text, "  PDO mapping {mapping}, {}LSS", if device.has_lss { "" } else { "no " });
    if file.is_configuration {
        let name = view.node_name.as_ref().map(|name| format!(" ({name})")).unwrap_or_default();
        let node = view.node.map_or("any node".to_owned(), |node| format!("node {node}"));
        let _ = writeln!(text, "  a configuration for {node}{name}");
    }
    text
}

fn objects(objects: &[ObjectView]) -> String {
    let mut table = Table::new(["object", "name", "type", "access", "PDO", ">value", ">low", ">high"]);
    let show = |value: &Option<ValueView>, entry: &EntryView| {
        value.as_ref().map(|value| value.show(entry.is_pattern)).unwrap_or_default()
    };
    for object in objects {
        let is_whole = matches!(object.entries.as_slice(), [entry] if entry.subindex == 0);
        if !is_whole {
            let empty = String::new;
            table.row([
                format!("{:04X}", object.index),
                object.name.clone(),
                object.object_type.to_owned(),
                empty(),
                empty(),
                empty(),
                empty(),
                empty(),
            ]);
        }
        for entry in &object.entries {
            let address = if is_whole {
                format!("{:04X}", object.index)
            } else {
                format!("    :{:02X}", entry.subindex)
            };
            let value = match &entry.configured {
                Some(value) => format!("{} *", value.show(entry.is_pattern)),
                None => show(&entry.default, entry),
            };
            table.row([
                address,
                entry.denotation.as_ref().unwrap_or(&entry.name).clone(),
                entry.data_type.clone().unwrap_or_else(|| "?".to_owned()),
                entry.access.to_owned(),
                if entry.is_mappable { "yes" } else { "" }.to_owned(),
                value,
                show(&entry.low, entry),
                show(&entry.high, entry),
            ]);
        }
    }
    let is_configured =
        objects.iter().flat_map(|object| &object.entries).any(|entry| entry.configured.is_some());
    let note = if is_configured { "  * configured; the other values are defaults\n" } else { "" };
    format!("{table}{note}")
}

fn pdos(pdos: &[PdoView]) -> String {
    let mut table = Table::new(["PDO", "id", ">type", ">bytes", "carries"]);
    for pdo in pdos {
        let id = match pdo.id {
            Some(id) if pdo.is_valid => format!("0x{id:03X}"),
            Some(id) => format!("0x{id:03X} off"),
            None => "?".to_owned(),
        };
        let carries: Vec<String> = pdo
            .objects
            .iter()
            .map(|mapped| {
                let name = mapped.name.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
                format!("{:04X}:{:02X}{name} ({})", mapped.index, mapped.subindex, mapped.bits)
            })
            .collect();
        table.row([
            format!("{}{}", pdo.direction, pdo.number),
            id,
            pdo.transmission_type.map_or("?".to_owned(), |kind| kind.to_string()),
            pdo.bytes.to_string(),
            carries.join(", "),
        ]);
    }
    table.to_string()
}
