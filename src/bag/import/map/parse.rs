//! Reads a map, and says everything that is wrong in it at once.

use super::reader::{Pairs, Reader, with};
use super::{Map, Repeated, SignalMap, SignalPlace, TripRule};
use crate::import::convert::{UnitConversion, either_factor, plain, pressure, share, units_of};
use crate::import::lines::Between;
use crate::import::row::Target;
use crate::import::words::Words;
use govtwin_model::params::FileProblem;
use govtwin_model::params::yaml::{Node, get, parse as parse_yaml};

const TOP: Words = Words("name|source|file|time|signals|resample");
const FILE: Words =
    Words("separator|decimal|thousands|encoding|header_line|unit_line|first_line|missing|tag_column|value_column");
const TIME: Words = Words("column|columns|format|zone|start|rate_hz|repeated|stamp");
const SIGNAL: Words = Words(
    "column|field|constant|unit|scale|offset|range|to|sign|shutdown|latch|time|quality|good|between|deviation_percent",
);

pub(super) fn parse(text: &str) -> Result<Map, Vec<FileProblem>> {
    let document = parse_yaml(text)
        .map_err(|error| vec![FileProblem { line: error.line, key: String::new(), message: error.message }])?;
    let mut reader = Reader { document: &document, problems: vec![] };
    let map = reader.map();
    if reader.problems.is_empty() { Ok(map) } else { Err(reader.problems) }
}

impl<'a> Reader<'a> {
    fn map(&mut self) -> Map {
        let mut map = Map::default();
        let document = self.document;
        let top = self.pairs(&document.root, &[], TOP.all());
        map.name = self.text(top, &[], "name").unwrap_or_default();
        map.source = self.text(top, &[], "source").unwrap_or_default();
        if let Some(node) = get(top, "file") {
            self.file(node, &mut map);
        }
        if let Some(node) = get(top, "time") {
            self.time(node, &mut map);
        }
        if let Some(node) = get(top, "resample") {
            let pairs = self.pairs(node, &["resample"], ["rate_hz"].into_iter());
            map.resample_hz = self.positive(pairs, &["resample"], "rate_hz");
        }
        let ids = Target::ALL.map(Target::id);
        match get(top, "signals") {
            Some(node) => {
                for (key, node) in self.pairs(node, &["signals"], ids.into_iter()) {
                    if let Some(target) = Target::ALL.into_iter().find(|target| target.id() == key) {
                        let signal = self.signal(target, node);
                        map.signals.extend(signal);
                    }
                }
            }
            None => self.say(&[], format!("no `signals`: expected at least one of {}", ids.join(", "))),
        }
        if map.signals.iter().all(|signal| signal.place().is_none()) && self.problems.is_empty() {
            self.say(&["signals"], "expected at least one signal with a `column` or a `field`");
        }
        map
    }

    fn file(&mut self, node: &'a Node, map: &mut Map) {
        let path = &["file"];
        let pairs = self.pairs(node, path, FILE.all());
        map.file.separator =
            self.letter(pairs, path, "separator", "").and_then(|letter| u8::try_from(u32::from(letter)).ok());
        map.file.decimal = self.letter(pairs, path, "decimal", ".,");
        map.file.thousands = self.letter(pairs, path, "thousands", ".,' ");
        map.file.encoding = self.text(pairs, path, "encoding");
        map.file.header_line = self.line_number(pairs, path, "header_line");
        map.file.unit_line = self.line_number(pairs, path, "unit_line");
        map.file.first_line = self.line_number(pairs, path, "first_line");
        map.file.missing = self.texts(pairs, path, "missing");
        map.file.tag_column = self.text(pairs, path, "tag_column");
        map.file.value_column = self.text(pairs, path, "value_column");
        if map.file.tag_column.is_some() != map.file.value_column.is_some() {
            self.say(path, "expected `tag_column` and `value_column` together: a table with one value a line has both");
        }
        if map.file.decimal.is_some() && map.file.decimal == map.file.thousands {
            self.say(&["file", "thousands"], "decimals and thousands cannot have the same character");
        }
    }

