//! Places of the layout: `landmark`, `0.4 a + 0.6 b`, `landmark + (dx, dy, dz)`.

/// A weighted sum of named points plus an offset.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PointExpression {
    /// Weight and name of each point; weights sum to 1.
    pub(super) terms: Vec<(f64, String)>,
    /// Offset. [mm on the template]
    pub(super) offset: [f64; 3],
}

impl PointExpression {
    /// Reads an expression; the error says what is wrong.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut expression = Self {
            terms: Vec::new(),
            offset: [0.0; 3],
        };
        for term in text.split('+').map(str::trim) {
            if let Some(inner) = term.strip_prefix('(') {
                let inner = inner
                    .strip_suffix(')')
                    .ok_or_else(|| format!("`{term}` lacks a closing bracket"))?;
                let numbers = inner
                    .split(',')
                    .map(|n| parse_number(n.trim()))
                    .collect::<Result<Vec<f64>, String>>()?;
                if numbers.len() != 3 {
                    return Err(format!(
                        "an offset has 3 numbers, `{term}` {}",
                        numbers.len()
                    ));
                }
                for (sum, n) in expression.offset.iter_mut().zip(numbers) {
                    *sum += n;
                }
                continue;
            }
            let mut words = term.split_whitespace();
            let (weight, name) = match (words.next(), words.next(), words.next()) {
                (Some(name), None, None) => (1.0, name),
                (Some(weight), Some(name), None) => (parse_number(weight)?, name),
                _ => return Err(format!("`{term}` is neither a name nor `weight name`")),
            };
            if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
                return Err(format!("`{name}` is not a name"));
            }
            expression.terms.push((weight, name.to_owned()));
        }
        if expression.terms.is_empty() {
            return Err("it names no point".to_owned());
        }
        let sum: f64 = expression.terms.iter().map(|t| t.0).sum();
        if (sum - 1.0).abs() > 1e-9 {
            return Err(format!("weights sum to {sum}, not 1"));
        }
        Ok(expression)
    }
}

fn parse_number(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|n: &f64| n.is_finite())
        .ok_or_else(|| format!("`{text}` is not a number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_weights_and_offsets_are_read() {
        let e = PointExpression::parse("0.25 a + 0.75 b + (1, -2.5, 3) + (0, 1, 0)").expect("ok");
        assert_eq!(e.terms, vec![(0.25, "a".into()), (0.75, "b".into())]);
        assert_eq!(e.offset, [1.0, -1.5, 3.0]);
        assert_eq!(
            PointExpression::parse("chin").expect("ok").terms,
            vec![(1.0, "chin".into())]
        );
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (text, part) in [
            ("0.5 a + 0.4 b", "0.9"),
            ("a + (1, 2)", "3 numbers"),
            ("a + (1, 2, x)", "`x`"),
            ("a + (1, 2, 3", "closing"),
            ("(1, 2, 3)", "no point"),
            ("a b c", "neither"),
            ("", "neither"),
            ("1 2", "not a name"),
            ("a + (1, NaN, 0)", "NaN"),
        ] {
            let error = PointExpression::parse(text).expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
