//! The classical fourth-order method (Kutta 1901).

use super::OdeSystem;

#[inline(always)]
pub(super) fn step<F: OdeSystem>(system: &F, s: &F::State, force: &F::Force, h: f64) -> F::State {
    let k1 = system.rate(s, force);
    let k2 = system.rate(&system.plus_rates(s, &[(0.5 * h, &k1)]), force);
    let k3 = system.rate(&system.plus_rates(s, &[(0.5 * h, &k2)]), force);
    let k4 = system.rate(&system.plus_rates(s, &[(h, &k3)]), force);
    let (sixth, third) = (h / 6.0, h / 3.0);
    system.projected(system.plus_rates(s, &[(sixth, &k1), (third, &k2), (third, &k3), (sixth, &k4)]))
}
