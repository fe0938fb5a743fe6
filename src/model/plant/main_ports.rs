//! The main ports: rectangular windows between spool, supply, return and the servomotor's chambers.
//!
//! `x_eff = x − h_0` for `x > h_0`, `x + h_0` for `x < −h_0`, 0 between. `x_eff ≥ 0`: `Q_1 = C_d w x_eff √(2 (P_s − P_1)/ρ)` into
//! the opening chamber, `Q_2 = C_d w x_eff √(2 (P_2 − P_t)/ρ)` out of the closing one; `x_eff < 0` the other way round
//! (Merritt 1967, section 5.1). A line loss `R Q²` before the feeding port is in series with it, so that
//! no algebraic loop remains: both share the drop from the tank to the chamber. So it is with a loss in the return line and the draining port.
//! Worn edges are rounded: `x_eff = e(x − h_0) − e(−x − h_0)`, `e(b) = (b + √(b² + r²))/2`.

use crate::parameters;
use crate::plant::lanes::abreast;
use crate::plant::orifice::{Flow, in_series, root};
use crate::plant::real::{Lanewise, Real, either};
use crate::plant::supply::Supply;

abreast! {
    /// Law and parameters of the main ports.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MainPorts<T = f64> {
        /// Flow per spool travel and root of pressure drop when opening, m²/(s √Pa).
        pub opening_gain: T,
        /// The same when closing.
        pub closing_gain: T,
        /// Overlap on the opening side, m.
        pub opening_overlap_m: T,
        /// Overlap on the closing side, m.
        pub closing_overlap_m: T,
        /// Radius of the metering edges `r`, m; 0 on the sheet.
        pub edge_radius_m: T,
        /// Steady flow force per port travel and pressure drop, m: `2 C_d w cos θ` if it is modelled, 0 on the sheet.
        pub flow_force_m: T,
        /// The theoretical flow-force coefficient `2 C_d w cos 69°`, m (Merritt 1967, section 5.6).
        pub theoretical_flow_force_m: T,
    }
}

/// Flows into the two chambers, and from the tank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PortFlows<T = f64> {
    /// Into the opening chamber; slope against its own pressure.
    pub opening: Flow<T>,
    /// Into the closing chamber; slope against its own pressure.
    pub closing: Flow<T>,
    /// Out of the tank, m³/s.
    pub drawn_m3_s: T,
}

impl<T: Real> Lanewise<T> for PortFlows<T> {
    #[inline(always)]
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self {
            opening: Flow::choose(mask, yes.opening, no.opening),
            closing: Flow::choose(mask, yes.closing, no.closing),
            drawn_m3_s: T::select(mask, yes.drawn_m3_s, no.drawn_m3_s),
        }
    }
}

impl MainPorts {
    /// From the sheet.
    pub fn new(p: &parameters::MainPorts, esv: &parameters::Esv, oil: &parameters::Oil) -> Self {
        let gain = esv.discharge_coefficient * p.width_m * (2.0 / oil.density_kg_m3).sqrt();
        Self {
            opening_gain: gain,
            closing_gain: gain,
            opening_overlap_m: p.overlap_m,
            closing_overlap_m: p.overlap_m,
            edge_radius_m: 0.0,
            flow_force_m: 0.0,
            theoretical_flow_force_m: 2.0 * esv.discharge_coefficient * p.width_m * 69.0_f64.to_radians().cos(),
        }
    }
}

impl<T: Real> MainPorts<T> {
    /// Travel beyond the overlap `x_eff`, m.
    #[inline(always)]
    pub fn travel_m(&self, position_m: T) -> T {
        self.blurred_travel_m(position_m, position_m.like(0.0))
    }

    /// The same as the mean over chatter of the spool: each edge becomes a hyperbola of width `blur_m`, and of a worn one the squares of radius
    /// and blur add up.
    ///
    /// A Gaussian of standard deviation σ about an edge passes 0.4 σ of travel on average, a hyperbola half its width:
    /// `blur_m` = 0.8 σ matches them there.
    #[inline(always)]
    pub(crate) fn blurred_travel_m(&self, position_m: T, blur_m: T) -> T {
        let sharp = blur_m.is(0.0) & self.edge_radius_m.is(0.0);
        either!(sharp, position_m - position_m.clamp(-self.closing_overlap_m, self.opening_overlap_m), {
            let square_m2 = blur_m * blur_m + self.edge_radius_m * self.edge_radius_m;
            rounded_edge(position_m - self.opening_overlap_m, square_m2)
                - rounded_edge(-position_m - self.closing_overlap_m, square_m2)
        })
    }

