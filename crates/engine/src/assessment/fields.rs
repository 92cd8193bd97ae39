//! Fields of a stream, looked up by name once.

use lockstep::participant::ParameterError;
use lockstep::port::{Element, Field};
use tape::StreamSpec;

/// The stream called `name`, or the only one with the message `message`.
///
/// # Errors
/// When there is none, or more than one to choose from.
pub fn stream(
    streams: &[StreamSpec],
    key: &str,
    name: Option<&String>,
    message: &str,
) -> Result<usize, ParameterError> {
    let listed = |numbers: &[usize]| {
        let names: Vec<String> = numbers.iter().map(|&number| streams[number].name()).collect();
        names.join(", ")
    };
    let all: Vec<usize> = (0..streams.len()).collect();
    if let Some(name) = name {
        return all
            .iter()
            .copied()
            .find(|&number| streams[number].name() == *name)
            .ok_or_else(|| {
                let reason = format!("there is no stream `{name}`; there are {}", listed(&all));
                ParameterError::new(key, reason)
            });
    }
    let fit: Vec<usize> = all
        .iter()
        .copied()
        .filter(|&number| streams[number].descriptor.name == message && !streams[number].is_seen())
        .collect();
    match fit[..] {
        [number] => Ok(number),
        [] => {
            let reason = format!(
                "no participant gives the message `{message}`; name the stream that takes its place among {}",
                listed(&all)
            );
            Err(ParameterError::new(key, reason))
        }
        _ => {
            let reason = format!(
                "several streams have the message `{message}`; name one of {}",
                listed(&fit)
            );
            Err(ParameterError::new(key, reason))
        }
    }
}

/// A field of `N` numbers.
#[derive(Debug, Clone)]
pub struct Numbers<const N: usize>(Field);

impl<const N: usize> Numbers<N> {
    /// The field `name` of `stream`, which must have this unit.
    ///
    /// # Errors
    /// When it has no such field, or one of another size or unit.
    pub fn find(stream: &StreamSpec, key: &str, name: &str, unit: &str) -> Result<Self, ParameterError> {
        match stream.descriptor.field(name) {
            Some(field) if field.len() == N && field.unit == unit => Ok(Self(field.clone())),
            found => {
                let found = found.map_or("none".to_owned(), |field| format!("`{field}`"));
                let reason = format!(
                    "the figures need `{name}`, {N} numbers in {unit}, of `{}`, which has {found}",
                    stream.name()
                );
                Err(ParameterError::new(key, reason))
            }
        }
    }

    /// The field's numbers in `payload`.
    #[inline]
    pub fn read(&self, payload: &[u8]) -> [f64; N] {
        // Fast path: nearly all fields are doubles, and a dozen are read at every step of the plant.
        if self.0.element == Element::F64 {
            let (doubles, _) = payload[self.0.offset as usize..].as_chunks::<8>();
            let doubles = &doubles[..N];
            return std::array::from_fn(|index| f64::from_le_bytes(doubles[index]));
        }
        std::array::from_fn(|index| self.0.value(payload, index))
    }
}
