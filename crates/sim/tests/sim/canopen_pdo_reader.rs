//! The PDO configuration is read from a device, and process data is decoded with it.

use std::path::Path;

use takt::sim::cia402::Cia402Parameters;
use takt::sim::{SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_wire::canopen::eds;
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;
use takt_wire::canopen::pdo_reader::{PdoReadError, PdoReader};
use takt_wire::canopen::sdo::{Completed, Expedited, SdoClient, SdoError, SdoRequest, SdoTiming, Transfer};

use super::bench::{MILLISECOND_NS, NODE, drive, parameters};

struct Bench {
    bus: SimulatedBus,
    now_ns: u64,
}

impl Bench {
    fn new() -> Self {
        let drive = drive(Cia402Parameters { power_up_ns: MILLISECOND_NS, ..parameters(NODE) });
        let rates = WireBitRates { nominal: 1_000_000, data: None };
        let mut bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive)]);
        bus.send(0, &[]);
        let mut bench = Self { bus, now_ns: 0 };
        bench.pass(10);
        bench
    }

    /// Lets milliseconds pass and returns the received frames.
    fn pass(&mut self, milliseconds: u64) -> Vec<Frame> {
        let mut received = vec![];
        let mut batch = ReceiveBatch::new();
        for _ in 0..milliseconds {
            self.now_ns += MILLISECOND_NS;
            self.bus.receive(self.now_ns, &mut batch);
            received.extend(batch.drain(..).map(|received| received.frame));
        }
        received
    }

    /// Uploads what the reader asks for.
    fn ask(&mut self, node: u8, mut reader: PdoReader) -> Result<Vec<PdoConfiguration>, PdoReadError> {
        let mut client = SdoClient::new(node, SdoTiming::default());
        for _ in 0..10_000 {
            if let Some(outcome) = reader.outcome() {
                return outcome;
            }
            if let (false, Some(object)) = (client.is_busy(), reader.question()) {
                client.start(Transfer::Upload { object }).unwrap();
            }
            while let Some(frame) = client.poll(self.now_ns) {
                self.bus.send(self.now_ns, &[frame]);
            }
            for frame in self.pass(1) {
                client.receive(&frame);
            }
            if let Some(outcome) = client.take_outcome() {
                reader.answer(outcome.map(|completed| match completed {
                    Completed::Uploaded(uploaded) => uploaded,
                    Completed::Downloaded => panic!("it was an upload"),
                }));
            }
        }
        panic!("no end after 10 s");
    }
}

#[test]
fn the_drive_reports_the_configuration_of_its_eds() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/eds/erob-canopen.eds");
    let described = eds::load(&path).unwrap().dictionary.pdos(Some(NODE));
    let reported = Bench::new().ask(NODE, PdoReader::of_four(1)).unwrap();
    assert_eq!(reported.len(), 8);
    for (reported, described) in reported.iter().zip(&described) {
        // The EDS leaves these open.
        let described =
            PdoConfiguration { inhibit_time_100us: Some(0), event_timer_ms: Some(0), ..described.clone() };
        assert_eq!(*reported, described);
    }
}

#[test]
fn process_data_is_decoded_by_the_reported_mapping() {
    let mut bench = Bench::new();
    // TPDO2 of the drive contains 6041 and 6064. It is enabled and the drive is set operational.
    for (subindex, value) in [(1, &0x285_u32.to_le_bytes()[..]), (2, &[1])] {
        let object = ObjectAddress::new(0x1801, subindex);
        let data = Expedited::of(value).unwrap();
        bench.bus.send(bench.now_ns, &[SdoRequest::DownloadExpedited { object, data }.frame(NODE)]);
        bench.pass(5);
    }
    bench.bus.send(bench.now_ns, &[Frame::of(Id::canopen(0, 0), [1, NODE])]);
    bench.pass(5);
    let reader = PdoReader::new([(PdoDirection::Transmit, 2)]);
    let tpdo2 = bench.ask(NODE, reader).unwrap().remove(0);
    assert_eq!((tpdo2.is_valid, tpdo2.length()), (true, 6));
    bench.bus.send(bench.now_ns, &[Frame::of(Id::canopen(0x80, 0), [])]);
    let received = bench.pass(3);
    let values: Vec<_> = received.iter().filter_map(|frame| tpdo2.values(frame)).flatten().collect();
    let indices: Vec<u16> = values.iter().map(|(object, _)| object.index).collect();
    assert_eq!(indices, [0x6041, 0x6064], "{received:?}");
    assert_eq!(values[0].1 & 0x4F, 0x40, "switch on disabled");
    assert_eq!(values[1].1, 0, "at its initial position");
}

#[test]
fn missing_pdos_are_left_out_and_a_missing_reply_is_an_error() {
    let mut bench = Bench::new();
    let pdos = [(PdoDirection::Receive, 5), (PdoDirection::Receive, 2)];
    let reported = bench.ask(NODE, PdoReader::new(pdos)).unwrap();
    assert_eq!(reported.iter().map(|pdo| pdo.number).collect::<Vec<_>>(), [2]);
    let failure = bench.ask(9, PdoReader::of_four(1)).unwrap_err();
    assert_eq!(failure.object.to_string(), "1400:00");
    assert!(matches!(failure.error, SdoError::NoReply { .. }));
}