    /// Flows at a travel beyond the overlap.
    #[inline(always)]
    pub(crate) fn flows(
        &self,
        travel_m: T,
        opening_pa: T,
        closing_pa: T,
        tank_pa: T,
        supply: &Supply<T>,
    ) -> PortFlows<T> {
        let zero = travel_m.like(0.0);
        let none = Flow { m3_s: zero, slope_m3_s_pa: zero };
        either!(travel_m.is(0.0), PortFlows { opening: none, closing: none, drawn_m3_s: zero }, {
            let opens = travel_m.gt(zero);
            let (fed_pa, drained_pa) = <(T, T)>::choose(opens, (opening_pa, closing_pa), (closing_pa, opening_pa));
            let free = T::select(opens, self.opening_gain, -self.closing_gain) * travel_m;
            let fed = feed(in_series(free, supply.line_root), tank_pa - fed_pa);
            let drained = drain(in_series(free, supply.return_root), drained_pa - supply.return_pressure_pa);
            PortFlows {
                opening: Flow::choose(opens, fed, drained),
                closing: Flow::choose(opens, drained, fed),
                drawn_m3_s: fed.m3_s,
            }
        })
    }

    /// Steady flow force on the spool, N, + opens; it acts towards closing the port.
    #[inline(always)]
    pub fn flow_force_n(&self, travel_m: T, opening_pa: T, closing_pa: T, supply_pa: T, return_pa: T) -> T {
        let zero = travel_m.like(0.0);
        either!(self.flow_force_m.is(0.0), zero, {
            let drops_pa = either!(
                travel_m.ge(zero),
                (supply_pa - opening_pa) + (closing_pa - return_pa),
                (supply_pa - closing_pa) + (opening_pa - return_pa),
            );
            -self.flow_force_m * travel_m * drops_pa.max(zero)
        })
    }
}

#[inline(always)]
fn rounded_edge<T: Real>(beyond_m: T, square_m2: T) -> T {
    (beyond_m + (beyond_m * beyond_m + square_m2).sqrt()) * 0.5
}

#[inline(always)]
fn feed<T: Real>(conductance: T, drop_pa: T) -> Flow<T> {
    let (value, slope) = root(drop_pa);
    Flow { m3_s: conductance * value, slope_m3_s_pa: -conductance * slope }
}

#[inline(always)]
fn drain<T: Real>(conductance: T, drop_pa: T) -> Flow<T> {
    let (value, slope) = root(drop_pa);
    Flow { m3_s: -conductance * value, slope_m3_s_pa: -conductance * slope }
}

#[cfg(test)]
mod tests {
    use crate::plant::reference;

    #[test]
    fn the_overlap_is_dead_and_the_rest_is_free() {
        let ports = reference().main_ports;
        assert_eq!(ports.travel_m(1.9e-4), 0.0);
        assert_eq!(ports.travel_m(-1.9e-4), 0.0);
        assert!((ports.travel_m(1.2e-3) - 1.0e-3).abs() < 1e-15);
        assert!((ports.travel_m(-1.2e-3) + 1.0e-3).abs() < 1e-15);
    }

    #[test]
    fn a_line_loss_and_the_port_share_the_drop() {
        let plant = reference();
        let mut supply = plant.supply;
        supply.line_root = 2.753e9_f64.sqrt();
        let flows = plant.main_ports.flows(5e-3, 2.0e6, 3.0e6, 6.3e6, &supply);
        let q = flows.opening.m3_s;
        let at_valve_pa = supply.pressure_pa(6.3e6, q);
        let free = plant.main_ports.opening_gain * 5e-3 * (at_valve_pa - 2.0e6).sqrt();
        assert!((q - free).abs() < 1e-9 * q);
        assert_eq!(flows.drawn_m3_s, q);
    }

    #[test]
    fn directions_mirror() {
        let plant = reference();
        let open = plant.main_ports.flows(2e-3, 3.0e6, 3.4e6, 6.3e6, &plant.supply);
        let close = plant.main_ports.flows(-2e-3, 3.4e6, 3.0e6, 6.3e6, &plant.supply);
        assert_eq!(open.opening, close.closing);
        assert_eq!(open.closing, close.opening);
    }
}
