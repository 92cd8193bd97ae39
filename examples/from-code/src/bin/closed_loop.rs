//! A loop closed by code: the run contains the tank, and this program is its controller, at 10 Hz.

use escapement::prelude::*;
use from_code::{Level, Pump, options, scenario};

/// The desired depth, m.
const WANTED: f64 = 1.0;
/// The maximum flow of the pump, m³/s.
const MOST: f64 = 0.05;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut run = Run::start(&scenario()?, &options())?;
    let (period_s, mut integral) = (0.1, 0.0);
    for k in 1..=1200 {
        let level: Level = run.newest("tank.level")?.get()?;
        let error = WANTED - level.depth;
        let flow = 0.2 * error + integral;
        if (0.0..MOST).contains(&flow) {
            integral += 0.01 * error * period_s;
        }
        run.set(
            "tank.pump",
            &Pump {
                flow: flow.clamp(0.0, MOST),
            },
        )?;
        run.run_to(format!("{} ms", 100 * k).as_str())?;
        if k % 200 == 0 {
            println!("t = {:5.1} s: {:.3} m", run.now_s(), level.depth);
        }
    }
    let outcome = run.end()?;
    println!(
        "{:?}, tape {}",
        outcome.ending,
        outcome.digest.map_or("none".into(), |digest| digest.to_string())
    );
    Ok(())
}
