//! What is fuzzed: each function takes any bytes, and fails only where a promise is broken. They run under libFuzzer (`fuzz_targets/`), and
//! over corpus, regressions and seeded mutations in the ordinary tests (`tests/fuzz.rs`).

use std::fs;
use std::path::{Path, PathBuf};

use govtwin_bag::import::suggest::{Known, suggest};
use govtwin_bag::import::{Import, ImportError, Map};
use govtwin_bag::msg::definition::{difference, parse_schema};
use govtwin_bag::msg::type_hash::hash_of;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState, TwinStatus};
use govtwin_bag::{ReadOptions, Rows, cdr};
use govtwin_correction::model::{Model, SCHEMA};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_files::digest::sha256;
use govtwin_lab::benchmark::scored_report::ScoredReport as _;
use govtwin_lab::labels;
use govtwin_model::effects::own::expression::Expression;
use govtwin_model::effects::own::names;
use govtwin_model::frame::Frame;
use govtwin_model::params;

/// A target: any bytes.
pub type Target = fn(&[u8]);

/// All of them by name.
pub const ALL: [(&str, Target); 11] = [
    ("bag", bag),
    ("layout", layout),
    ("metadata", metadata),
    ("cdr", message),
    ("definition", definition),
    ("yaml", yaml),
    ("expression", expression),
    ("model", model),
    ("report", report),
    ("journal", journal),
    ("import", import),
];

/// Memory instead of a disk where there is one.
fn scratch() -> Option<tempfile::TempDir> {
    let memory = Path::new("/dev/shm");
    let place = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    tempfile::tempdir_in(place).ok()
}

#[derive(Default)]
struct Count(usize, Option<i64>);

impl Rows for Count {
    fn restart(&mut self) {
        *self = Self::default();
    }

    fn row(&mut self, frame: &Frame) {
        assert!(self.1.is_none_or(|before_ns| before_ns < frame.time_ns), "rows rise in time");
        *self = Self(self.0 + 1, Some(frame.time_ns));
    }
}

fn read_all_ways(path: &Path) {
    let options = ReadOptions { required: vec![], ..ReadOptions::default() };
    let whole = govtwin_bag::read(path, &options);
    let mut rows = Count::default();
    let streamed = govtwin_bag::read_rows(path, &options, &mut rows);
    // Row by row there is what there is as a whole.
    match (whole, streamed) {
        (Ok(whole), Ok(health)) => {
            assert_eq!(whole.recording.frames.len(), rows.0);
            assert_eq!(format!("{:?}", whole.health), format!("{health:?}"));
        }
        (whole, streamed) => assert_eq!(whole.is_ok(), streamed.is_ok()),
    }
    if let Ok((survey, _)) = govtwin_bag::look(path, &options) {
        assert_eq!(survey.files.iter().map(|file| file.messages).sum::<u64>(), survey.messages);
    }
    if let Ok(messages) = govtwin_bag::messages(path) {
        let mut before_ns = i64::MIN;
        for message in messages.flatten() {
            assert!(before_ns <= message.log_time_ns, "messages come in log-time order");
            before_ns = message.log_time_ns;
        }
    }
}

