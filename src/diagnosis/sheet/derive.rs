//! From a plate to a whole unit: what is given is taken over, what is not follows by formulas that are stated with every value.

mod size;
mod valve;

use std::collections::BTreeMap;

pub(super) use size::{STROKES_PER_OVERLAP, spool_stroke_m};

use super::Plate;
use super::ports::time_s;
use govtwin_model::parameters::{ENTRIES, Parameters, Tolerance, Unit};

/// The size of a servomotor, as keys of a plate: one of them is needed.
pub(super) const SIZED_BY: [&str; 3] = ["servomotor_volume", "opening_area", "piston_diameter"];

/// A value's source, and whether plate or manual gave it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sourced {
    /// Where the value comes from: the plate's own words, or a formula.
    pub source: String,
    /// Whether it was given, not derived.
    pub given: bool,
}

/// A unit derived from a plate.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The unit.
    pub unit: Unit,
    /// Where each value comes from, by its key.
    pub sources: BTreeMap<&'static str, Sourced>,
    /// Time of a full stroke opening and closing by the formula of the ports, s.
    pub times_s: [f64; 2],
    /// What was assumed although it matters, in sentences.
    pub assumed: Vec<String>,
}

/// A unit in the making.
struct Making<'a> {
    plate: &'a Plate,
    reference: &'a Unit,
    p: Parameters,
    tolerances: Vec<Option<Tolerance>>,
    sources: BTreeMap<&'static str, Sourced>,
    assumed: Vec<String>,
}

impl Making<'_> {
    fn put(&mut self, key: &'static str, value: f64, tolerance: Option<Tolerance>, source: String, given: bool) {
        let Some(index) = ENTRIES.iter().position(|entry| entry.key == key) else { return };
        let entry = &ENTRIES[index];
        (entry.set)(&mut self.p, rounded(value).clamp(entry.min, entry.max));
        self.tolerances[index] = tolerance;
        self.sources.insert(entry.key, Sourced { source, given });
    }

    /// A value that follows by a formula.
    fn by(&mut self, key: &'static str, value: f64, spread: f64, source: impl Into<String>) {
        self.put(key, value, Some(Tolerance::LogNormal(spread)), source.into(), false);
    }

    /// A given value as it is, or false; `usual` is its tolerance where the plate states none.
    fn taken(&mut self, key: &'static str, item: &'static str, usual: f64) -> bool {
        let Some(given) = self.plate.values.get(item) else { return false };
        let (value, tolerance) = (given.value, relative(given.tolerance_share.unwrap_or(usual)));
        let source = self.words(item);
        self.put(key, value, tolerance, source, true);
        true
    }

    /// The words of the plate.
    fn words(&self, item: &str) -> String {
        let Some(given) = self.plate.values.get(item) else { return String::new() };
        let place = if given.source.is_empty() { "plate or manual" } else { &given.source };
        format!("{place}: {item} {}", given.text)
    }

    /// The reference unit's value of a parameter.
    fn shipped(&self, key: &str) -> f64 {
        ENTRIES.iter().find(|entry| entry.key == key).map_or(0.0, |entry| (entry.get)(&self.reference.parameters))
    }
}

/// Six digits: more than any plate has, and a sheet reads better.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

fn relative(share: f64) -> Option<Tolerance> {
    (share > 0.0).then_some(Tolerance::Relative(share))
}

/// Makes a unit of a plate; the other values follow from the reference unit by similarity.
///
/// # Errors
/// In sentences: what is missing that nothing can stand in for, or what contradicts itself.
pub fn derive(plate: &Plate, reference: &Unit) -> Result<Derived, Vec<String>> {
    let mut making = Making {
        plate,
        reference,
        p: reference.parameters,
        tolerances: reference.tolerances.clone(),
        sources: BTreeMap::new(),
        assumed: vec![],
    };
    missing(plate)?;
    making.oil();
    making.piston();
    making.load();
    let size = making.ports()?;
    making.valve(size);
    making.regulator();
    for entry in ENTRIES {
        let source = || "as the reference unit; the type hardly differs in it".to_owned();
        making.sources.entry(entry.key).or_insert_with(|| Sourced { source: source(), given: false });
    }
    let p = making.p;
    let ports = |stroke_m: f64| p.main_ports.width_m * (stroke_m.abs() - p.main_ports.overlap_m).max(1e-6);
    let valve = &p.distributing_valve;
    let times_s = [time_s(&p, ports(valve.stroke_max_m), true), time_s(&p, ports(valve.stroke_min_m), false)];
    let unit = Unit {
        parameters: p,
        tolerances: making.tolerances,
        effects: vec![],
        own_effects: vec![],
        recorded: govtwin_model::parameters::ChannelReadings::default(),
        ..reference.clone()
    };
    Ok(Derived { unit, sources: making.sources, times_s, assumed: making.assumed })
}

