//! A participant that is implemented by a table of C functions.

use std::ffi::c_void;
use std::ptr::NonNull;

use lockstep::participant::{
    Failure, Inputs, Interface, Log, Outputs, ParameterError, Participant, Setup, Step, Termination,
};

use lockstep::port::Descriptor;

use crate::guarded::Guarded;
use crate::host_context::HostContext;
use crate::table::{self, Host, OK, SEEN_EVER, SEEN_NOW, Status, Table};

/// A participant that is implemented by a table of functions, of a library or of the program itself.
///
/// The participant reads inputs from and writes outputs to separate memory with guards around each, and they are copied to and from there: a
/// participant that writes out of bounds, or to an input, fails, and has not corrupted other memory.
pub struct Foreign {
    table: &'static Table,
    context: NonNull<HostContext>,
    /// The participant's own data.
    own: *mut c_void,
    interface: Interface,
    /// The memory of `own`, if the host allocates it.
    memory: Option<Guarded>,
    /// The copies of the inputs, empty where an input is too large to be copied.
    inputs: Guarded,
    outputs: Guarded,
    /// The addresses of the inputs of the current step.
    inputs_at: Vec<*const c_void>,
    outputs_at: Vec<*mut c_void>,
    /// Whether the participant's log has been set.
    has_log: bool,
    terminated: bool,
}

// SAFETY: the functions of a table may be called from any thread, sequentially; nothing in here is shared with another thread.
unsafe impl Send for Foreign {}

/// Owns a host context until its participant has been created.
struct ContextOwner(NonNull<HostContext>);

impl ContextOwner {
    fn into_inner(self) -> NonNull<HostContext> {
        let context = self.0;
        std::mem::forget(self);
        context
    }
}

impl Drop for ContextOwner {
    fn drop(&mut self) {
        // SAFETY: it comes from a box, and is dropped only here.
        drop(unsafe { Box::from_raw(self.0.as_ptr()) });
    }
}

impl Foreign {
    /// Creates the participant of `table`.
    ///
    /// # Errors
    /// A parameter that it rejects or does not know, or invalid ports.
    pub fn make(table: &'static Table, setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        let owner = ContextOwner(NonNull::from(Box::leak(Box::new(HostContext::new(setup)))));
        let unusable = |reason: String| ParameterError::new(crate::NO_PARTICIPANT, reason);
        let mut memory = (table.own_size > 0).then(|| Guarded::zeroed([table.own_size as usize]));
        let given = memory.as_mut().and_then(|memory| memory.addresses().next());
        let given: *mut c_void = given.map_or(std::ptr::null_mut(), <*mut u8>::cast);
        let mut own = given;
        // SAFETY: the context lives; the table has been checked.
        let data = unsafe { &owner.0.as_ref().data };
        let describe = table.describe.ok_or_else(|| unusable("it has no `describe`".into()))?;
        data.describing.set(true);
        data.guard.set_modes(crate::modes::of(table));
        let (host, place) = (owner.0.as_ptr().cast_const().cast(), &raw mut own);
        // SAFETY: the arguments satisfy the ABI.
        let status = data.guard.call("describe", || unsafe { describe(host, place) });
        data.describing.set(false);
        if status != OK {
            let refusal = data.refusal.take();
            let failure = || {
                data.failure
                    .take()
                    .unwrap_or_else(|| missing_reason_text("describe", status))
            };
            return Err(refusal.unwrap_or_else(|| ParameterError::new("", failure())));
        }
        // From here on the participant is terminated, whatever fails afterwards.
        let mut foreign = Foreign {
            table,
            context: owner.into_inner(),
            own,
            interface: Interface::new(lockstep::participant::Kind::Sampled),
            memory,
            inputs: Guarded::zeroed([]),
            outputs: Guarded::zeroed([]),
            inputs_at: Vec::new(),
            outputs_at: Vec::new(),
            has_log: false,
            terminated: false,
        };
        foreign.interface = foreign.data().interface()?;
        if !given.is_null() && foreign.own != given {
            foreign.own = given;
            let reason = "its `describe` put something else in the place of the memory that it was given; with an own_size of 0 it \
                          makes its own";
            return Err(unusable(reason.into()));
        }
        foreign
            .check_guards("describe")
            .map_err(|failure| unusable(failure.to_string()))?;
        let ports = foreign.interface.outputs.iter();
        foreign.outputs = Guarded::zeroed(ports.map(|port| port.descriptor.size as usize));
        foreign.outputs_at = foreign.outputs.addresses().map(<*mut u8>::cast).collect();
        *foreign.data().seen.borrow_mut() = vec![0; foreign.interface.outputs.len()];
        let ports = foreign.interface.inputs.iter();
        foreign.inputs = Guarded::zeroed(ports.map(|port| match port.descriptor.size {
            size @ 0..=Descriptor::PARTS_MAX => size as usize,
            // An image is not copied for each step: it is passed as it is, without guards.
            _ => 0,
        }));
        foreign.inputs_at = (foreign.inputs.addresses()).map(|at| at.cast_const().cast()).collect();
        Ok(Box::new(foreign))
    }

