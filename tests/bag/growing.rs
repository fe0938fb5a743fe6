//! Bags that grow: whatever the steps, the rows are those of the whole, every byte is read about once, and another bag is noticed.

use std::fs;
use std::path::Path;

use govtwin_bag::msg::EsvState;
use govtwin_bag::{Growing, Grown, Interpolation, ReadOptions, Stream};
use rand::{RngExt as _, SeedableRng as _};

use super::make::{All, BEGIN_NS, Bag, MS, small_chunks};

/// Bytes that a look at a file reads again: to know it, to be known the next time, and the head of a record that is not whole.
const AGAIN_BYTES: u64 = 2 * (1 << 12) + 9;

fn options() -> ReadOptions {
    ReadOptions {
        interpolation: Interpolation::Sharp { period_ns: MS },
        required: vec![Stream::ServoState],
        ..ReadOptions::default()
    }
}

/// Command and servo each 200 ms with a bend now and then, pressure each `pressure_s`, the ESV at the beginning and at a trip.
fn slow(seconds: i64, pressure_s: Option<i64>) -> Bag {
    let mut bag = Bag::default();
    bag.esv(BEGIN_NS, EsvState::NORMAL);
    for step in 0..seconds * 5 {
        let at_ns = BEGIN_NS + step * 200 * MS;
        let time_s = step as f64 * 0.2;
        let opening = 0.5 + 0.1 * ((time_s - 7.13).max(0.0) - (time_s - 9.47).max(0.0)).min(3.0);
        if pressure_s.is_some_and(|pressure_s| step % (5 * pressure_s) == 0) {
            bag.pressure(at_ns, 4.0e6 + 1e4 * time_s);
        }
        bag.command(at_ns, opening);
        bag.servo(at_ns + 3 * MS, 0.01 * time_s.cos(), opening);
        if step == seconds * 4 {
            bag.esv(at_ns + 77 * MS, EsvState::SHUTDOWN);
        }
    }
    bag
}

/// The standard bag with messages that come late and twice.
fn untidy() -> Bag {
    let mut bag = Bag::standard(90);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    for place in (10..bag.entries.len()).rev() {
        if random.random_bool(0.02) {
            bag.entries.swap(place, place - 1);
            let log_ns = bag.entries[place - 1].log_ns.min(bag.entries[place].log_ns);
            (bag.entries[place - 1].log_ns, bag.entries[place].log_ns) = (log_ns, log_ns);
        }
        if random.random_bool(0.01) {
            let again = bag.entries[place].clone();
            bag.entries.insert(place, again);
        }
    }
    bag
}

/// Reads a file in random steps; the rows, and the bytes that were read.
fn in_steps(path: &Path, bytes: &[u8], options: ReadOptions, most: usize, seed: u64) -> (All, u64, u64) {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let (mut growing, mut rows, mut len, mut looks) = (Growing::new(options), All::default(), 0, 0);
    while len < bytes.len() {
        len = (len + random.random_range(1..most)).min(bytes.len());
        append(path, &bytes[..len]);
        looks += 1;
        match growing.more(path, len == bytes.len(), &mut rows) {
            Ok(grown) => assert_eq!(grown, Grown::Rows, "after {len} bytes"),
            // A file whose first bytes are still to come is none.
            Err(error) => assert!(len < 8, "after {len} bytes: {error}"),
        }
    }
    (rows, growing.read_bytes(), looks)
}

/// Makes a file longer, as a recorder does: its number stays.
fn append(path: &Path, bytes: &[u8]) {
    use std::io::Write as _;
    let have = path.metadata().map_or(0, |data| data.len()) as usize;
    let mut file = fs::OpenOptions::new().create(true).append(true).open(path).unwrap();
    file.write_all(&bytes[have..]).unwrap();
}

