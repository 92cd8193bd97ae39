//! Student's t-distribution with a whole number of degrees of freedom.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// The quantile, exceeded with probability 1 - `u`, for `u` in (0, 1) and one or more degrees of freedom.
pub fn quantile(u: f64, degrees_of_freedom: usize) -> f64 {
    let central = (2.0 * u - 1.0).abs();
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    // Bisection until no double is left between the ends.
    loop {
        let angle = 0.5 * (low + high);
        if angle <= low || angle >= high {
            break;
        }
        match central_probability(angle, degrees_of_freedom) < central {
            true => low = angle,
            false => high = angle,
        }
    }
    (libm::tan(low) * (degrees_of_freedom as f64).sqrt()).copysign(u - 0.5)
}

/// The probability that |t| is below tan(`angle`)·√n with n = `degrees_of_freedom`: Abramowitz and Stegun, *Handbook of Mathematical
/// Functions*, 26.7.3 and 26.7.4.
fn central_probability(angle: f64, degrees_of_freedom: usize) -> f64 {
    let (sine, cosine) = libm::sincos(angle);
    let odd = degrees_of_freedom % 2;
    // The series begins with 1 for even degrees of freedom and with the cosine for odd ones.
    let (mut term, mut sum) = (if odd == 1 { cosine } else { 1.0 }, 0.0);
    for k in (odd..degrees_of_freedom.saturating_sub(1)).step_by(2) {
        sum += term;
        term *= cosine * cosine * (k + 1) as f64 / (k + 2) as f64;
    }
    match odd {
        1 => FRAC_2_PI * (angle + sine * sum),
        _ => sine * sum,
    }
}

#[cfg(test)]
mod tests {
    use super::quantile;

    /// Values of `scipy.stats.t.ppf` (SciPy 1.17.1).
    #[test]
    fn student_quantiles_match_scipy() {
        for (u, degrees_of_freedom, expected) in [
            (0.975, 1, 12.706204736174694),
            (0.975, 2, 4.302652729749462),
            (0.975, 3, 3.1824463052837078),
            (0.975, 4, 2.7764451051977934),
            (0.975, 5, 2.5705818356363146),
            (0.975, 10, 2.228138851986274),
            (0.975, 31, 2.039513446396408),
            (0.975, 200, 1.9718962236339088),
            (0.975, 1001, 1.9623367052808798),
            (0.6, 1, 0.32491969623290634),
            (0.6, 2, 0.2886751345948128),
            (0.6, 3, 0.2766706623326898),
            (0.6, 4, 0.2707222947075976),
            (0.6, 5, 0.2671808657041451),
            (0.6, 10, 0.2601848294920803),
            (0.6, 31, 0.2555321683175276),
            (0.6, 200, 0.25368437919014747),
            (0.6, 1001, 0.25341444848349826),
            (0.9995, 1, 636.6192487687897),
            (0.9995, 2, 31.599054576445365),
            (0.9995, 3, 12.923978636687961),
            (0.9995, 4, 8.610301581379522),
            (0.9995, 5, 6.868826625881276),
            (0.9995, 10, 4.586893858702708),
            (0.9995, 31, 3.6334563497583714),
            (0.9995, 200, 3.3398354062757107),
            (0.9995, 1001, 3.3002728760660403),
        ] {
            let own = quantile(u, degrees_of_freedom);
            assert!(
                (own / expected - 1.0).abs() < 1e-12,
                "t({u}; {degrees_of_freedom}) = {own}, not {expected}"
            );
            let other = quantile(1.0 - u, degrees_of_freedom);
            assert!(
                (other / expected + 1.0).abs() < 1e-9,
                "t({}; {degrees_of_freedom}) = {other}",
                1.0 - u
            );
        }
        assert_eq!(quantile(0.5, 4), 0.0);
    }
}
