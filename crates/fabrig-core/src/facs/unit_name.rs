//! Names of action units as applications write them.

/// A side of the face, the character's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The character's left, +X.
    Left,
    /// The character's right.
    Right,
}

/// What a name that starts with an action unit says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnitName<'a> {
    /// Number of the unit: 12 of `AU12`.
    pub number: u32,
    /// The side, where the name gives one.
    pub side: Option<Side>,
    /// What stands behind the number and is no side, without separators: `r` of `AU12_r` is
    /// not told from a right side here, so a reader that knows better looks at this first.
    pub suffix: &'a str,
}

/// Reads `AU12`, `au01`, `AU12_r`, `AU12.l`, `AU6Left`: `AU`, a number, and perhaps a suffix.
pub fn match_unit(name: &str) -> Option<UnitName<'_>> {
    let name = name.trim();
    let prefix = name.get(..2)?;
    if !prefix.eq_ignore_ascii_case("au") {
        return None;
    }
    let rest = &name[2..];
    let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let number: u32 = rest[..digits].parse().ok()?;
    let suffix = rest[digits..].trim_start_matches(['.', '_', ' ', '-']);
    let side = match suffix.to_ascii_lowercase().as_str() {
        "l" | "left" => Some(Side::Left),
        "r" | "right" => Some(Side::Right),
        "" => None,
        // OpenFace's presence columns; no side, but a unit all the same.
        _ if suffix.eq_ignore_ascii_case("c") => None,
        _ => return None,
    };
    Some(UnitName {
        number,
        side,
        suffix,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_sides_are_read_however_written() {
        let read = |name| match_unit(name).map(|u| (u.number, u.side));
        assert_eq!(read("AU01"), Some((1, None)));
        assert_eq!(read(" au12.L "), Some((12, Some(Side::Left))));
        assert_eq!(read("AU45_right"), Some((45, Some(Side::Right))));
        assert_eq!(read("AU6Left"), Some((6, Some(Side::Left))));
        assert_eq!(match_unit("AU12_r").map(|u| u.suffix), Some("r"));
        assert_eq!(match_unit("AU28_c").map(|u| u.suffix), Some("c"));
        for bad in [
            "",
            "AU",
            "A12",
            "AUx",
            "AU12_up",
            "AU99999999999",
            "äu1",
            "auto",
        ] {
            assert_eq!(match_unit(bad), None, "{bad}");
        }
    }
}
