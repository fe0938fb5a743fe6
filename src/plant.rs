//! The plant: one block per file, each an immutable law with its parameters; memory lives in the state.

pub mod esv;
#[cfg(test)]
pub mod fixture;
pub mod friction;
pub mod main_ports;
pub mod orifice;
pub mod proportional_valve;
pub mod rates;
pub mod regulator;
pub mod servomotor;
pub mod spool;
pub mod steady;
pub mod supply;
pub mod term;

use crate::parameters::Parameters;
use crate::plant::esv::Esv;
use crate::plant::main_ports::MainPorts;
use crate::plant::proportional_valve::ProportionalValve;
use crate::plant::regulator::Regulator;
use crate::plant::servomotor::Servomotor;
use crate::plant::spool::Spool;
use crate::plant::supply::Supply;
use crate::plant::term::Terms;

/// What acts on the continuous plant during one tick of the small loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// Time since the first frame, s.
    pub time_s: f64,
    /// Current to the proportional valve `u`, pu.
    pub valve_current_pu: f64,
    /// Position of the emergency shutdown valve: 1 passes pilot oil, 0 drains.
    pub esv_opening_pu: f64,
    /// Measured tank pressure, Pa gauge.
    pub tank_pressure_pa: f64,
    /// How far chatter blurs the edges of the main ports, m; 0 unless the twin is a mean.
    pub edge_blur_m: f64,
    /// Force on the spool beyond the blocks', N, + opens.
    pub spool_force_n: f64,
    /// Flow into the control chamber beyond the blocks', m³/s.
    pub chamber_flow_m3_s: f64,
    /// Force on the piston beyond the blocks', N, + opens.
    pub servomotor_force_n: f64,
    /// Flow into the opening chamber beyond the ports', m³/s.
    pub opening_flow_m3_s: f64,
    /// Flow into the closing chamber beyond the ports', m³/s.
    pub closing_flow_m3_s: f64,
}

/// All blocks of one unit.
#[derive(Clone, Debug)]
pub struct Plant {
    /// The discrete regulator.
    pub regulator: Regulator,
    /// Tank, line and return.
    pub supply: Supply,
    /// The proportional (pilot) valve.
    pub proportional_valve: ProportionalValve,
    /// The emergency shutdown valve.
    pub esv: Esv,
    /// Control chamber and spool.
    pub spool: Spool,
    /// The main ports.
    pub main_ports: MainPorts,
    /// The guide-vane servomotor.
    pub servomotor: Servomotor,
    /// How far the inputs' stamps run behind the plant's, s: a replay hands inputs on earlier by this much.
    pub lookahead_s: f64,
    /// What effects add that no block's coefficient expresses.
    pub terms: Terms,
}

impl Plant {
    /// The nominal plant with these parameters, no effect in it.
    #[must_use]
    pub fn new(p: &Parameters) -> Self {
        Self {
            regulator: Regulator::new(&p.regulator),
            supply: Supply::new(&p.oil),
            proportional_valve: ProportionalValve::new(&p.proportional_valve),
            esv: Esv::new(&p.esv, &p.oil),
            spool: Spool::new(&p.distributing_valve, &p.oil),
            main_ports: MainPorts::new(&p.main_ports, &p.esv, &p.oil),
            servomotor: Servomotor::new(&p.servomotor, &p.oil),
            lookahead_s: 0.0,
            terms: Terms::default(),
        }
    }
}
