//! The items of a plate or a manual.

use super::quantity::Dimension;

/// An item of a name plate, a drawing or a manual.
#[derive(Clone, Copy, Debug)]
pub struct PlateItem {
    /// Its key in plate files.
    pub key: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// What it is and where to find it.
    pub doc: &'static str,
    /// An example, the reference unit's.
    pub example: &'static str,
    /// Smallest value that makes sense, in the SI unit of its dimension.
    pub least: f64,
    /// Greatest value that makes sense, in the SI unit of its dimension.
    pub most: f64,
    /// Parameters that it settles, as keys of parameter files.
    pub settles: &'static [&'static str],
}

macro_rules! items {
    ($( $key:ident: $dimension:ident [$least:literal ..= $most:literal] $example:literal $doc:literal => [$($settles:literal),* $(,)?]; )*) => {
        /// All items, the most important of each group first.
        pub const ITEMS: &[PlateItem] = &[$( PlateItem {
            key: stringify!($key),
            dimension: Dimension::$dimension,
            doc: $doc,
            example: $example,
            least: $least,
            most: $most,
            settles: &[$($settles),*],
        } ),*];
    };
}

items! {
    tank_pressure: Pressure [5e5 ..= 5e7] "63 bar" "nominal oil pressure of the tank, gauge (plate of the oil pressure unit)" => ["oil.tank_pressure_pa"];
    servomotor_stroke: Length [0.01 ..= 5.0] "600 mm" "full stroke of the guide-vane servomotor (plate, drawing)" => ["servomotor.stroke_m"];
    servomotor_volume: Volume [1e-4 ..= 20.0] "120 L" "oil that one full opening takes, all servomotors together (plate: servomotor capacity)" => ["servomotor.opening_area_m2"];
    opening_area: Area [1e-4 ..= 20.0] "0.20 m2" "piston area on the opening side, all servomotors together (drawing); in place of the volume" => ["servomotor.opening_area_m2"];
    closing_area: Area [1e-4 ..= 20.0] "0.18 m2" "piston area on the closing side, all servomotors together (drawing)" => ["servomotor.closing_area_m2"];
    piston_diameter: Length [0.02 ..= 3.0] "505 mm" "bore of one servomotor (drawing); in place of the areas" => ["servomotor.opening_area_m2", "servomotor.closing_area_m2"];
    rod_diameter: Length [0.005 ..= 2.0] "160 mm" "rod of one servomotor (drawing)" => ["servomotor.closing_area_m2"];
    servomotors: Plain [1.0 ..= 2.0] "1" "1, or 2 that work in push and pull on one ring" => [];
    opening_time: Time [0.5 ..= 200.0] "7.1 s" "full stroke opening with the spool at its opening stop (commissioning report)" => ["distributing_valve.stroke_max_m", "main_ports.width_m"];
    closing_time: Time [0.5 ..= 200.0] "4.7 s" "full stroke closing with the spool at its closing stop, without cushion (commissioning report)" => ["distributing_valve.stroke_min_m", "main_ports.width_m"];
    return_pressure: Pressure [0.0 ..= 5e6] "1 bar" "pressure of the return line, gauge" => ["oil.return_pressure_pa"];
    oil_density: Density [500.0 ..= 1500.0] "870 kg/m3" "at working temperature (oil's data sheet)" => ["oil.density_kg_m3"];
    load_closed: Force [-1e8 ..= 1e8] "150 kN" "force of the guide vanes towards closing, closed (index test: difference of chamber pressures times area)" => ["servomotor.load_closed_n"];
    load_open: Force [-1e8 ..= 1e8] "400 kN" "the same, fully open" => ["servomotor.load_slope_n"];
    servomotor_friction: Force [0.0 ..= 1e7] "40 kN" "friction of ring and servomotor (index test: half the difference between slow opening and closing)" => ["servomotor.coulomb_friction_n"];
    moving_mass: Mass [1.0 ..= 1e10] "8 t" "ring, vanes and pistons, referred to the piston" => ["servomotor.moving_mass_kg"];
    spool_stroke: Length [1e-4 ..= 1.0] "15 mm" "spool travel that counts as 1 pu (transducer span, manual)" => ["distributing_valve.reference_stroke_m"];
    spool_opening_stop: Length [1e-4 ..= 1.0] "12 mm" "spool travel from neutral to the opening stop (adjusting nuts)" => ["distributing_valve.stroke_max_m"];
    spool_closing_stop: Length [1e-4 ..= 1.0] "15 mm" "spool travel from neutral to the closing stop (adjusting nuts)" => ["distributing_valve.stroke_min_m"];
    port_width: Length [1e-5 ..= 5.0] "30 mm" "width of the main ports, all windows of one edge together (drawing of the distributing valve)" => ["main_ports.width_m"];
    port_overlap: Length [0.0 ..= 0.01] "0.2 mm" "overlap of the spool at neutral, each side (drawing)" => ["main_ports.overlap_m"];
    control_area: Area [1e-5 ..= 1.0] "50 cm2" "area of the spool's control piston (drawing)" => ["distributing_valve.control_area_m2"];
    constant_pressure_area: Area [1e-5 ..= 1.0] "25 cm2" "area of the piston that always sees tank pressure (drawing)" => ["distributing_valve.constant_pressure_area_m2"];
    spool_mass: Mass [0.1 ..= 1000.0] "25 kg" "spool with what moves with it" => ["distributing_valve.spool_mass_kg"];
    control_volume: Volume [1e-6 ..= 1.0] "0.5 L" "oil between pilot valve and control piston at neutral, line included" => ["distributing_valve.control_volume_m3"];
    pilot_valve_flow: Flow [1e-6 ..= 0.1] "40 L/min" "rated flow of the proportional valve (its plate)" => ["proportional_valve.rated_flow_m3_s"];
    pilot_valve_drop: Pressure [1e5 ..= 2e7] "35 bar" "pressure drop over one edge at the rated flow (its data sheet: 35 bar per edge, 5 bar for some)" => ["proportional_valve.rated_pressure_drop_pa"];
    pilot_valve_frequency: Frequency [5.0 ..= 5000.0] "60 Hz" "natural frequency of the proportional valve, where its phase is -90 degrees (data sheet)" => ["proportional_valve.natural_frequency_rad_s"];
    esv_diameter: Length [3e-4 ..= 0.1] "5.05 mm" "bore of the emergency valve's drain" => ["esv.drain_area_m2"];
    position_gain: Plain [0.1 ..= 500.0] "30" "gain of the position loop, pu of spool per pu of servomotor error (governor settings)" => ["regulator.position_gain"];
    spool_gain: Plain [0.1 ..= 200.0] "8" "gain of the spool loop, pu of valve current per pu of spool error (governor settings)" => ["regulator.spool_gain"];
    dead_band: Share [0.0 ..= 0.1] "0.05 %" "half width of the dead band on the servomotor error (governor settings)" => ["regulator.deadband_upper_pu", "regulator.deadband_lower_pu"];
    compensation: Share [0.0 ..= 0.2] "1.5 %" "jump of the spool demand over the port overlap (governor settings)" => ["regulator.compensation_positive_pu", "regulator.compensation_negative_pu"];
    large_loop_period: Time [1e-4 ..= 1.0] "10 ms" "period of the position loop (governor settings)" => ["regulator.large_loop_period_s"];
    small_loop_period: Time [1e-4 ..= 0.1] "1 ms" "period of the spool loop (governor settings)" => ["regulator.small_loop_period_s"];
}

/// The item of a key.
pub fn item(key: &str) -> Option<&'static PlateItem> {
    ITEMS.iter().find(|item| item.key == key)
}