#[test]
fn the_rows_are_those_of_the_whole_whatever_the_steps() {
    for (what, made) in [
        ("standard", Bag::standard(80)),
        ("untidy", untidy()),
        ("slow", slow(100, Some(1))),
        ("slow pressure", slow(100, Some(25))),
        ("no pressure", slow(100, None)),
    ] {
        let bytes = made.bytes(small_chunks());
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("whole.mcap");
        fs::write(&path, &bytes).unwrap();
        let whole = govtwin_bag::read(&path, &options()).unwrap().recording.frames;
        assert!(whole.len() > 70_000, "{what}: {}", whole.len());
        for (seed, most) in [(1, bytes.len() / 40), (2, bytes.len() / 4), (3, 2 * bytes.len())] {
            let path = dir.path().join(format!("{seed}.mcap"));
            let (rows, read_bytes, looks) = in_steps(&path, &bytes, options(), most, seed);
            // As text, in which NaN is NaN.
            assert!(format!("{:?}", rows.frames) == format!("{whole:?}"), "{what} in {looks} looks: rows differ");
            let once = bytes.len() as u64 + looks * AGAIN_BYTES;
            // Who has no pressure is found out after half a minute, and is read again once; each look may meet half a record.
            let most = if what == "no pressure" { 2 * once } else { once };
            assert!(read_bytes <= most, "{what}: {read_bytes} bytes read of {} in {looks} looks", bytes.len());
        }
    }
}

#[test]
fn straight_inputs_and_such_that_hold_grow_as_well() {
    for (what, made) in [("slow", slow(100, Some(1))), ("no pressure", slow(60, None))] {
        let bytes = made.bytes(small_chunks());
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("whole.mcap");
        fs::write(&path, &bytes).unwrap();
        for (seed, interpolation) in [(1, Interpolation::Hold), (2, Interpolation::Linear { period_ns: MS })] {
            let options = ReadOptions { interpolation, ..options() };
            let whole = govtwin_bag::read(&path, &options).unwrap().recording.frames;
            let path = dir.path().join(format!("{seed}.mcap"));
            let (rows, ..) = in_steps(&path, &bytes, options, bytes.len() / 9, seed);
            assert!(format!("{:?}", rows.frames) == format!("{whole:?}"), "{what}, {interpolation:?}: rows differ");
        }
    }
}

#[test]
fn a_row_waits_for_a_silent_stream_for_a_minute_and_no_longer() {
    let bytes = slow(200, Some(90)).bytes(small_chunks());
    let dir = tempfile::tempdir().unwrap();
    let rows = [bytes.len() / 50, 2 * bytes.len()]
        .map(|most| in_steps(&dir.path().join(most.to_string()), &bytes, options(), most, 4).0.frames);
    assert!(format!("{:?}", rows[0]) == format!("{:?}", rows[1]), "the steps make no difference");
    let at = |time_s: i64| rows[0].iter().find(|row| row.time_ns == BEGIN_NS + time_s * 1000 * MS).unwrap().inputs;
    assert_eq!(at(20).tank_pressure_pa, 4.0e6, "held");
    assert!((at(60).tank_pressure_pa - 4.6e6).abs() < 1.0, "on the line to the next");
}

type Change = fn(&Path, &[u8]);

#[test]
fn another_bag_in_its_place_is_read_anew() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    let (first, second) = (slow(60, Some(1)).bytes(small_chunks()), Bag::standard(60).bytes(small_chunks()));
    let whole = |bytes: &[u8]| {
        let path = dir.path().join("whole.mcap");
        fs::write(&path, bytes).unwrap();
        format!("{:?}", govtwin_bag::read(&path, &options()).unwrap().recording.frames)
    };
    let changes: [(&str, Change); 3] = [
        ("renamed over it", |path, bytes| {
            fs::write(path.with_extension("new"), bytes).unwrap();
            fs::rename(path.with_extension("new"), path).unwrap();
        }),
        ("written over it", |path, bytes| fs::write(path, bytes).unwrap()),
        ("removed and written", |path, bytes| {
            fs::remove_file(path).unwrap();
            fs::write(path, bytes).unwrap();
        }),
    ];
    for (what, change) in changes {
        for (before, after) in [(&first, &second), (&second, &first)] {
            let _ = fs::remove_file(&path);
            append(&path, &before[..before.len() * 2 / 3]);
            let (mut growing, mut rows) = (Growing::new(options()), All::default());
            assert_eq!(growing.more(&path, false, &mut rows).unwrap(), Grown::Rows);
            assert!(growing.is_at(&path) && rows.frames.len() > 10_000, "{what}");
            rows.restarted = false;
            change(&path, after);
            assert!(!growing.is_at(&path), "{what}");
            assert_eq!(growing.more(&path, true, &mut rows).unwrap(), Grown::Rows);
            assert!(rows.restarted && format!("{:?}", rows.frames) == whole(after), "{what}");
        }
    }
    // One that lost its end, and one that took its name when it was whole.
    fs::remove_file(&path).unwrap();
    append(&path, &first[..first.len() / 2]);
    let (mut growing, mut rows) = (Growing::new(options()), All::default());
    growing.more(&path, false, &mut rows).unwrap();
    let place = dir.path().join("b.mcap");
    fs::rename(&path, &place).unwrap();
    append(&place, &first);
    rows.restarted = false;
    assert!(growing.is_at(&place));
    assert_eq!(growing.more(&place, true, &mut rows).unwrap(), Grown::Rows);
    assert!(!rows.restarted && format!("{:?}", rows.frames) == whole(&first), "read on under its new name");
    let (mut growing, mut rows) = (Growing::new(options()), All::default());
    growing.more(&place, false, &mut rows).unwrap();
    fs::File::options().write(true).open(&place).unwrap().set_len(first.len() as u64 / 3).unwrap();
    assert!(!growing.is_at(&place));
    growing.more(&place, true, &mut rows).unwrap();
    assert!(rows.restarted && format!("{:?}", rows.frames) == whole(&first[..first.len() / 3]));
}