/// The required items of a plate.
fn missing(plate: &Plate) -> Result<(), Vec<String>> {
    let has = |key: &str| plate.values.contains_key(key);
    let mut found = vec![];
    if !has("tank_pressure") {
        found.push(
            "tank_pressure is missing: expected the nominal oil pressure, such as `tank_pressure: 63 bar`".to_owned(),
        );
    }
    if !SIZED_BY.iter().any(|key| has(key)) {
        found.push(
            "the servomotor's size is missing: expected one of servomotor_volume (120 L), opening_area (0.2 m2), piston_diameter (505 mm)"
                .to_owned(),
        );
    }
    if !has("servomotor_stroke") && !has("servomotor_volume") {
        found.push(
            "servomotor_stroke is missing: expected the full stroke, such as `servomotor_stroke: 600 mm`".to_owned(),
        );
    }
    if has("rod_diameter") && !has("piston_diameter") {
        found.push("rod_diameter stands alone: it says something only beside piston_diameter".to_owned());
    }
    if let (Some(piston), Some(rod)) = (plate.get("piston_diameter"), plate.get("rod_diameter"))
        && rod >= piston
    {
        found.push(format!("rod_diameter of {rod} m is no less than piston_diameter of {piston} m"));
    }
    if found.is_empty() { Ok(()) } else { Err(found) }
}

