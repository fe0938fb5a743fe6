//! Speed of reading and writing bags: messages per second, and bytes of the decompressed bag per second.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_bag::{Qos, ReadOptions, Writer, WriterOptions};

/// Ten minutes of a bench at 100 Hz: 132,600 messages.
const STEPS: i64 = 60_000;
const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

/// Writes the recording and says how many messages it has.
fn write(folder: &std::path::Path) -> Result<u64, govtwin_bag::BagError> {
    let mut writer = Writer::create(folder, WriterOptions { mark: Some("bench"), ..WriterOptions::default() })?;
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR)?;
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT)?;
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR)?;
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR)?;
    let mut messages = 0;
    for step in 0..STEPS {
        let time_ns = BEGIN_NS + step * 10_000_000;
        let header = Header::at(time_ns);
        let opening = 0.5 + 0.3 * (step as f64 * 1e-3).sin();
        if step % 100 == 0 {
            writer.write(esv, time_ns, &EsvState { header: header.clone(), state: EsvState::NORMAL })?;
            messages += 1;
        }
        if step % 5 == 0 {
            let fluid_pressure = 4e6 + 1e4 * (step as f64 * 0.7).sin();
            writer.write(
                pressure,
                time_ns,
                &FluidPressure { header: header.clone(), fluid_pressure, variance: 0.0 },
            )?;
            messages += 1;
        }
        writer.write(command, time_ns, &GovernorCommand { header: header.clone(), opening })?;
        let state = ServoState {
            header,
            spool_position: 0.01 * (step as f64 * 0.1).cos(),
            servomotor_position: opening,
            pilot_valve_position: f64::NAN,
            control_pressure: 2e6 + step as f64,
        };
        writer.write(servo, time_ns, &state)?;
        messages += 2;
    }
    writer.finish()?;
    Ok(messages)
}

fn bags(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("run");
    let messages = write(&path).expect("a bag");
    let survey = govtwin_bag::survey(&path).expect("a bag");
    let bytes = survey.files.iter().map(|file| file.uncompressed_bytes).sum();

    let mut group = criterion.benchmark_group("bag, messages");
    group.sample_size(10).throughput(Throughput::Elements(messages));
    group.bench_function("write", |bencher| bencher.iter(|| write(&folder.path().join("again"))));
    group.bench_function("read", |bencher| bencher.iter(|| govtwin_bag::read(&path, &ReadOptions::default())));
    group.bench_function("messages", |bencher| bencher.iter(|| govtwin_bag::messages(&path).map(Iterator::count)));
    group.bench_function("survey", |bencher| bencher.iter(|| govtwin_bag::survey(&path)));
    group.finish();

    let mut group = criterion.benchmark_group("bag, bytes");
    group.sample_size(10).throughput(Throughput::Bytes(bytes));
    group.bench_function("read", |bencher| bencher.iter(|| govtwin_bag::read(&path, &ReadOptions::default())));
    // What `info` does, beside the least that any reader does: the mcap crate's own, which hands on each message and checks CRCs, and a
    // copy of the bytes with their CRC.
    group.bench_function("look", |bencher| bencher.iter(|| govtwin_bag::look(&path, &ReadOptions::default())));
    let packed = std::fs::read(&survey.files[0].path).expect("a file");
    group.bench_function("mcap crate", |bencher| {
        bencher.iter(|| mcap::MessageStream::new(&packed).expect("a bag").flatten().count());
    });
    let unpacked: Vec<u8> = packed.iter().copied().cycle().take(usize::try_from(bytes).unwrap_or_default()).collect();
    group.bench_function("copy and CRC", |bencher| {
        bencher.iter(|| crc32fast::hash(std::hint::black_box(&unpacked.clone())));
    });
    group.finish();
}

criterion_group!(benches, bags);
criterion_main!(benches);