    fn time(&mut self, node: &'a Node, map: &mut Map) {
        let path = &["time"];
        let pairs = self.pairs(node, path, TIME.all());
        map.time.columns = self.texts(pairs, path, "column");
        let columns = self.texts(pairs, path, "columns");
        if !map.time.columns.is_empty() && !columns.is_empty() {
            self.say(path, "give `column` or `columns`, not both");
        }
        map.time.columns.extend(columns);
        map.time.format = self.text(pairs, path, "format");
        map.time.zone = self.text(pairs, path, "zone");
        map.time.start = self.text(pairs, path, "start");
        map.time.rate_hz = self.positive(pairs, path, "rate_hz");
        match self.text(pairs, path, "repeated").as_deref() {
            None | Some("keep") => {}
            Some("spread") => map.time.repeated = Repeated::Spread,
            Some(other) => self.say(&with(path, "repeated"), format!("expected keep or spread, found `{other}`")),
        }
        match self.text(pairs, path, "stamp").as_deref() {
            None | Some("header") => {}
            Some("log") => map.time.by_log = true,
            Some(other) => self.say(&with(path, "stamp"), format!("expected header or log, found `{other}`")),
        }
        if map.time.rate_hz.is_some() && !map.time.columns.is_empty() {
            self.say(&with(path, "rate_hz"), "only for a file without a time column; leave it or the column out");
        }
    }

    fn signal(&mut self, target: Target, node: &'a Node) -> Option<SignalMap> {
        let path = &["signals", target.id()];
        let line = self.document.line(path);
        let blank = SignalMap { line, ..SignalMap::of_column(target, "") };
        // Short forms: `spool_position: "y, mm"` is a column, `esv: normal` a constant.
        match node {
            Node::Text(text) if target == Target::Esv && ["normal", "shutdown"].contains(&text.as_str()) => {
                return Some(SignalMap { from: SignalPlace::Constant(f64::from(u8::from(text == "normal"))), ..blank });
            }
            Node::Text(text) if target != Target::Esv => {
                let from = if text.starts_with('/') {
                    SignalPlace::Field(text.clone())
                } else {
                    SignalPlace::Column(text.clone())
                };
                return Some(SignalMap { from, ..blank });
            }
            Node::Map(_) => {}
            other => {
                let expected = if target == Target::Esv {
                    "`normal`, or `{column: …, shutdown: …}`"
                } else {
                    "the name of a column or field, or `{column: …, unit: …}`"
                };
                self.expected(path, expected, other);
                return None;
            }
        }
        let pairs = self.pairs(node, path, SIGNAL.all());
        let mut signal = blank;
        let constant = self.number(pairs, path, "constant");
        let column = self.text(pairs, path, "column").map(SignalPlace::Column);
        let places =
            [column, self.text(pairs, path, "field").map(SignalPlace::Field), constant.map(SignalPlace::Constant)];
        let mut places = places.into_iter().flatten();
        match (places.next(), places.next()) {
            (Some(from), None) => signal.from = from,
            _ if get(pairs, "constant").is_some() && constant.is_none() => {}
            _ => self.say(path, "expected one of `column`, `field`, `constant`"),
        }
        signal.unit = self.text(pairs, path, "unit").unwrap_or_default();
        signal.time = self.text(pairs, path, "time");
        signal.quality = self.text(pairs, path, "quality");
        signal.good = self.texts(pairs, path, "good");
        for (key, given) in [("time", signal.time.is_some()), ("quality", signal.quality.is_some())] {
            if given && !matches!(signal.from, SignalPlace::Column(_)) {
                self.say(&with(path, key), "names a column of a table, and this signal is none");
            }
        }
        match self.text(pairs, path, "between").as_deref() {
            None => {}
            Some("hold") => signal.between = Between::Hold,
            Some("line") => signal.between = Between::Line,
            Some(other) => self.say(&with(path, "between"), format!("expected hold or line, found `{other}`")),
        }
        signal.deviation_percent = self.number(pairs, path, "deviation_percent");
        if signal.deviation_percent.is_some_and(|percent| !(0.0..=100.0).contains(&percent)) {
            self.say(&with(path, "deviation_percent"), "expected 0 to 100 % of the stroke");
        }
        if (signal.between != Between::Found || signal.deviation_percent.is_some()) && target != Target::OpeningCommand
        {
            self.say(
                &with(path, "between"),
                "belongs to `opening_command` alone: what is measured stays where it was measured",
            );
        }
        if !signal.good.is_empty() && signal.quality.is_none() {
            self.say(&with(path, "good"), "needs `quality`, the column in which it stands");
        }
        if target == Target::Esv {
            self.event(pairs, path, &mut signal);
            return Some(signal);
        }
        for key in ["shutdown", "latch"] {
            if get(pairs, key).is_some() {
                self.say(&with(path, key), "belongs to `esv` alone");
            }
        }
        self.conversion(pairs, path, &mut signal);
        if let SignalPlace::Constant(value) = &mut signal.from {
            *value = signal.conversion.apply(*value);
        }
        Some(signal)
    }

