//! Reading a participant's parameters into a struct.

use serde::de::DeserializeOwned;

use crate::participant::ParameterError;

/// Reads `table` as a `T`. Structs should have `#[serde(deny_unknown_fields)]`, so that a misspelt key is rejected.
///
/// # Errors
/// The dotted key of the value that was rejected, and the reason.
pub fn read<T: DeserializeOwned>(table: &toml::Table) -> Result<T, ParameterError> {
    serde_path_to_error::deserialize(table.clone()).map_err(|error| {
        let key = error.path().to_string();
        let key = if key == "." { String::new() } else { key };
        let reason = error.into_inner().to_string();
        ParameterError::new(key, reason.trim())
    })
}

#[cfg(test)]
mod tests {
    use crate::units::{Angle, Force, Length, PerAxis, Quantity, Vector, read};

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        angle: Quantity<Angle>,
        place: Vector<Length, 3>,
        #[serde(default = "nine")]
        limit: PerAxis<Force, 3>,
    }

    fn nine() -> PerAxis<Force, 3> {
        PerAxis::of([9.0; 3])
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        inner: Inner,
    }

    #[test]
    fn table_accepts_integer_for_decimal_number() {
        #[derive(Debug, serde::Deserialize)]
        struct Plain {
            factor: f64,
            factors: [f64; 2],
            maybe: Option<f64>,
        }
        let plain = read::<Plain>(&toml::from_str("factor = 2\nfactors = [0, 0.5]\nmaybe = -3").unwrap()).unwrap();
        assert_eq!(
            (plain.factor, plain.factors, plain.maybe),
            (2.0, [0.0, 0.5], Some(-3.0))
        );
    }

    fn refused(text: &str) -> (String, String) {
        let error = read::<Outer>(&toml::from_str(text).unwrap()).unwrap_err();
        (error.key, error.reason)
    }

    #[test]
    fn table_reads_quantities_as_si_values() {
        let text = "[inner]\nangle = '180 deg'\nplace = '[1, 2, 3] mm'\nlimit = '4 N'";
        let inner = read::<Outer>(&toml::from_str(text).unwrap()).unwrap().inner;
        assert!((inner.angle.si() - std::f64::consts::PI).abs() < 1e-15);
        assert_eq!(inner.place.si(), [0.001, 0.002, 0.003]);
        assert_eq!(inner.limit.si(), [4.0; 3]);
        let text = "[inner]\nangle = '1 rad'\nplace = '[1, 2, 3] mm'";
        let inner = read::<Outer>(&toml::from_str(text).unwrap()).unwrap().inner;
        assert_eq!(inner.limit.si(), [9.0; 3]);
    }

    #[test]
    fn table_error_names_key_value_and_remedy() {
        for (text, key, part) in [
            ("angle = 2.5\nplace = '[1, 2, 3] m'", "inner.angle", "`2.5` has no unit"),
            (
                "angle = 2\nplace = '[1, 2, 3] m'",
                "inner.angle",
                "for example \"30 deg\"",
            ),
            (
                "angle = '[1, 2] deg'\nplace = '[1, 2, 3] m'",
                "inner.angle",
                "one number without",
            ),
            (
                "angle = '1 m'\nplace = '[1, 2, 3] m'",
                "inner.angle",
                "an angle (rad) is needed",
            ),
            ("angle = '1 deg'\nplace = '[1, 2] m'", "inner.place", "3 in brackets"),
            ("angle = '1 deg'\nplace = '1 m'", "inner.place", "[0.5, 0.5, 0.5] m"),
            ("angle = '1 deg'\nplace = true", "inner.place", "a length as text"),
            (
                "angle = '1 deg'\nplace = '[1, 2, 3] m'\nlimit = '[1, 2, 3, 4] N'",
                "inner.limit",
                "4 numbers",
            ),
            (
                "angle = '1 deg'\nplaec = '[1, 2, 3] m'",
                "inner.plaec",
                "unknown field `plaec`",
            ),
            ("angle = '1 deg'", "inner", "missing field `place`"),
        ] {
            let (found, reason) = refused(&format!("[inner]\n{text}"));
            assert_eq!(found, key, "{reason}");
            assert!(reason.contains(part), "{text}: {reason}");
        }
    }
}