    fn data(&self) -> &crate::host_context::HostData {
        // SAFETY: the context lives as long as this.
        unsafe { &self.context.as_ref().data }
    }

    /// Calls one of the participant's functions, at the instant `t`.
    fn call(
        &self,
        function: &'static str,
        t: Option<f64>,
        call: impl FnOnce(*const Host, *mut c_void) -> Status,
    ) -> Result<(), Failure> {
        let data = self.data();
        data.now.set(t);
        let status = (data.guard).call(function, || call(self.context.as_ptr().cast_const().cast(), self.own));
        let failure = data.failure.take();
        self.check_guards(function)?;
        match failure {
            Some(reason) => Err(reason.into()),
            None if status == OK => Ok(()),
            None => Err(missing_reason_text(function, status).into()),
        }
    }

    /// Checks that the guards are intact.
    fn check_guards(&self, function: &str) -> Result<(), Failure> {
        let past = |overrun| if overrun { "past the end" } else { "before the start" };
        if let Some((_, overrun)) = self.memory.as_ref().and_then(Guarded::first_broken) {
            return Err(format!(
                "its function `{function}` wrote {} of its own memory, which has {} bytes: make own_size the size of the struct",
                past(overrun),
                self.table.own_size
            )
            .into());
        }
        let (what, name, descriptor, overrun) = if let Some((number, overrun)) = self.outputs.first_broken() {
            let port = &self.interface.outputs[number];
            ("output", &port.name, &port.descriptor, overrun)
        } else if let Some((number, overrun)) = self.inputs.first_broken() {
            let port = &self.interface.inputs[number];
            ("input", &port.name, &port.descriptor, overrun)
        } else {
            return Ok(());
        };
        Err(format!(
            "its function `{function}` wrote {} of {what} `{name}`, which has {} bytes: it is a `{}`",
            past(overrun),
            descriptor.size,
            descriptor.name
        )
        .into())
    }

    /// Copies in the inputs of a step.
    fn copy_inputs(&mut self, inputs: &Inputs) {
        for (port, place) in self.inputs_at.iter_mut().enumerate() {
            let (copy, bytes) = (self.inputs.piece_mut(port), inputs.bytes(port));
            match copy.len() == bytes.len() {
                true => copy.copy_from_slice(bytes),
                false => *place = bytes.as_ptr().cast(),
            }
        }
    }

    /// Checks that no copy of an input has changed since [`Foreign::copy_inputs`].
    fn check_inputs_unchanged(&self, inputs: &Inputs) -> Result<(), Failure> {
        for (number, port) in self.interface.inputs.iter().enumerate() {
            let (copy, bytes) = (self.inputs.piece(number), inputs.bytes(number));
            if copy.len() == bytes.len() && copy != bytes {
                let name = &port.name;
                let words = format!(
                    "its function `step` wrote to input `{name}`, which is const: let it change a copy of its own"
                );
                return Err(words.into());
            }
        }
        Ok(())
    }

    /// Copies in the current outputs, whether they are seen, and the log.
    fn load_outputs(&mut self, outputs: &mut Outputs) {
        if !std::mem::replace(&mut self.has_log, true) {
            *self.data().log.borrow_mut() = Some(outputs.log_of().clone());
        }
        let mut seen = self.data().seen.borrow_mut();
        let bits =
            |port| u32::from(outputs.is_seen(port)) * SEEN_NOW + u32::from(outputs.is_ever_seen(port)) * SEEN_EVER;
        seen.iter_mut().enumerate().for_each(|(port, seen)| *seen = bits(port));
        drop(seen);
        for port in 0..self.interface.outputs.len() {
            self.outputs.piece_mut(port).copy_from_slice(outputs.bytes_mut(port));
        }
    }