#[test]
fn a_bag_in_several_files_is_followed_from_one_into_the_next() {
    let made = Bag::standard(80);
    let (first, second) = made.entries.split_at(made.entries.len() / 3);
    let bytes = [first, second].map(|entries| Bag { entries: entries.to_vec() }.bytes(small_chunks()));
    let dir = tempfile::tempdir().unwrap();
    let (mut growing, mut rows) = (Growing::new(options()), All::default());
    let path = |number: usize| dir.path().join(format!("bag_{number}.mcap"));
    for (number, bytes) in bytes.iter().enumerate() {
        for share in [1, 2] {
            append(&path(number), &bytes[..bytes.len() * share / 2]);
            assert_eq!(growing.more(dir.path(), (number, share) == (1, 2), &mut rows).unwrap(), Grown::Rows);
        }
    }
    let whole = govtwin_bag::read(dir.path(), &options()).unwrap().recording.frames;
    assert!(format!("{:?}", rows.frames) == format!("{whole:?}"));
    let all = (bytes[0].len() + bytes[1].len()) as u64;
    assert!(growing.read_bytes() <= all + 6 * AGAIN_BYTES, "{} of {all}", growing.read_bytes());
}

#[test]
fn what_needs_all_of_its_samples_is_left_to_who_reads_all() {
    let mut back = Bag::standard(40);
    let shift =
        |entries: &mut [super::make::Entry]| entries.iter_mut().for_each(|entry| entry.log_ns += 3_000_000 * MS);
    let half = back.entries.len() / 2;
    shift(&mut back.entries[half..]);
    let mut none = Bag::standard(10);
    none.entries.retain(|entry| !entry.topic.ends_with("servo_state"));
    for (what, made) in [("a clock that is set", back), ("no servo state", none)] {
        let (_dir, path) = made.file(small_chunks());
        let grown = Growing::new(options()).more(&path, true, &mut All::default()).unwrap();
        assert_eq!(grown, Grown::NeedsAll, "{what}");
    }
    assert!(Growing::new(options()).more(Path::new("/nowhere/a.mcap"), true, &mut All::default()).is_err());
}

#[test]
fn damage_amid_a_bag_that_grows_is_passed_over_as_in_one_that_is_whole() {
    let mut bytes = Bag::standard(80).bytes(small_chunks());
    let middle = bytes.len() / 3;
    bytes[middle..middle + 5000].fill(0);
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("whole.mcap"), &bytes).unwrap();
    let whole = govtwin_bag::read(&dir.path().join("whole.mcap"), &options()).unwrap().recording.frames;
    let (rows, ..) = in_steps(&dir.path().join("grown.mcap"), &bytes, options(), bytes.len() / 7, 9);
    assert!(format!("{:?}", rows.frames) == format!("{whole:?}"));
}

struct Count(u64);

impl govtwin_bag::Rows for Count {
    fn restart(&mut self) {
        self.0 = 0;
    }

    fn row(&mut self, _: &govtwin_model::frame::Frame) {
        self.0 += 1;
    }
}

#[test]
fn a_shift_of_eight_hours_is_no_recording_too_long() {
    let (_dir, path) = slow(8 * 3600, Some(1)).file(small_chunks());
    let refused = govtwin_bag::read(&path, &options()).unwrap_err().to_string();
    assert!(refused.contains("rows"), "{refused}");
    let mut rows = Count(0);
    assert_eq!(Growing::new(options()).more(&path, true, &mut rows).unwrap(), Grown::Rows);
    assert!(rows.0 > 28_000_000, "{}", rows.0);
}
