//! Times in scenarios: exact, and with their original text.

use std::fmt;

use lockstep::time::{Rational, TimeError};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A time in a scenario: `"10 ms"`, `"1/300 s"`, `"30 Hz"`, or a [`Rational`].
///
/// A text that is no valid time is kept until the scenario is made, which then reports its key.
///
/// ```
/// use engine::scenario::Time;
///
/// assert_eq!(Time::from("0.01 s"), Time::from("100 Hz"));
/// assert_eq!(Time::from("100 Hz").to_string(), "100 Hz");
/// assert!(Time::from("soon").exact().is_err());
/// ```
#[derive(Debug, Clone)]
pub struct Time {
    text: String,
    /// The value, if the text is a valid time.
    exact: Option<Rational>,
}

impl Time {
    /// The time as a fraction of seconds.
    ///
    /// # Errors
    /// When the text is no time.
    pub fn exact(&self) -> Result<Rational, TimeError> {
        self.exact.map_or_else(|| self.text.parse(), Ok)
    }

    /// As [`Time::exact`], once all times of a scenario have been checked; zero for an invalid text.
    pub(in crate::scenario) fn checked(&self) -> Rational {
        self.exact.unwrap_or(Rational::ZERO)
    }

    /// Writes the time in its shortest text, for comparisons as text.
    pub(in crate::scenario) fn shorten(&mut self) {
        if let Some(exact) = self.exact {
            self.text = exact.to_string();
        }
    }
}

impl Default for Time {
    /// Zero.
    fn default() -> Time {
        Rational::ZERO.into()
    }
}

impl PartialEq for Time {
    /// Whether both are the same instant, however they are written.
    fn eq(&self, other: &Time) -> bool {
        match (&self.exact, &other.exact) {
            (Some(own), Some(other)) => own == other,
            _ => self.text == other.text,
        }
    }
}

impl From<&str> for Time {
    fn from(text: &str) -> Time {
        text.to_owned().into()
    }
}

impl From<String> for Time {
    fn from(text: String) -> Time {
        Time {
            exact: text.parse().ok(),
            text,
        }
    }
}

impl From<Rational> for Time {
    fn from(exact: Rational) -> Time {
        Time {
            text: exact.to_string(),
            exact: Some(exact),
        }
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Serialize for Time {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Time {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Time, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = Time;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a time: a number and a unit in quotes, for example \"10 ms\"")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Time, E> {
                let time = Time::from(text);
                time.exact().map(|_| time).map_err(E::custom)
            }

            // A number without a unit is the most frequent wrong time, and is refused like any other one.
            fn visit_i64<E: Error>(self, number: i64) -> Result<Time, E> {
                self.visit_str(&number.to_string())
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<Time, E> {
                self.visit_str(&number.to_string())
            }
        }
        deserializer.deserialize_any(Text)
    }
}
