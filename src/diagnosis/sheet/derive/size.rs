//! The size of a valve by the times of its servomotor: port width, stops, overlap.

use super::{Making, relative};
use crate::sheet::Plate;
use crate::sheet::ports::area_m2;

/// Opening and closing times where none is given, s: usual ones.
pub(super) const USUAL_TIMES_S: [f64; 2] = [10.0, 8.0];

/// The spool's stroke over the overlap of its edges, where the overlap is not given: fitted edges have 50 to 150.
pub const STROKES_PER_OVERLAP: f64 = 75.0;

/// Travel of the spool that counts as 1 pu, m, if a plate states it: its own value, else that of a stop.
pub fn spool_stroke_m(plate: &Plate) -> Option<f64> {
    ["spool_stroke", "spool_closing_stop", "spool_opening_stop"].into_iter().find_map(|key| plate.get(key))
}

impl Making<'_> {
    /// Ports and stops by the times; the ratio of lengths to the reference unit's valve.
    pub(super) fn ports(&mut self) -> Result<f64, Vec<String>> {
        let cd = self.shipped("esv.discharge_coefficient");
        self.put("esv.discharge_coefficient", cd, relative(0.04), "usual of sharp edges: 0.60 to 0.65".into(), false);
        let mut times_s = USUAL_TIMES_S;
        let mut known = [false; 2];
        for (k, item) in ["opening_time", "closing_time"].into_iter().enumerate() {
            if let Some(time_s) = self.plate.get(item) {
                (times_s[k], known[k]) = (time_s, true);
            }
        }
        for k in 0..2 {
            if !known[k] {
                let item = ["opening_time", "closing_time"][k];
                if known[1 - k] {
                    times_s[k] = times_s[1 - k] * USUAL_TIMES_S[k] / USUAL_TIMES_S[1 - k];
                }
                self.assumed.push(format!("{item} is not given: {:.1} s assumed", times_s[k]));
            }
        }
        let mut area = [0.0; 2];
        for (k, opens) in [true, false].into_iter().enumerate() {
            let words = ["opening", "closing"][k];
            area[k] = area_m2(&self.p, times_s[k], opens).ok_or_else(|| {
                vec![format!("no port is large enough for {words} in {} s: what moves the servomotor cannot; check areas, pressure and load", times_s[k])]
            })?;
        }
        // The valve's size goes with the area that it has to open.
        let shipped_m2 = self.shipped("main_ports.width_m") * 0.0148;
        let size = (area[1] / shipped_m2).sqrt().clamp(0.05, 20.0);
        let given = |item: &str| self.plate.get(item);
        let strokes = [given("spool_opening_stop"), given("spool_closing_stop")];
        let stroke_m = spool_stroke_m(self.plate).unwrap_or(0.015 * size);
        if !self.taken("distributing_valve.reference_stroke_m", "spool_stroke", 0.0) {
            let source = if strokes.iter().any(Option::is_some) {
                "the stop that is given"
            } else {
                "similarity: 15 mm times the root of the port area over the reference unit's"
            };
            self.put("distributing_valve.reference_stroke_m", stroke_m, None, source.into(), false);
        }
        if !self.taken("main_ports.overlap_m", "port_overlap", 0.1) {
            self.by(
                "main_ports.overlap_m",
                stroke_m / STROKES_PER_OVERLAP,
                0.4,
                "1/75 of the spool's stroke; fitted edges have 1/150 to 1/50",
            );
        }
        let overlap_m = self.p.main_ports.overlap_m;
        let time_spread = if known.iter().all(|known| *known) { 0.1 } else { 0.35 };
        if !self.taken("main_ports.width_m", "port_width", 0.02) {
            let widths = [0, 1].map(|k| strokes[k].map(|stop_m| area[k] / (stop_m - overlap_m).max(1e-5)));
            let (width, source) = match widths {
                [Some(opening), Some(closing)] => {
                    if (opening / closing).ln().abs() > 0.3 {
                        self.assumed.push(format!(
                            "stops and times go together badly: the opening time needs ports of {:.1} mm, the closing time of {:.1} mm",
                            1e3 * opening,
                            1e3 * closing
                        ));
                    }
                    ((opening * closing).sqrt(), "of both times through both stops, geometric mean")
                }
                [None, Some(closing)] => (closing, "of the closing time through the closing stop"),
                [Some(opening), None] => (opening, "of the opening time through the opening stop"),
                [None, None] => {
                    (area[1] / (stroke_m - overlap_m).max(1e-5), "of the closing time through the full stroke")
                }
            };
            let law = "area of the ports at which the forces balance at that speed";
            self.by("main_ports.width_m", width, time_spread, format!("{source}: {law}"));
        }
        let width_m = self.p.main_ports.width_m;
        let law = "of its full-stroke time through the ports";
        for (k, (key, item)) in [
            ("distributing_valve.stroke_max_m", "spool_opening_stop"),
            ("distributing_valve.stroke_min_m", "spool_closing_stop"),
        ]
        .into_iter()
        .enumerate()
        {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let (value, tolerance, source, is_given) = match strokes[k] {
                Some(stop_m) => (stop_m, relative(0.01), self.words(item), true),
                None => {
                    (area[k] / width_m + overlap_m, relative(if known[k] { 0.05 } else { 0.3 }), law.to_owned(), false)
                }
            };
            self.put(key, sign * value, tolerance, source, is_given);
        }
        Ok(size)
    }
}
