//! Variables that are texts or bytes.

use std::ffi::CString;

use lockstep::port::Element;

use super::{Instance, with_variable_name};
use crate::kind::{Native, VariableKind};
use crate::parameter::ParameterValue;
use crate::refusal::Refusal;
use crate::variable::ValueLocation;

impl Instance {
    /// Sets texts or bytes; those of array variables are given consecutively.
    pub fn set_contents(&mut self, references: &[u32], native: Native, contents: &[&[u8]]) -> Result<(), Refusal> {
        let mut rest = contents;
        for reference in references {
            let number = self.variable(*reference, native)?;
            let (own, after) = rest.split_at(self.variables[number].len);
            let set = match self.variables[number].place {
                ValueLocation::Parameter(parameter) => self.set_parameter(number, parameter, own),
                ValueLocation::Input(port, at) => self.set_input(self.variables[number].kind, (port, at), own),
                _ => Err(Refusal::error("cannot be set: it is no input and no parameter")),
            };
            set.map_err(|refusal| with_variable_name(&self.variables[number].name, refusal))?;
            rest = after;
        }
        Ok(())
    }

    fn set_parameter(&mut self, number: usize, parameter: usize, own: &[&[u8]]) -> Result<(), Refusal> {
        self.parameters_may_be_set(number)?;
        let parameter = &mut self.parameters[parameter];
        let text = own.first().map(|text| String::from_utf8_lossy(text).into_owned());
        let value = ParameterValue::Text(text.unwrap_or_default());
        parameter.changed |= parameter.value != value;
        parameter.value = value;
        Ok(())
    }

    fn set_input(&mut self, kind: VariableKind, (port, at): (usize, usize), own: &[&[u8]]) -> Result<(), Refusal> {
        let VariableKind::Content(element) = kind else {
            return Err(Refusal::error("is no text of a port"));
        };
        let size = element.size();
        let mut payload = vec![0; own.len() * size];
        for (content, place) in own.iter().zip(payload.chunks_exact_mut(size)) {
            if let (Element::Text(_), Err(error)) = (element, std::str::from_utf8(content)) {
                let from = error.valid_up_to();
                return Err(Refusal::discard(format!(
                    "cannot be set: it is not UTF-8 from byte {from} on"
                )));
            }
            let put = element.put_content(content, place);
            put.map_err(|error| Refusal::discard(format!("cannot be set: {error}")))?;
        }
        self.body.set(port, at, &payload);
        Ok(())
    }

    /// The bytes in the payload of a text or bytes variable, with the type of its elements.
    fn contents_of(&mut self, number: usize) -> Result<Vec<Vec<u8>>, Refusal> {
        let (place, kind, len) = {
            let variable = &self.variables[number];
            (variable.place, variable.kind, variable.len)
        };
        let payload = match place {
            ValueLocation::Parameter(parameter) => {
                return match &self.parameters[parameter].value {
                    ParameterValue::Text(text) => Ok(vec![text.clone().into_bytes()]),
                    ParameterValue::Bytes(_) => Err(Refusal::error("is no text")),
                };
            }
            ValueLocation::Input(port, at) => &self.body.input(port)[at..],
            ValueLocation::Output(port, at) => &self.body.output(port)?[at..],
            ValueLocation::Time | ValueLocation::Figure(_) => return Err(Refusal::error("is no text")),
        };
        let VariableKind::Content(element) = kind else {
            return Err(Refusal::error("is no text"));
        };
        let each = payload.chunks_exact(element.size()).take(len);
        let contents = each.map(|bytes| element.content(bytes).map(|content| content.as_bytes().to_vec()));
        Ok(contents.collect::<Result<_, String>>()?)
    }

    fn contents(&mut self, references: &[u32], native: Native) -> Result<Vec<Vec<u8>>, Refusal> {
        self.restart_if_outdated()?;
        let mut all = Vec::new();
        for reference in references {
            let number = self.variable(*reference, native)?;
            let own = self.contents_of(number);
            all.extend(own.map_err(|refusal| with_variable_name(&self.variables[number].name, refusal))?);
        }
        Ok(all)
    }

    /// Reads texts; they are valid until the next call.
    pub fn get_texts(&mut self, references: &[u32]) -> Result<&[CString], Refusal> {
        let contents = self.contents(references, Native::Text)?;
        let texts = contents.into_iter().map(CString::new);
        self.texts = texts.map(Result::unwrap_or_default).collect();
        Ok(&self.texts)
    }

    /// Reads bytes; they are valid until the next call.
    pub fn get_binaries(&mut self, references: &[u32]) -> Result<&[Vec<u8>], Refusal> {
        self.binaries = self.contents(references, Native::Binary)?;
        Ok(&self.binaries)
    }
}
