//! Values computed from other dispersions: sums, products and whole powers of them, with their dimensions.

use lockstep::units::Dimension;

/// A parsed formula.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula(Term);

#[derive(Debug, Clone, PartialEq)]
enum Term {
    Number(f64),
    Name(String),
    Sum(Box<Term>, Box<Term>, f64),
    Product(Box<Term>, Box<Term>),
    Quotient(Box<Term>, Box<Term>),
    Power(Box<Term>, i32),
}

/// A number in SI units with its dimension.
pub type DimensionedValue = (f64, Dimension);

/// Maximum nesting depth.
const DEPTH_MAX: usize = 64;

impl Formula {
    /// Parses `0.5 * (mass - dry) * radius^2`: numbers, names, `+ - * /`, whole powers from -9 to 9, and parentheses.
    ///
    /// # Errors
    /// States what was found and what was expected.
    pub fn parse(text: &str) -> Result<Formula, String> {
        let mut parser = Parser {
            rest: text.trim(),
            depth: 0,
        };
        let term = parser.sum()?;
        if parser.rest.is_empty() {
            Ok(Formula(term))
        } else {
            Err(format!(
                "`{}` is not understood; there are numbers, names of dispersions, + - * / ^ and parentheses",
                parser.rest
            ))
        }
    }

    /// The names in it.
    pub fn names(&self) -> Vec<&str> {
        let (mut names, mut pending) = (Vec::new(), vec![&self.0]);
        while let Some(term) = pending.pop() {
            match term {
                Term::Number(_) => {}
                Term::Name(name) => names.push(name.as_str()),
                Term::Power(base, _) => pending.push(base),
                Term::Sum(a, b, _) | Term::Product(a, b) | Term::Quotient(a, b) => pending.extend([&**b, &**a]),
            }
        }
        names
    }

    /// Its value, in SI units.
    ///
    /// # Errors
    /// When dimensions do not fit, or a name has no value.
    pub fn value(&self, of: &dyn Fn(&str) -> Option<DimensionedValue>) -> Result<DimensionedValue, String> {
        value(&self.0, of)
    }
}

fn value(term: &Term, of: &dyn Fn(&str) -> Option<DimensionedValue>) -> Result<DimensionedValue, String> {
    let out_of_range = || "its dimension leaves the range of anything physical".to_owned();
    match term {
        Term::Number(number) => Ok((*number, Dimension::default())),
        Term::Name(name) => of(name).ok_or_else(|| format!("`{name}` is no number of a dispersion above it")),
        Term::Sum(a, b, sign) => {
            let ((a, first), (b, second)) = (value(a, of)?, value(b, of)?);
            if first == second {
                Ok((a + sign * b, first))
            } else {
                Err(format!("adds {first} and {second}"))
            }
        }
        Term::Product(a, b) => {
            let ((a, first), (b, second)) = (value(a, of)?, value(b, of)?);
            Ok((a * b, first.times(second, 1).ok_or_else(out_of_range)?))
        }
        Term::Quotient(a, b) => {
            let ((a, first), (b, second)) = (value(a, of)?, value(b, of)?);
            Ok((a / b, first.times(second, -1).ok_or_else(out_of_range)?))
        }
        Term::Power(base, power) => {
            let (base, dimension) = value(base, of)?;
            let product = (0..power.abs()).fold(1.0, |product, _| product * base);
            let dimension = Dimension::default().times(dimension, *power).ok_or_else(out_of_range)?;
            Ok((if *power < 0 { 1.0 / product } else { product }, dimension))
        }
    }
}

