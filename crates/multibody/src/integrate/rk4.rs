//! The classical fourth-order method (Kutta 1901).

use super::Flow;

#[inline]
pub(super) fn step<F: Flow>(flow: &F, s: &F::State, force: &F::Force, h: f64) -> F::State {
    let k1 = flow.rate(s, force);
    let k2 = flow.rate(&flow.moved(s, &[(0.5 * h, &k1)]), force);
    let k3 = flow.rate(&flow.moved(s, &[(0.5 * h, &k2)]), force);
    let k4 = flow.rate(&flow.moved(s, &[(h, &k3)]), force);
    let (sixth, third) = (h / 6.0, h / 3.0);
    flow.restored(flow.moved(s, &[(sixth, &k1), (third, &k2), (third, &k3), (sixth, &k4)]))
}
