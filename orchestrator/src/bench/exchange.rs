//! Duration of one exchange between two processes, compared with the minimum of the transport, and of the machine.

use std::io::Read;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use lockstep::transport::iceoryx::bare::{BarePingPong, Payload};
use lockstep::transport::iceoryx::{Address, Domain};

use super::cores::{cores, pin_thread_to};
use super::{Measurements, polled};
use engine::run::{Wait, ending_of_process};
use engine::scope::Scope;

/// Round trips per round.
const ROUND: u64 = 50_000;
/// The environment variable with the address of the run for a child.
const ADDRESS_VARIABLE: &str = "ESCAPEMENT_BENCH";

/// Nanoseconds per exchange of 27 doubles each way.
pub struct Exchange {
    /// Two participants in processes of their own, recording included.
    pub lockstep: Measurements,
    /// The same with nothing recorded, so that the recorder sleeps: a core for each participant.
    pub unrecorded: Measurements,
    /// The same payload over two bare publish-subscribe services, polled.
    pub bare: Measurements,
    /// The same payload over two rings of slots between two threads, polled.
    pub rings: Measurements,
    /// The same payload over two atomic counters in memory shared by two cores.
    pub atomics: Measurements,
}

/// Measures `rounds` rounds of each, alternating. The last argument runs one lockstep round, recorded or not, and returns seconds per
/// exchange.
pub fn exchange(
    rounds: usize,
    mut lockstep: impl FnMut(u64, Wait, bool) -> anyhow::Result<f64>,
) -> anyhow::Result<Exchange> {
    let mut all = Exchange {
        lockstep: Measurements::default(),
        unrecorded: Measurements::default(),
        bare: Measurements::default(),
        rings: Measurements::default(),
        atomics: Measurements::default(),
    };
    let wait = if cores().len() > 1 { Wait::Spin } else { Wait::Yield };
    for _ in 0..rounds {
        all.lockstep.add(1e9 * lockstep(ROUND, wait, true)?);
        all.bare.add(bare_round()?);
        // Four times as many: start and end of the run are not to be seen in the figure.
        all.unrecorded.add(1e9 * lockstep(4 * ROUND, wait, false)?);
        all.rings.add(polled::rings(ROUND));
        all.atomics.add(polled::cells(ROUND));
    }
    Ok(all)
}

fn bare_round() -> anyhow::Result<f64> {
    let scope = Scope::create()?;
    let table = scope.address().to_string();
    let start = |end: &str| -> std::io::Result<EndProcess> {
        let mut command = engine::run::own_program();
        command
            .args(["participant", end])
            .env(ADDRESS_VARIABLE, &table)
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        Ok(EndProcess(command.spawn()?))
    };
    let (mut far, mut near) = (start("bench-pong")?, start("bench-ping")?);
    // The near end waits for the far one without a time limit.
    while near.0.try_wait()?.is_none() {
        if let Some(status) = far.0.try_wait()? {
            anyhow::bail!("the bare ping-pong failed: its far end {}", ending_of_process(status));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut text = String::new();
    if let Some(output) = &mut near.0.stdout {
        output.read_to_string(&mut text)?;
    }
    text.trim()
        .parse()
        .map_err(|_| anyhow::anyhow!("the bare ping-pong failed: `{text}`"))
}

/// The process of one end; it is killed when dropped.
struct EndProcess(Child);

impl Drop for EndProcess {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a child of [`exchange`]: one end of the bare ping-pong. `None` when `name` is not one.
pub fn run_ping_pong_end(name: &str) -> Option<anyhow::Result<()>> {
    match name {
        "bench-ping" => Some(ping_pong(true)),
        "bench-pong" => Some(ping_pong(false)),
        _ => None,
    }
}

fn ping_pong(first: bool) -> anyhow::Result<()> {
    let table: Address = std::env::var(ADDRESS_VARIABLE)?.parse()?;
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
    // Queried before this process is pinned to one core.
    let yielding = cores().len() < 2;
    pin_thread_to(usize::from(first));
    let domain = Domain::enter(table, if first { "ping" } else { "pong" })?;
    let end = BarePingPong::open(&domain, first)?;
    let receive = || -> anyhow::Result<Payload> {
        loop {
            if let Some(payload) = end.receive()? {
                return Ok(payload);
            }
            if yielding {
                rustix::thread::sched_yield();
            }
            std::hint::spin_loop();
        }
    };
    let payload = [1.0; 27];
    if !first {
        loop {
            let received = receive()?;
            end.send(&received)?;
        }
    }
    while !end.send(&payload)? {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    receive()?;
    let trip = || -> anyhow::Result<()> {
        end.send(&payload)?;
        receive().map(|_| ())
    };
    for _ in 0..ROUND / 10 {
        trip()?;
    }
    let started = Instant::now();
    for _ in 0..ROUND {
        trip()?;
    }
    println!("{}", started.elapsed().as_nanos() as f64 / ROUND as f64);
    Ok(())
}
