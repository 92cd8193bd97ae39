//! The type of fault of an entry of `[[faults]]`.

use lockstep::fault::{FaultWindow, LinkFault};

use crate::scenario::spec::{FaultSpec, Time};

/// The types of faults, by the key that distinguishes them.
pub(super) enum FaultType {
    Signal { port: String, output: bool },
    Link { connection: String },
    Substitution { participant: String },
}

/// The key of an entry that is wrong, and why.
pub(super) type Refusal = (String, String);

const FAULT_TYPES: [(&str, &[&str]); 4] = [
    ("input", &["until", "field", "kind", "value", "bit", "probability"]),
    ("output", &["until", "field", "kind", "value", "bit", "probability"]),
    ("connection", &["until", "drop", "extra-delay"]),
    ("substitute", &["run", "parameters", "state"]),
];

impl FaultSpec {
    /// The type of the fault, after checking that it has no key of another type.
    pub(super) fn fault_type(&self) -> Result<FaultType, Refusal> {
        let given = self.given_keys();
        let type_keys: Vec<&str> = FAULT_TYPES
            .iter()
            .map(|(type_key, _)| *type_key)
            .filter(|type_key| given.iter().any(|key| key == type_key))
            .collect();
        let [type_key] = type_keys[..] else {
            let reason = format!(
                "a fault has exactly one of `input`, `output`, `connection` and `substitute`; this one has {}",
                if type_keys.is_empty() {
                    "none".to_owned()
                } else {
                    type_keys.join(" and ")
                }
            );
            return Err((type_keys.last().copied().unwrap_or_default().to_owned(), reason));
        };
        let (_, allowed) = FAULT_TYPES
            .iter()
            .find(|(own, _)| *own == type_key)
            .expect("it is one of them");
        let known = |key: &str| key == type_key || allowed.contains(&key);
        if let Some(foreign) = given.iter().find(|key| !known(key)) {
            let reason = format!(
                "does not belong to a fault with `{type_key}`, which may have {}",
                allowed.join(", ")
            );
            return Err(((*foreign).to_owned(), reason));
        }
        Ok(match (&self.input, &self.output, &self.connection, &self.substitute) {
            (Some(port), ..) => FaultType::Signal {
                port: port.clone(),
                output: false,
            },
            (_, Some(port), ..) => FaultType::Signal {
                port: port.clone(),
                output: true,
            },
            (.., Some(connection), _) => FaultType::Link {
                connection: connection.clone(),
            },
            (.., participant) => FaultType::Substitution {
                participant: participant.clone().unwrap_or_default(),
            },
        })
    }

    pub(super) fn link_fault(&self, name: &str, span: FaultWindow, connection: &str) -> Result<LinkFault, Refusal> {
        if self.drop.is_none() && self.extra_delay.is_none() {
            let reason = "does not specify a fault of the connection: write drop = 0.3 or extra-delay = \"20 ms\"";
            return Err((String::new(), reason.to_owned()));
        }
        if let Some(drop) = self.drop.filter(|drop| !(0.0..=1.0).contains(drop)) {
            return Err((
                "drop".into(),
                format!("{drop} is not a probability: write a value between 0 and 1"),
            ));
        }
        let extra_delay = self.extra_delay.as_ref().map(Time::checked);
        if let Some(delay) = extra_delay.filter(|delay| delay.is_negative()) {
            let reason = format!("{delay} would let an input see the future: it must not be negative");
            return Err(("extra-delay".into(), reason));
        }
        let mut words = Vec::new();
        words.extend(self.drop.map(|drop| format!("drops {} %", 100.0 * drop)));
        words.extend(extra_delay.map(|delay| format!("{delay} more delay")));
        Ok(LinkFault {
            name: name.to_owned(),
            span,
            drop: self.drop.unwrap_or(0.0),
            extra_delay: extra_delay.unwrap_or_default(),
            description: format!("connection {connection}: {}", words.join(", ")),
        })
    }
}
