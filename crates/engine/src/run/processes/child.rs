//! Processes of participants: started, monitored, and always shut down.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use lockstep::span::{Detail, SPANS};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open};

use crate::run::log::Log;
use crate::run::timeout::Timeout;
use crate::scenario::{Entry, Program};

/// How long participants may take to exit after the command to terminate: time for `terminate`, also on a busy machine.
pub(crate) const GRACE: Duration = Duration::from_secs(2);

/// A participant's process.
pub struct ParticipantProcess {
    /// Its name in the scenario.
    pub name: String,
    child: Child,
    pidfd: OwnedFd,
    log: Log,
    status: Option<ExitStatus>,
    /// An FMU: it unpacks files that it cannot remove when it is killed.
    is_fmu: bool,
}

/// Ties the life of the process that `command` starts to that of this process, and to nothing else: the child dies with this
/// process, and Ctrl-C in a terminal, which goes to the foreground group, reaches the orchestrator only.
///
/// The kernel kills the child when the thread that starts it dies, so that must be the main thread.
pub fn end_with_parent(command: &mut Command) {
    command.process_group(0);
    let parent = rustix::process::getpid();
    // SAFETY: between fork and exec only three system calls are made; neither allocates nor takes a lock.
    unsafe {
        command.pre_exec(move || {
            // Files that this process has open are closed in the child; iceoryx2 does not see to that. Kernels before 5.11 leave
            // them open.
            libc::syscall(libc::SYS_close_range, 3_u32, u32::MAX, libc::CLOSE_RANGE_CLOEXEC);
            rustix::process::set_parent_process_death_signal(Some(Signal::KILL))?;
            // The orchestrator may have died before the line above.
            if rustix::process::getppid() != Some(parent) {
                return Err(io::Error::from(io::ErrorKind::BrokenPipe));
            }
            Ok(())
        });
    }
}

/// The program that is started instead of this one.
static OWN_PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Sets the program that is started where this program would start itself again: a process that has loaded the engine as a module
/// is no program with a command line. Only the first call has an effect.
pub fn set_own_program(program: PathBuf) {
    let _ = OWN_PROGRAM.set(program);
}

/// Starts this program once more: the file that this process runs, even if another file has its name by now.
pub fn own_program() -> Command {
    if let Some(program) = OWN_PROGRAM.get() {
        return Command::new(program);
    }
    let mut command = Command::new("/proc/self/exe");
    if let Some(name) = std::env::args_os().next() {
        command.arg0(name);
    }
    command
}

impl ParticipantProcess {
    /// Starts the program of `entry`, with its address in the run in the environment. The program records spans in this `detail`.
    ///
    /// The kernel kills the child when the thread that starts it dies, so this must be called from the main thread.
    pub fn start(entry: &Entry, address: &str, log: &Path, detail: Option<Detail>) -> io::Result<ParticipantProcess> {
        let name = entry.setup.name.clone();
        let mut command = match &entry.program {
            Program::Builtin(builtin) => {
                let mut command = own_program();
                command.arg("participant").arg(builtin);
                command
            }
            Program::Library { file, participant } => {
                let mut command = own_program();
                command.arg("participant").arg("--library").arg(file);
                command.args(participant);
                command
            }
            Program::Fmu { file, options, .. } => {
                let mut command = own_program();
                command.arg("participant").arg("--fmu").arg(file);
                command.arg("--options").arg(options);
                command
            }
            Program::External { exe, args, folder } => {
                let mut command = Command::new(exe);
                command.args(args).current_dir(folder);
                command
            }
        };
        let (log, output) = Log::create(log)?;
        command
            .env(lockstep::host::ADDRESS, address)
            .env(lockstep::host::PARTICIPANT, &name)
            .env_remove(SPANS)
            .envs(detail.map(|detail| (SPANS, detail.name())))
            .stdin(Stdio::null())
            .stdout(output.try_clone()?)
            .stderr(output);
        end_with_parent(&mut command);
        let mut child = command.spawn()?;
        let pid = Pid::from_child(&child);
        match pidfd_open(pid, PidfdFlags::empty()) {
            Ok(pidfd) => Ok(ParticipantProcess {
                name,
                child,
                pidfd,
                log,
                status: None,
                is_fmu: matches!(entry.program, Program::Fmu { .. }),
            }),
            Err(error) => {
                let _ = child.kill();
                let _ = child.wait();
                Err(error.into())
            }
        }
    }

    /// The process number.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Becomes readable when the process ends.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.pidfd.as_fd()
    }

    /// The exit status of the process, once it has ended. Then its log is complete.
    pub fn exit_status(&mut self) -> Option<ExitStatus> {
        if self.status.is_none() {
            self.status = self.child.try_wait().ok().flatten();
            self.status.iter().for_each(|_| self.log.wait_complete());
        }
        self.status
    }

    /// Its log.
    pub(crate) fn log(&self) -> &Log {
        &self.log
    }

    /// How a process ended, in words: exit status or signal.
    pub fn describe_exit(status: ExitStatus) -> String {
        match (status.code(), status.signal()) {
            (Some(code), _) => format!("exited with status {code}"),
            (None, Some(signal)) => {
                let name = match signal {
                    4 => " (illegal instruction)",
                    6 => " (abort)",
                    7 => " (bus error)",
                    8 => " (arithmetic)",
                    9 => " (killed)",
                    11 => " (segmentation fault)",
                    15 => " (terminated)",
                    _ => "",
                };
                format!("was ended by signal {signal}{name}")
            }
            (None, None) => "ended".to_owned(),
        }
    }

    /// Whether its log is full: it has written more than is kept.
    pub fn log_is_full(&self) -> bool {
        self.log.is_full()
    }

    /// Waits up to `grace` for the process to exit, then kills it.
    pub fn shut_down(&mut self, grace: Duration) {
        self.wait_then_kill(&mut Timeout::new(grace));
    }

    /// Waits for the process to exit until `grace` is over, then kills it. A signal that ends it before is a line in its log: nothing else
    /// tells that it has failed in `terminate`.
    pub fn wait_then_kill(&mut self, grace: &mut Timeout) {
        let was_over = self.status.is_some();
        while self.exit_status().is_none() && !grace.is_over() {
            std::thread::sleep(Duration::from_micros(300));
        }
        match self.exit_status() {
            Some(status) if !was_over && status.signal().is_some() => {
                let how = Self::describe_exit(status);
                self.log.append(&format!(
                    "{}: its process {how} in `terminate` or after it\n",
                    self.name
                ));
            }
            Some(_) => {}
            None => {
                let _ = self.child.kill();
                self.status = self.child.wait().ok();
                self.log.wait_complete();
            }
        }
    }
}

impl Drop for ParticipantProcess {
    fn drop(&mut self) {
        self.shut_down(Duration::ZERO);
        if self.is_fmu {
            fmu::remove_leftovers();
        }
    }
}