struct Parser<'a> {
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn accept(&mut self, letters: &[char]) -> Option<char> {
        let letter = self.rest.chars().next().filter(|letter| letters.contains(letter))?;
        self.rest = self.rest[letter.len_utf8()..].trim_start();
        Some(letter)
    }

    fn sum(&mut self) -> Result<Term, String> {
        let mut term = self.product()?;
        while let Some(sign) = self.accept(&['+', '-']) {
            let next = self.product()?;
            term = Term::Sum(Box::new(term), Box::new(next), if sign == '-' { -1.0 } else { 1.0 });
        }
        Ok(term)
    }

    fn product(&mut self) -> Result<Term, String> {
        let mut term = self.power()?;
        while let Some(sign) = self.accept(&['*', '/', '·']) {
            let next = self.power()?;
            let (a, b) = (Box::new(term), Box::new(next));
            term = if sign == '/' {
                Term::Quotient(a, b)
            } else {
                Term::Product(a, b)
            };
        }
        Ok(term)
    }

    fn power(&mut self) -> Result<Term, String> {
        if self.accept(&['-']).is_some() {
            let term = self.nested(Parser::power)?;
            return Ok(Term::Product(Box::new(Term::Number(-1.0)), Box::new(term)));
        }
        let base = self.atom()?;
        if self.accept(&['^']).is_none() {
            return Ok(base);
        }
        let end = self
            .rest
            .char_indices()
            .find(|(at, c)| !(c.is_ascii_digit() || (*at == 0 && *c == '-')))
            .map_or(self.rest.len(), |(at, _)| at);
        let power = self.rest[..end].parse().ok().filter(|power: &i32| power.abs() <= 9);
        let power = power.ok_or_else(|| "a power is a whole number from -9 to 9".to_owned())?;
        self.rest = self.rest[end..].trim_start();
        Ok(Term::Power(Box::new(base), power))
    }

    fn nested(&mut self, parse: fn(&mut Self) -> Result<Term, String>) -> Result<Term, String> {
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            return Err("is nested too deeply".to_owned());
        }
        let term = parse(self);
        self.depth -= 1;
        term
    }

    fn atom(&mut self) -> Result<Term, String> {
        if self.accept(&['(']).is_some() {
            let inner = self.nested(Parser::sum)?;
            return match self.accept(&[')']) {
                Some(_) => Ok(inner),
                None => Err("a parenthesis is not closed".to_owned()),
            };
        }
        let starts = self.rest.chars().next();
        let text = self.rest;
        let mut end = 0;
        if starts.is_some_and(|c| c.is_ascii_digit() || c == '.') {
            let bytes = text.as_bytes();
            while end < bytes.len() {
                let exponent = matches!(bytes[end], b'e' | b'E')
                    && bytes
                        .get(end + 1)
                        .is_some_and(|next| next.is_ascii_digit() || matches!(next, b'+' | b'-'));
                let sign = matches!(bytes[end], b'+' | b'-') && end > 0 && matches!(bytes[end - 1], b'e' | b'E');
                if !(bytes[end].is_ascii_digit() || bytes[end] == b'.' || exponent || sign) {
                    break;
                }
                end += 1;
            }
            let number = text[..end]
                .parse()
                .map_err(|_| format!("`{}` is no number", &text[..end]))?;
            self.rest = text[end..].trim_start();
            return Ok(Term::Number(number));
        }
        if starts.is_some_and(|c| c.is_alphabetic() || c == '_') {
            let outside = |c: char| !(c.is_alphanumeric() || c == '_' || c == '[' || c == ']');
            end = text.find(outside).unwrap_or(text.len());
            self.rest = text[end..].trim_start();
            return Ok(Term::Name(text[..end].to_owned()));
        }
        Err(match starts {
            Some(other) => format!("`{other}` stands where a number or the name of a dispersion belongs"),
            None => "ends where a number or the name of a dispersion belongs".to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str) -> Option<DimensionedValue> {
        match name {
            "mass" => Some((3.0, Dimension::new(0, 1, 0, 0))),
            "radius" => Some((2.0, Dimension::new(1, 0, 0, 0))),
            "start[1]" => Some((5.0, Dimension::new(1, 0, 0, 0))),
            _ => None,
        }
    }

    #[test]
    fn formulas_have_values_and_dimensions() {
        for (text, expected) in [
            ("0.5 * mass * radius^2", (6.0, Dimension::new(2, 1, 0, 0))),
            ("radius - 2*(start[1] - radius)", (-4.0, Dimension::new(1, 0, 0, 0))),
            ("-radius^2/radius", (-2.0, Dimension::new(1, 0, 0, 0))),
            ("1e1 + 2.5e-1 - -3", (13.25, Dimension::default())),
            ("radius^-1", (0.5, Dimension::new(-1, 0, 0, 0))),
        ] {
            assert_eq!(Formula::parse(text).unwrap().value(&of), Ok(expected), "{text}");
        }
    }

    #[test]
    fn formula_parser_rejects_invalid_text() {
        for (text, part) in [
            ("mass +", "ends where"),
            ("(mass", "not closed"),
            ("mass mass", "`mass` is not understood"),
            ("sin(mass)", "`(mass)` is not understood"),
            ("mass^0.5", "`.5` is not understood"),
            ("mass^99", "from -9 to 9"),
            ("* mass", "`*` stands where"),
            (&"(".repeat(1000), "nested too deeply"),
            (&"-".repeat(1000), "nested too deeply"),
        ] {
            let error = Formula::parse(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let add = Formula::parse("mass + radius").unwrap();
        assert_eq!(add.value(&of), Err("adds kg and m".to_owned()));
        assert!(Formula::parse("mas").unwrap().value(&of).unwrap_err().contains("`mas`"));
    }
}