impl Making<'_> {
    fn oil(&mut self) {
        self.taken("oil.tank_pressure_pa", "tank_pressure", 0.01);
        if !self.taken("oil.return_pressure_pa", "return_pressure", 0.0) {
            let value = self.shipped("oil.return_pressure_pa");
            self.put("oil.return_pressure_pa", value, None, "usual: 1 bar".into(), false);
        }
        if !self.taken("oil.density_kg_m3", "oil_density", 0.0) {
            let source = "usual of mineral oil ISO VG 32 to 68 at 40 degrees";
            self.put("oil.density_kg_m3", 870.0, relative(0.02), source.into(), false);
        }
        self.by("oil.bulk_modulus_pa", 1.0e9, 0.25, "usual of oil with some air in steel lines: 0.7 to 1.4 GPa");
    }

    fn piston(&mut self) {
        if !self.taken("servomotor.stroke_m", "servomotor_stroke", 0.0) {
            // Only a volume is known: what counts is the volume, the stroke is a matter of proportion.
            let ratio = (self.plate.get("servomotor_volume").unwrap_or(0.12) / 0.12).cbrt();
            let source = "similarity: 0.6 m (V / 120 L)^(1/3), as only the volume V is given";
            self.put("servomotor.stroke_m", 0.6 * ratio, None, source.into(), false);
            self.assumed.push(format!("the servomotor's stroke is taken as {:.2} m by similarity", 0.6 * ratio));
        }
        let stroke_m = self.p.servomotor.stroke_m;
        let count = self.plate.get("servomotors").unwrap_or(1.0);
        let bore = self.plate.get("piston_diameter");
        let rod = self.plate.get("rod_diameter");
        let circle = |diameter_m: f64| 0.25 * std::f64::consts::PI * diameter_m * diameter_m;
        let rod_m2 = rod.map_or_else(|| 0.1 * circle(bore.unwrap_or(0.0)), circle);
        if !self.taken("servomotor.opening_area_m2", "opening_area", 0.01) {
            if let Some(bore) = bore {
                let area = if count > 1.5 { 2.0 * circle(bore) - rod_m2 } else { circle(bore) };
                let words = self.words("piston_diameter");
                let source = if count > 1.5 {
                    format!("{words}: two in push and pull, pi/4 (2 D^2 - d^2)")
                } else {
                    format!("{words}: pi/4 D^2")
                };
                self.put("servomotor.opening_area_m2", area, relative(0.02), source, true);
            } else if let Some(volume) = self.plate.get("servomotor_volume") {
                let source = format!("{} over the stroke", self.words("servomotor_volume"));
                self.put("servomotor.opening_area_m2", volume / stroke_m, relative(0.03), source, true);
            }
        }
        let opening_m2 = self.p.servomotor.opening_area_m2;
        if !self.taken("servomotor.closing_area_m2", "closing_area", 0.01) {
            if let Some(bore) = bore {
                let both = count > 1.5;
                let area = if both { opening_m2 } else { circle(bore) - rod_m2 };
                let spread = if rod.is_some() || both { 0.02 } else { 0.06 };
                let source = match (both, rod) {
                    (true, _) => "two in push and pull have the same area both ways".to_owned(),
                    (_, Some(_)) => format!("{}: pi/4 (D^2 - d^2)", self.words("rod_diameter")),
                    _ => "the opening area less 10 % for the rod, which is not given".to_owned(),
                };
                self.put("servomotor.closing_area_m2", area, relative(spread), source, rod.is_some() || both);
            } else {
                let source = "0.9 of the opening area: the rod usually takes 5 to 15 %";
                self.put("servomotor.closing_area_m2", 0.9 * opening_m2, relative(0.06), source.into(), false);
            }
        }
        let volume = opening_m2 * stroke_m;
        self.by("servomotor.dead_volume_m3", volume / 6.0, 0.4, "a sixth of the swept volume, lines included");
    }

    fn load(&mut self) {
        let force_n = self.p.oil.tank_pressure_pa * self.p.servomotor.opening_area_m2;
        let shipped_n = self.shipped("oil.tank_pressure_pa") * self.shipped("servomotor.opening_area_m2");
        let share = "of tank pressure times opening area";
        if !self.taken("servomotor.load_closed_n", "load_closed", 0.1) {
            let tolerance = Some(Tolerance::Absolute(0.08 * force_n));
            self.put(
                "servomotor.load_closed_n",
                0.12 * force_n,
                tolerance,
                format!("12 % {share}; 4 to 20 % are usual"),
                false,
            );
        }
        if let Some(open_n) = self.plate.get("load_open") {
            let slope_n = open_n - self.p.servomotor.load_closed_n;
            let source = format!("{} less load_closed", self.words("load_open"));
            self.put(
                "servomotor.load_slope_n",
                slope_n,
                Some(Tolerance::Absolute(0.1 * slope_n.abs().max(1.0))),
                source,
                true,
            );
        } else {
            let tolerance = Some(Tolerance::Absolute(0.12 * force_n));
            self.put(
                "servomotor.load_slope_n",
                0.2 * force_n,
                tolerance,
                format!("20 % {share}; 8 to 32 % are usual"),
                false,
            );
        }
        if !self.taken("servomotor.coulomb_friction_n", "servomotor_friction", 0.2) {
            self.by("servomotor.coulomb_friction_n", 0.03 * force_n, 0.5, format!("3 % {share}; 2 to 5 % are usual"));
        }
        let volume = self.p.servomotor.opening_area_m2 * self.p.servomotor.stroke_m;
        if !self.taken("servomotor.moving_mass_kg", "moving_mass", 0.2) {
            self.by(
                "servomotor.moving_mass_kg",
                8000.0 * volume / 0.12,
                0.7,
                "similarity: 8 t (V / 120 L), V the servomotor's volume",
            );
        }
        let open_s = self.plate.get("opening_time").unwrap_or(size::USUAL_TIMES_S[0]);
        let speed = self.p.servomotor.stroke_m / open_s;
        let source = format!("2 % {share} at full opening speed");
        self.by("servomotor.viscous_damping_n_s_m", 0.02 * force_n / speed, 0.7, source);
        let yields = Some(Tolerance::Absolute(5.0e-10 * shipped_n / force_n));
        self.put("servomotor.stop_compliance_m_n", 0.0, yields, "rigid until a fit says more".into(), false);
    }
}
