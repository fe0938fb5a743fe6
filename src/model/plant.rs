//! The plant: one block per file, each an immutable law with its parameters; memory is in the state.

pub(crate) mod esv;
pub mod friction;
pub(crate) mod lag;
pub mod lanes;
pub(crate) mod main_ports;
pub(crate) mod orifice;
pub(crate) mod proportional_valve;
pub mod rates;
pub(crate) mod real;
pub mod regulator;
pub(crate) mod servomotor;
pub(crate) mod spool;
pub mod steady;
pub(crate) mod supply;
pub mod term;

use crate::parameters::Parameters;
use crate::plant::esv::Esv;
use crate::plant::lanes::{Abreast, Wide, abreast};
use crate::plant::main_ports::MainPorts;
use crate::plant::proportional_valve::ProportionalValve;
use crate::plant::regulator::{Regulator, SmallLoop};
use crate::plant::servomotor::Servomotor;
use crate::plant::spool::Spool;
use crate::plant::supply::Supply;
use crate::plant::term::Terms;

/// What acts on the continuous plant during one tick of the small loop; on one unit, or on several in lanes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive<T = f64> {
    /// Time since the first frame, s.
    pub time_s: f64,
    /// Current to the proportional valve `u`, pu.
    pub valve_current_pu: T,
    /// Position of the emergency shutdown valve: 1 passes pilot oil, 0 drains.
    pub esv_opening_pu: T,
    /// Measured tank pressure, Pa gauge.
    pub tank_pressure_pa: T,
    /// How far chatter blurs the edges of the main ports, m; 0 unless the twin is a mean.
    pub edge_blur_m: T,
    /// Force on the spool beyond the blocks', N, + opens.
    pub spool_force_n: T,
    /// Flow into the control chamber beyond the blocks', m³/s.
    pub chamber_flow_m3_s: T,
    /// Force on the piston beyond the blocks', N, + opens.
    pub servomotor_force_n: T,
    /// Flow into the opening chamber beyond the ports', m³/s.
    pub opening_flow_m3_s: T,
    /// Flow into the closing chamber beyond the ports', m³/s.
    pub closing_flow_m3_s: T,
}

/// The laws of the continuous plant, of one unit or of several in lanes, wherever they stand.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<'a, T = f64> {
    /// Tank, line and return.
    pub supply: &'a Supply<T>,
    /// The proportional (pilot) valve.
    pub proportional_valve: &'a ProportionalValve<T>,
    /// The emergency shutdown valve.
    pub esv: &'a Esv<T>,
    /// Control chamber and spool.
    pub spool: &'a Spool<T>,
    /// The main ports.
    pub main_ports: &'a MainPorts<T>,
    /// The guide-vane servomotor.
    pub servomotor: &'a Servomotor<T>,
}

abreast! {
    /// The laws of several units in lanes.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Bank<T = f64> {
        small_loop: SmallLoop<T>,
        supply: Supply<T>,
        proportional_valve: ProportionalValve<T>,
        esv: Esv<T>,
        spool: Spool<T>,
        main_ports: MainPorts<T>,
        servomotor: Servomotor<T>,
    }
}

impl<T: Wide> Bank<T> {
    /// The laws of these plants in as many lanes as `zero` has; the last plant fills what lanes are left.
    pub(crate) fn new(plants: &[&Plant], zero: T) -> Option<Self> {
        let banks: Vec<Bank<f64>> = plants.iter().map(|plant| plant.bank()).collect();
        let last = banks.len().checked_sub(1)?;
        Some(Bank::abreast(&|lane| &banks[lane.min(last)], &|of| zero.each(of)))
    }

    /// The laws of the continuous plants.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> Blocks<'_, T> {
        let Self { supply, proportional_valve, esv, spool, main_ports, servomotor, .. } = self;
        Blocks { supply, proportional_valve, esv, spool, main_ports, servomotor }
    }

    /// The regulators' small loops.
    #[inline(always)]
    pub(crate) fn small_loop(&self) -> &SmallLoop<T> {
        &self.small_loop
    }
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

    /// The laws of the continuous plant.
    #[inline(always)]
    pub fn blocks(&self) -> Blocks<'_> {
        let Self { supply, proportional_valve, esv, spool, main_ports, servomotor, .. } = self;
        Blocks { supply, proportional_valve, esv, spool, main_ports, servomotor }
    }

    fn bank(&self) -> Bank<f64> {
        Bank {
            small_loop: self.regulator.small_loop(),
            supply: self.supply,
            proportional_valve: self.proportional_valve,
            esv: self.esv,
            spool: self.spool,
            main_ports: self.main_ports,
            servomotor: self.servomotor,
        }
    }
}

/// The reference unit's plant.
#[cfg(test)]
pub(crate) fn reference() -> Plant {
    Plant::new(&crate::params::reference().parameters)
}
