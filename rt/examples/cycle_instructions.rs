//! Runs a fixed number of cycles of the engine, or packs and unpacks PDOs, for counting instructions; see
//! `benches/instructions`.
//!
//! The first argument names the work: `cycle-AXES`, `replan-AXES`, `stream-AXES`, `trajectory-AXES`,
//! `callback-AXES`, `pack` or `unpack`. The second one says how often it is repeated. The difference between two repetition counts does not contain the start-up.

use std::hint::black_box;

use takt_rt::{CommandSlot, MappedObject, Mapping, ProcessImage};

#[path = "../tests/fixture/mod.rs"]
mod fixture;
#[path = "../tests/fixture/thinking.rs"]
mod thinking;

use thinking::Thinking;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [work, repetitions] = arguments.as_slice() else { usage() };
    let Ok(repetitions) = repetitions.parse::<u32>() else { usage() };
    let (name, axes) = work.split_once('-').unwrap_or((work, "1"));
    let Ok(axes) = axes.parse() else { usage() };
    match name {
        "cycle" | "replan" => cycles(axes, name == "replan", repetitions),
        "stream" => led_cycles(Thinking::streaming(axes), repetitions),
        "trajectory" => led_cycles(Thinking::executing(axes), repetitions),
        "callback" => led_cycles(Thinking::in_loop(axes), repetitions),
        "pack" => pack(repetitions),
        "unpack" => unpack(repetitions),
        _ => usage(),
    }
}

fn usage() -> ! {
    eprintln!(
        "usage: cycle_instructions cycle-AXES|replan-AXES|stream-AXES|trajectory-AXES|callback-AXES|pack|unpack REPETITIONS"
    );
    std::process::exit(2);
}

fn cycles(axes: usize, is_replanned: bool, repetitions: u32) {
    let mut thinking = Thinking::moving(axes);
    for _ in 0..repetitions {
        if is_replanned {
            thinking.replan();
        }
        black_box(thinking.cycle());
    }
}

fn led_cycles(mut thinking: Thinking, repetitions: u32) {
    for _ in 0..repetitions {
        black_box(thinking.cycle());
    }
}

fn pack(repetitions: u32) {
    let objects = [MappedObject::new(0x6040, 0, 16), MappedObject::new(0x607A, 0, 32)];
    let Ok(mapping) = Mapping::commands(&objects) else { return };
    let mut image = ProcessImage::default();
    for repetition in 0..repetitions {
        image.set(CommandSlot::TargetPosition, repetition as i32);
        black_box(mapping.pack(black_box(&image)));
    }
}

fn unpack(repetitions: u32) {
    let objects = [MappedObject::new(0x6041, 0, 16), MappedObject::new(0x6064, 0, 32)];
    let Ok(mapping) = Mapping::feedback(&objects) else { return };
    let mut image = ProcessImage::default();
    for repetition in 0..repetitions {
        let _ = black_box(mapping.unpack(black_box(repetition.into()), 6, &mut image));
    }
    black_box(&image);
}
