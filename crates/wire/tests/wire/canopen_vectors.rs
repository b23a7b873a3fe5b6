//! The frames that the manual prints. The encoders produce every host frame without a misprint, and the decoders read
//! every drive frame without a misprint.

use crate::rows::columns;
use takt_rt::{CommandSlot, Frame, Id, MappedObject, Mapping, ProcessImage};
use takt_wire::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{
    Completed, Expedited, SdoClient, SdoRequest, SdoResponse, SdoTiming, Transfer,
};

const VECTORS: &str = include_str!("../../../../tests/vectors/erob-can.csv");

struct Vector {
    id: String,
    is_from_host: bool,
    can_id: u16,
    data: Vec<u8>,
    node: u8,
    meaning: String,
    value: Option<i64>,
}

/// The CANopen rows without misprints.
fn vectors() -> Vec<Vector> {
    let rows = VECTORS.lines().skip(1).map(columns);
    let usable = rows.filter(|row| !row[8].starts_with("MISPRINT") && !row[3].starts_with("64"));
    let canopen = usable.filter(|row| !row[3].starts_with("5C"));
    canopen.map(|row| vector(&row)).collect()
}

fn vector(row: &[String]) -> Vector {
    Vector {
        id: row[0].clone(),
        is_from_host: row[2] == "host->drive",
        can_id: u16::from_str_radix(&row[3], 16).unwrap(),
        data: row[4].split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect(),
        node: row[5].parse().unwrap(),
        meaning: row[6].clone(),
        value: row[7].parse().ok(),
    }
}

impl Vector {
    fn frame(&self) -> Frame {
        Frame::data(Id::base(self.can_id.into()).unwrap(), &self.data).unwrap()
    }

    /// The object in the description of the row: `SDO download 6060:00 …`.
    fn object(&self) -> ObjectAddress {
        let (index, rest) = self.meaning.split_once(':').unwrap();
        let index = u16::from_str_radix(index.rsplit(' ').next().unwrap(), 16).unwrap();
        ObjectAddress::new(index, u8::from_str_radix(&rest[..2], 16).unwrap())
    }

    fn value(&self) -> i64 {
        self.value.unwrap_or_else(|| panic!("{} has no value", self.id))
    }

    fn expedited(&self) -> Expedited {
        let length = if matches!(self.object().index, 0x6060 | 0x6061) { 1 } else { 4 };
        Expedited::of(&self.value().to_le_bytes()[..length]).unwrap()
    }

    /// The host's frame, encoded from the description of the row.
    fn encoded(&self) -> Frame {
        let node = NmtTarget::Node(self.node);
        match self.meaning.as_str() {
            "NMT stop remote node" => NmtCommand::Stop.frame(node),
            "NMT reset communication" => NmtCommand::ResetCommunication.frame(node),
            words if words.starts_with("SDO download") => {
                SdoRequest::DownloadExpedited { object: self.object(), data: self.expedited() }
                    .frame(self.node)
            }
            words if words.starts_with("SDO upload request") => {
                SdoRequest::Upload { object: self.object() }.frame(self.node)
            }
            words if words.starts_with("RPDO1 controlword 0x") => self.process_data(),
            words => panic!("{}: {words}", self.id),
        }
    }

    fn process_data(&self) -> Frame {
        let objects = [MappedObject::new(0x6040, 0, 16), MappedObject::new(0x607A, 0, 32)];
        let mapping = Mapping::commands(&objects).unwrap();
        let controlword = &self.meaning["RPDO1 controlword 0x".len()..][..4];
        let mut image = ProcessImage::default();
        image.set(CommandSlot::Controlword, i32::from_str_radix(controlword, 16).unwrap());
        image.set(CommandSlot::TargetPosition, self.value().try_into().unwrap());
        let payload = mapping.pack(&image);
        Frame::data(Id::canopen(0x200, self.node), &payload[..mapping.length()]).unwrap()
    }
}

#[test]
fn the_encoders_produce_every_frame_of_the_host() {
    let rows: Vec<Vector> = vectors().into_iter().filter(|row| row.is_from_host).collect();
    assert_eq!(rows.len(), 59);
    for row in rows {
        assert_eq!(row.encoded(), row.frame(), "{}: {}", row.id, row.meaning);
    }
}

#[test]
fn the_decoders_read_every_frame_of_the_drive() {
    let rows: Vec<Vector> = vectors().into_iter().filter(|row| !row.is_from_host).collect();
    assert_eq!(rows.len(), 41);
    for row in rows {
        if row.can_id & 0x780 == 0x700 {
            let boot_up = ErrorControl { node: row.node, state: NmtState::BootUp };
            assert_eq!(ErrorControl::decode(&row.frame()), Some(boot_up), "{}", row.id);
            continue;
        }
        let response = match row.meaning.starts_with("SDO download response") {
            true => SdoResponse::DownloadAccepted { object: row.object() },
            false => SdoResponse::UploadExpedited { object: row.object(), data: row.expedited() },
        };
        assert_eq!(
            SdoResponse::decode(&row.frame()),
            Some((row.node, response)),
            "{}: {}",
            row.id,
            row.meaning
        );
    }
}

#[test]
fn a_simulated_drive_answers_the_manuals_requests_with_the_printed_bytes() {
    for row in vectors().into_iter().filter(|row| matches!(row.can_id & 0x780, 0x000 | 0x580 | 0x600)) {
        let frame = row.frame();
        let again = match row.can_id & 0x780 {
            0x000 => NmtCommand::decode(&frame).map(|(command, target)| command.frame(target)),
            0x580 => SdoResponse::decode(&frame).map(|(node, response)| response.frame(node)),
            _ => SdoRequest::decode(&frame).map(|(node, request)| request.frame(node)),
        };
        assert_eq!(again, Some(frame), "{}: {}", row.id, row.meaning);
    }
}

#[test]
fn the_client_performs_every_exchange_that_the_manual_prints_in_full() {
    let rows = vectors();
    let mut exchanges = 0;
    for (request, response) in rows.iter().zip(rows.iter().skip(1)) {
        if request.can_id & 0x780 != 0x600 || response.can_id & 0x780 != 0x580 {
            continue;
        }
        let mut client = SdoClient::new(request.node, SdoTiming::default());
        let object = request.object();
        let transfer = match request.meaning.starts_with("SDO download") {
            true => Transfer::Download { object, data: request.expedited().bytes().into() },
            false => Transfer::Upload { object },
        };
        client.start(transfer).unwrap();
        assert_eq!(client.poll(0), Some(request.frame()), "{}", request.id);
        client.receive(&response.frame());
        match client.take_outcome() {
            Some(Ok(Completed::Downloaded)) => assert_eq!(response.value, None),
            Some(Ok(Completed::Uploaded(uploaded))) => {
                assert_eq!(uploaded.bytes, response.expedited().bytes(), "{}", response.id);
            }
            other => panic!("{}: {other:?}", request.id),
        }
        exchanges += 1;
    }
    assert_eq!(exchanges, 34);
}