    fn conversion(&mut self, pairs: &'a Pairs, path: &[&str], signal: &mut SignalMap) {
        let conversion = &mut signal.conversion;
        conversion.scale = self.number(pairs, path, "scale").unwrap_or(1.0);
        conversion.offset = self.number(pairs, path, "offset").unwrap_or(0.0);
        conversion.range = self.pair(pairs, path, "range");
        match self.number(pairs, path, "sign") {
            None | Some(1.0) => {}
            Some(-1.0) => conversion.turned = true,
            Some(other) => self.say(&with(path, "sign"), format!("expected 1 or -1, found {other}")),
        }
        if conversion.scale == 0.0 {
            self.say(&with(path, "scale"), "a scale of 0 leaves nothing of the signal");
        }
        if conversion.range.is_some_and(|[low, high]| low == high) {
            self.say(&with(path, "range"), "its two ends are the same");
            conversion.range = None;
        }
        let to = self.pair(pairs, path, "to");
        if to.is_some() && conversion.range.is_none() {
            self.say(&with(path, "to"), "needs a `range`, whose ends it gives a meaning");
        }
        let target = signal.target;
        let unit = if target.is_pressure() { pressure(&signal.unit) } else { share(&signal.unit) };
        match (conversion.range.is_some(), to) {
            (true, Some(to)) => conversion.to = to,
            (true, None) if target.is_pressure() => {
                let way = "say with `to: [0, 100]` which pressures the ends of `range` are, in the `unit`";
                return self.say(&with(path, "range"), way);
            }
            // The ends of the range are closed and open, whatever the transducer gives.
            (true, None) => return,
            (false, _) => {}
        }
        if let Some(unit) = unit {
            conversion.unit = unit;
        } else if signal.unit.is_empty() {
            // What a header states may still count; without it, the unit of the import.
            conversion.unit = UnitConversion::ONE;
        } else {
            let known = units_of(target);
            let problem = match either_factor(&signal.unit) {
                Some([first, other]) => format!("`{}` may mean {first} or {other}; give one of these", signal.unit),
                None => format!("`{}` is no unit of it that is known; expected one of {known}", plain(&signal.unit)),
            };
            self.say(&with(path, "unit"), problem);
        }
    }

    fn event(&mut self, pairs: &'a Pairs, path: &[&str], signal: &mut SignalMap) {
        for key in ["scale", "offset", "range", "to", "sign", "unit"] {
            if get(pairs, key).is_some() {
                self.say(&with(path, key), "the ESV has two states and no unit; say what means a trip with `shutdown`");
            }
        }
        signal.latch = self.text(pairs, path, "latch").is_some_and(|text| text == "true");
        let shutdown = self.texts(pairs, path, "shutdown");
        if shutdown.is_empty() && signal.place().is_some() {
            let way = "expected `shutdown`: what stands in the column when the unit has tripped, such as 1, TRIP or \"> 0.5\"";
            self.say(path, way);
        }
        for text in shutdown {
            let threshold = |rest: &str| rest.trim().parse::<f64>().ok().filter(|number| number.is_finite());
            let event = match text.trim().split_at_checked(1) {
                Some((">", rest)) => threshold(rest).map(TripRule::Above),
                Some(("<", rest)) => threshold(rest).map(TripRule::Below),
                _ => Some(TripRule::Is(text.trim().to_owned())),
            };
            match event {
                Some(event) => signal.shutdown.push(event),
                None => {
                    self.say(&with(path, "shutdown"), format!("expected a number behind `>` or `<`, found `{text}`"));
                }
            }
        }
    }
}
