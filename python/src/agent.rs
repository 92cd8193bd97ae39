//! An agent that replaces a participant: its observations and actions as flat arrays of doubles, one call for each activation.

use lockstep::port::{Descriptor, Element};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors;
use crate::memory::Memory;
use crate::run::Run;

/// Elements that are adjacent in a payload, and their positions in a flat array.
struct Piece {
    element: Element,
    /// Offset in the payload, bytes.
    offset: usize,
    /// Index in the array.
    at: usize,
    count: usize,
}

/// The pieces of each port, with the total number of elements. Adjacent elements of one type form one piece.
fn pieces<'a>(ports: impl Iterator<Item = &'a Descriptor>) -> (Vec<Vec<Piece>>, usize) {
    let mut at = 0;
    let all = ports.map(|descriptor| {
        let mut own: Vec<Piece> = Vec::new();
        for field in &descriptor.fields {
            let (range, count) = (field.range(), field.len());
            match own.last_mut() {
                Some(last)
                    if last.element == field.element
                        && last.offset + last.count * last.element.size() == range.start =>
                {
                    last.count += count;
                }
                _ => own.push(Piece {
                    element: field.element,
                    offset: range.start,
                    at,
                    count,
                }),
            }
            at += count;
        }
        own
    });
    (all.collect(), at)
}

impl Piece {
    /// Converts elements of a payload to doubles, as bytes.
    fn read_doubles(&self, payload: &[u8], flat: &mut [u8]) {
        let size = self.element.size();
        let from = &payload[self.offset..self.offset + self.count * size];
        let to = &mut flat[8 * self.at..8 * (self.at + self.count)];
        if self.element == Element::F64 {
            to.copy_from_slice(from);
            return;
        }
        for (from, to) in from.chunks_exact(size).zip(to.chunks_exact_mut(8)) {
            to.copy_from_slice(&self.element.to_f64(from).to_ne_bytes());
        }
    }

    /// Converts doubles, as bytes, to elements of a payload.
    fn write_doubles(&self, flat: &[u8], payload: &mut [u8]) {
        let size = self.element.size();
        let to = &mut payload[self.offset..self.offset + self.count * size];
        let from = &flat[8 * self.at..8 * (self.at + self.count)];
        if self.element == Element::F64 {
            to.copy_from_slice(from);
            return;
        }
        for (from, to) in from.as_chunks::<8>().0.iter().zip(to.chunks_exact_mut(size)) {
            self.element.put(f64::from_ne_bytes(*from), to);
        }
    }
}

/// The slot of a participant in a run, for an agent.
#[pyclass(unsendable, module = "escapement._native")]
pub(crate) struct Agent {
    name: String,
    inputs: Vec<Vec<Piece>>,
    outputs: Vec<Vec<Piece>>,
    /// A payload of each output.
    payloads: Vec<Vec<u8>>,
    observation: Memory,
    action: Memory,
    /// Copies of `observation` and `action`, in Rust memory.
    flat: (Vec<u8>, Vec<u8>),
}

#[pymethods]
impl Agent {
    /// Replaces participant `name` of `run`. Its inputs are written to the array `observation`, its outputs are read from the array `action`.
    #[new]
    fn new(
        py: Python<'_>,
        run: &Bound<'_, Run>,
        name: String,
        observation: &Bound<'_, PyAny>,
        action: &Bound<'_, PyAny>,
    ) -> PyResult<Agent> {
        let mut run = run.borrow_mut();
        let interface = run
            .active()?
            .interface(&name)
            .map_err(|failure| errors::run(py, &failure))?;
        let (inputs, observed) = pieces(interface.inputs.iter().map(|port| &port.descriptor));
        let (outputs, acted) = pieces(interface.outputs.iter().map(|port| &port.descriptor));
        let sizes = interface.outputs.iter().map(|port| port.descriptor.size as usize);
        Ok(Agent {
            payloads: sizes.map(|size| vec![0; size]).collect(),
            observation: Memory::of_doubles(observation, observed)?,
            action: Memory::of_doubles(action, acted)?,
            flat: (vec![0; 8 * observed], vec![0; 8 * acted]),
            name,
            inputs,
            outputs,
        })
    }

    /// Advances to the participant's next activation: returns its instant, s, with the inputs in the array `observation`; None when there
    /// is no further one. With `acts`, the activation before whose step the participant is paused gets the content of `action` as its
    /// outputs.
    fn advance(&mut self, py: Python<'_>, run: &Bound<'_, Run>, acts: bool) -> PyResult<Option<f64>> {
        let mut run = run.borrow_mut();
        if acts {
            self.action.take(py, &mut self.flat.1);
            for (number, (pieces, payload)) in self.outputs.iter().zip(&mut self.payloads).enumerate() {
                pieces
                    .iter()
                    .for_each(|piece| piece.write_doubles(&self.flat.1, payload));
                let set = run.active()?.set_output_at(number, payload);
                if !set.map_err(|failure| errors::run(py, &failure))? {
                    return Err(PyValueError::new_err(format!(
                        "`{}` is not paused before a step",
                        self.name
                    )));
                }
            }
        }
        let name = self.name.as_str();
        if !run.detached(py, |run| run.run_to_step(name))? {
            return Ok(None);
        }
        let own = run.active()?;
        for (number, pieces) in self.inputs.iter().enumerate() {
            let payload = own.read_input_at(number).unwrap_or_default();
            pieces
                .iter()
                .for_each(|piece| piece.read_doubles(payload, &mut self.flat.0));
        }
        self.observation.put(py, &self.flat.0);
        Ok(Some(own.now_s()))
    }
}