    fn store_outputs(&self, outputs: &mut Outputs) {
        for port in 0..self.interface.outputs.len() {
            outputs.bytes_mut(port).copy_from_slice(self.outputs.piece(port));
        }
    }
}

fn missing_reason_text(function: &str, status: Status) -> String {
    format!("its function `{function}` returned {status} and gave no reason: return escapement_fail(host, \"…\")")
}

impl Participant for Foreign {
    fn interface(&self) -> Interface {
        self.interface.clone()
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        let Some(initialise) = self.table.initialise else {
            return Ok(());
        };
        self.load_outputs(outputs);
        let places = self.outputs_at.as_ptr();
        // SAFETY: the arguments satisfy the ABI.
        self.call("initialise", Some(t), |host, own| unsafe {
            initialise(host, own, t, places)
        })?;
        self.store_outputs(outputs);
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let Some(function) = self.table.step else {
            return Err("it has no `step`".into());
        };
        self.copy_inputs(inputs);
        // An output that a step does not write keeps its last value, which an earlier participant may have written: replacements occur
        // during the run.
        self.load_outputs(outputs);
        let (from, to) = (self.inputs_at.as_ptr(), self.outputs_at.as_ptr());
        let now = table::Step {
            size: size_of::<table::Step>() as u32,
            reserved: 0,
            index: step.index,
            t: step.t,
            t_next: step.t_next,
            period: step.period,
        };
        // SAFETY: the arguments satisfy the ABI.
        self.call("step", Some(step.t), |host, own| unsafe {
            function(host, own, &raw const now, from, to)
        })?;
        self.check_inputs_unchanged(inputs)?;
        self.store_outputs(outputs);
        Ok(())
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        self.data().termination.set(match why {
            Termination::Finished => table::FINISHED,
            Termination::Stopped => table::STOPPED,
            Termination::Replaced => table::REPLACED,
        });
        *self.data().log.borrow_mut() = Some(log.clone());
        self.terminate_once(log.time());
    }

    fn save(&self) -> Option<Vec<u8>> {
        let Some(save) = self.table.save else {
            return match (&self.memory, self.table.state_size) {
                (_, table::STATELESS) => Some(Vec::new()),
                (Some(memory), size) if size > 0 => Some(memory.piece(0)[..size as usize].to_vec()),
                _ => None,
            };
        };
        let data = self.data();
        *data.state.borrow_mut() = None;
        *data.unsaved.borrow_mut() = None;
        // SAFETY: the arguments satisfy the ABI.
        let saved = self.call("save", data.now.get(), |host, own| unsafe { save(host, own) });
        if let Err(failure) = saved {
            data.log_line(&failure.to_string());
            *data.unsaved.borrow_mut() = Some(failure.to_string());
            return None;
        }
        data.state.take()
    }

    fn save_failure(&self) -> Option<String> {
        self.data().unsaved.borrow().clone()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        if let Some(restore) = self.table.restore {
            let (bytes, size) = (state.as_ptr().cast(), state.len() as u64);
            // SAFETY: the arguments satisfy the ABI.
            return self.call("restore", None, |host, own| unsafe { restore(host, own, bytes, size) });
        }
        let own = self.memory.as_mut().map(|memory| memory.piece_mut(0));
        let place = match (own, self.table.state_size) {
            (_, table::STATELESS) => &mut [],
            (Some(own), size) if size > 0 => &mut own[..size as usize],
            _ => {
                let remedy = "give its table a state_size, or `save` and `restore`";
                return Err(format!("this participant cannot restore a state: {remedy}").into());
            }
        };
        if place.len() != state.len() {
            return Err(format!("the state has {} bytes, and {} are needed", state.len(), place.len()).into());
        }
        place.copy_from_slice(state);
        Ok(())
    }
}

impl Foreign {
    fn terminate_once(&mut self, t: Option<f64>) {
        if let Some(terminate) = self.table.terminate
            && !std::mem::replace(&mut self.terminated, true)
        {
            // SAFETY: the arguments satisfy the ABI, and nothing is called afterwards.
            let ended = self.call("terminate", t, |host, own| unsafe {
                terminate(host, own);
                OK
            });
            // Nothing depends on the participant any more.
            if let Err(failure) = ended {
                self.data()
                    .log_line(&format!("its function `terminate` failed: {failure}"));
            }
        }
    }
}

impl Drop for Foreign {
    fn drop(&mut self) {
        self.terminate_once(None);
        // SAFETY: it comes from a box, and is dropped only here.
        drop(unsafe { Box::from_raw(self.context.as_ptr()) });
    }
}