/// Any bytes as an MCAP file. The magic is given, so that no run is spent on finding it.
pub fn bag(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let path = dir.path().join("a.mcap");
    if fs::write(&path, [b"\x89MCAP0\r\n", bytes].concat()).is_ok() {
        read_all_ways(&path);
    }
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn sized(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

/// A schema, a zero byte, and a message of it: walked along its layout.
pub fn layout(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (schema, message) = (&bytes[..end], bytes.get(end + 1..).unwrap_or_default());
    let schema = [&[1, 0][..], &sized(b"p/msg/A"), &sized(b"ros2msg"), &sized(schema)].concat();
    let channel = [&[0, 0, 1, 0][..], &sized(b"/a"), &sized(b"cdr"), &[0; 4]].concat();
    let message = [&[0; 22][..], &[0, 1, 0, 0], message].concat();
    let file = [b"\x89MCAP0\r\n".to_vec(), record(3, &schema), record(4, &channel), record(5, &message)].concat();
    let path = dir.path().join("a.mcap");
    if fs::write(&path, file).is_ok() {
        let survey = govtwin_bag::survey(&path).expect("a bag");
        let topic = survey.topics.iter().find(|topic| topic.name == "/a").expect("its topic");
        assert!(
            topic.fields.iter().map(|field| field.finite + field.nan + field.infinite).sum::<u64>()
                <= 8 * bytes.len() as u64 + 8
        );
    }
}

/// Any text as `metadata.yaml` beside a file.
pub fn metadata(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let written = fs::write(dir.path().join("metadata.yaml"), bytes)
        .and_then(|()| fs::write(dir.path().join("a_0.mcap"), b"\x89MCAP0\r\n"));
    if written.is_ok() {
        let _ = govtwin_bag::survey(dir.path());
        let _ = govtwin_bag::read(dir.path(), &ReadOptions::default());
    }
}

/// Any bytes as each message on the bus or in a bag: decoding ends with a result, and what was decoded encodes and decodes to itself.
pub fn message(bytes: &[u8]) {
    fn round<T: Interface>(bytes: &[u8]) {
        if let Ok(message) = cdr::decode::<T>(bytes) {
            let encoded = cdr::encode(&message).expect("what was decoded encodes");
            assert!(encoded.len() <= 2 * bytes.len() + 64, "no longer than it was");
            let again: T = cdr::decode(&encoded).expect("and decodes");
            assert_eq!(cdr::encode(&again).expect("and encodes"), encoded);
        }
    }
    round::<GovernorCommand>(bytes);
    round::<EsvState>(bytes);
    round::<ServoState>(bytes);
    round::<FluidPressure>(bytes);
    round::<JointState>(bytes);
    round::<TwinStatus>(bytes);
}

/// Any text as a message definition: parsed, hashed, compared.
pub fn definition(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(types) = parse_schema("a_msgs/msg/A", text) {
        assert_eq!(hash_of(&types).len(), "RIHS01_".len() + 64);
        assert_eq!(difference(&types, &types), None);
    }
}

fn in_file(dir: &Path, bytes: &[u8]) -> Option<PathBuf> {
    let path = dir.join("unit.yaml");
    fs::write(&path, bytes).ok()?;
    Some(path)
}

/// Any text as a parameter file, as effects of a user's own, and as labels.
pub fn yaml(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let Some(path) = in_file(dir.path(), bytes) else { return };
    if let Ok(sheet) = params::load_sheet(&path) {
        for entry in govtwin_model::parameters::ENTRIES {
            let value = (entry.get)(&sheet.unit.parameters);
            assert!((entry.min..=entry.max).contains(&value), "{} is {value}", entry.key);
        }
    }
    let _ = params::load_candidates(&path);
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = labels::read(text);
        let _ = labels::read_strengths(text);
    }
}

/// Any text as an expression in a plant's state: compiled, and computed without a panic.
pub fn expression(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let place = |name: &str| ["pressure_pa", "x", "y"].iter().position(|known| *known == name);
    if let Ok(expression) = Expression::new(text, &place) {
        for number in 0..3 {
            let values = names::sample(number);
            let _ = expression.value(|place| values[place]);
        }
        let _ = expression.value(|_| f64::NAN);
    }
}

/// Any text as a model file, as it stands and under a head with the right checksum.
pub fn model(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let body = text.trim_end_matches('\n');
    let body = body.split_once('\n').map_or(body, |(_, body)| body);
    let headed = format!("{{\"schema\":\"{SCHEMA}\",\"sha256\":\"{}\"}}\n{body}\n", sha256(body));
    for text in [text, &headed] {
        if let Ok(model) = Model::from_text(text) {
            let forest = model.forest().expect("it was checked");
            let features = model.features().expect("they were checked").len();
            for value in [0.0, 1e300, f64::NAN, f64::NEG_INFINITY] {
                let _ = forest.value(&vec![value; features]);
            }
            let _ = model.check(&params::reference(), model.opening);
            let _ = govtwin_correction::corrector::Corrector::new(&model);
        }
    }
}

/// Any text as a report of a diagnosis.
pub fn report(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(report) = DiagnosisReport::read(text) {
        let json = report.json();
        let again = DiagnosisReport::of_json(&json).unwrap();
        assert_eq!(again.json(), json);
        let (_, _, _) = (report.word(), report.leaves(), report.explained_fraction());
    }
}

/// Any text as a journal in a folder: nothing outside of the folder changes, and no file that has its name goes.
pub fn journal(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let folder = dir.path().join("out");
    let outside = dir.path().join("mine");
    let written = fs::create_dir(&folder)
        .and_then(|()| fs::write(&outside, "mine"))
        .and_then(|()| fs::write(folder.join(".govtwin.journal"), bytes));
    if written.is_ok() {
        let _ = govtwin_files::settle(&folder.join("report.json"));
        assert_eq!(fs::read_to_string(&outside).ok().as_deref(), Some("mine"));
        assert_eq!(fs::read_dir(dir.path()).map_or(0, Iterator::count), 2);
    }
}

/// A map, a zero byte, and a table: imported by the map, and by the one that is proposed for it. Every row is
/// counted, times that go back are told, and what is proposed with nothing open can be read as a map.
pub fn import(bytes: &[u8]) {
    let Some(dir) = scratch() else { return };
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(0);
    let (map, table) = (&bytes[..end], bytes.get(end + 1..).unwrap_or_default());
    let path = dir.path().join("table.csv");
    if fs::write(&path, table).is_err() {
        return;
    }
    let run = |map: &Map| {
        let (mut handed_on, mut warned_back, mut before_ns) = (0, false, i64::MIN);
        let mut on_row = |row: &govtwin_bag::import::ImportedRow| {
            handed_on += 1;
            warned_back |= row.time_ns < before_ns;
            before_ns = row.time_ns;
            Ok::<_, ImportError>(())
        };
        let outcome =
            Import::open(std::slice::from_ref(&path), map).and_then(|import| import.run(&mut on_row, &mut |_| {}));
        if let Ok(outcome) = outcome {
            assert_eq!(outcome.rows, handed_on, "every row is handed on and counted");
            assert!(!warned_back || !outcome.warnings.is_empty(), "times that go back are told");
        }
    };
    if let Some(map) = std::str::from_utf8(map).ok().and_then(|text| Map::parse(text, Path::new("map.yaml")).ok()) {
        run(&map);
    }
    if let Ok(proposed) = suggest(&path, &Known::default(), &mut |_| {}) {
        run(&proposed.map);
        let text = govtwin_bag::import::map_text(&proposed.map, &[], |_| String::new());
        if proposed.open.is_empty() && proposed.map.signals.iter().any(|signal| signal.place().is_some()) {
            Map::parse(&text, Path::new("map.yaml")).expect("what is proposed can be read");
        }
    }
}
