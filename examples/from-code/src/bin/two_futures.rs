//! Two futures of one tank: saved after a minute, continued with the pump off, restored, and continued with the pump on.

use escapement::prelude::*;
use from_code::{Pump, options, scenario};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut run = Run::start(&scenario()?, &options())?;
    run.set("tank.pump", &Pump { flow: 0.006 })?;
    run.run_to("60 s")?;
    let here = run.save()?;
    println!("at {}: {:.3} m", here.time(), depth(&run)?);

    let mut least_lost = (f64::INFINITY, 0.0);
    for flow in [0.0, 0.012] {
        run.restore(&here)?;
        run.set("tank.pump", &Pump { flow })?;
        run.run_to("120 s")?;
        let lost = run.newest("tank.level")?.field("lost")?[0];
        println!("with {flow} m^3/s: {:.3} m, {lost:.3} m^3 lost", depth(&run)?);
        if lost < least_lost.0 {
            least_lost = (lost, flow);
        }
    }

    // The better future is kept.
    run.restore(&here)?;
    run.set("tank.pump", &Pump { flow: least_lost.1 })?;
    run.run_to("120 s")?;
    println!("kept: {} m^3/s, {:.3} m", least_lost.1, depth(&run)?);
    run.end()?;
    Ok(())
}

fn depth(run: &Run) -> Result<f64, RunFailure> {
    Ok(run.newest("tank.level")?.field("depth")?[0])
}
