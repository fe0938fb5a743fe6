//! What there is to say of a table once it is read.

use super::super::SourceNotes;
use super::super::head::hint;
use super::super::records::TableRecords;
use super::TableSource;
use crate::import::stated::SeveralUnits;
use govtwin_model::units::seconds_from_nanos;

impl<R: TableRecords> TableSource<R> {
    /// How it was understood, and what a user should look into.
    pub(super) fn notes(&self) -> SourceNotes {
        let path = self.head.path.display();
        let mut said = SourceNotes { notes: self.head.notes.clone(), warnings: self.warnings.clone() };
        if self.order.newest_first {
            said.notes.push("its newest row stands first; rows are put in the order of time".to_owned());
        }
        if self.order.jumps > 0 {
            said.notes.push(format!(
                "time goes back {} times, each time to where there are no other rows; rows are put in the order of time",
                self.order.jumps
            ));
        }
        if self.order.late > 0 {
            said.warnings.push(format!(
                "time goes back {} times, by up to {:.3} s, to where there are rows already; rows are put in the order of time, and of two values \
                 for one time the later one counts",
                self.order.late,
                seconds_from_nanos(self.order.most_late_ns)
            ));
        }
        for one in said.notes.iter_mut().chain(&mut said.warnings) {
            *one = format!("{path}: {one}");
        }
        if let Some((line, _)) = &self.bad_times.first {
            let (count, problem) = (self.bad_times.count, &self.first_bad_time);
            said.warnings.push(format!("{path}:{line}: {count} lines left out, the first because {problem}"));
        }
        if let Some((line, text)) = &self.records.ragged().first {
            let count = self.records.ragged().count;
            said.warnings
                .push(format!("{path}:{line}: {count} lines left out that have too few cells, the first `{text}`"));
        }
        for column in &self.columns {
            let (id, place) = (column.channel.map.target.id(), column.channel.map.place().unwrap_or_default());
            if let Some((line, text)) = &column.channel.bad.first {
                let count = column.channel.bad.count;
                let hint = hint(text, &self.head.numbers);
                said.warnings.push(format!(
                    "{path}:{line}: {id} (`{place}`): {count} cells are no numbers, the first `{text}`{hint}"
                ));
            }
            if let Some((line, text)) = &column.channel.broken.first {
                let count = column.channel.broken.count;
                said.warnings.push(format!(
                    "{path}:{line}: {id} (`{place}`): {count} values left out outside of 3.6 to 21 mA, by which a transmitter of 4 to 20 mA \
                     says that it is broken (NAMUR NE 43), the first {text} mA"
                ));
            }
            if let Some(doubt) = column.channel.several.as_ref().and_then(SeveralUnits::doubt) {
                let map = &column.channel.map;
                let taken = if map.unit.is_empty() { map.target.unit() } else { &map.unit };
                said.warnings.push(format!(
                    "{path}: {id} (`{place}`): {doubt}; taken as {taken}; say which with `unit`, or with `range` (and `to`), in the map"
                ));
            }
            if let Some(states) = column.channel.never_trips() {
                said.warnings.push(format!(
                    "{path}: {id} (`{place}`) {states}: taken as never tripped; list what means a trip under `shutdown` in the map"
                ));
            }
            if let Some((index, _)) = column.quality.as_ref().filter(|_| column.not_good > 0) {
                said.notes.push(format!(
                    "{path}: {id} (`{place}`): {} values left out that `{}` does not call good",
                    column.not_good, self.head.names[*index]
                ));
            }
        }
        let clocks = || self.times.iter().map(|group| &group.clock);
        let folded: u64 = clocks().map(|clock| clock.folded).sum();
        if folded > 0 {
            said.warnings.push(format!(
                "{path}: {folded} times lie in the hour that the end of summer time repeats; each is taken as the first that goes on"
            ));
        }
        let wraps: u64 = clocks().map(|clock| clock.wraps).sum();
        if wraps > 0 {
            said.notes.push(format!("{path}: the counter of time begins anew {wraps} times at its end; time goes on"));
        }
        if clocks().any(|clock| clock.used_zone && !clock.has_zone) {
            let zone = "local times without a zone are taken as UTC; give `time: {zone: Europe/Zurich}` in the map if they are not";
            said.warnings.push(format!("{path}: {zone}"));
        }
        if self.spread > 0 {
            said.notes
                .push(format!("{path}: {} rows shared a time with others and were spread up to the next", self.spread));
        }
        said
    }
}
