//! TRC: a table with tabs, three heading lines before the markers' names.
//!
//! ```text
//! PathFileType  4  (X/Y/Z)  take.trc
//! DataRate  CameraRate  NumFrames  NumMarkers  Units  ...
//! 120       120         240        40          mm     ...
//! Frame#  Time  brow_l              brow_r
//!               X1      Y1     Z1   X2     Y2     Z2
//! 1       0.0   30.1    52.0   80.3 ...
//! ```

use super::{MarkerTake, unit_in_mm};
use crate::Point;

pub(super) fn parse(text: &str) -> Result<MarkerTake, String> {
    let mut lines = text.lines().enumerate();
    let mut next = |what: &str| {
        lines
            .next()
            .map(|(i, line)| (i + 1, line))
            .ok_or_else(|| format!("it ends before {what}"))
    };
    let (_, first) = next("its first line")?;
    if !first.trim_start().starts_with("PathFileType") {
        return Err("it is neither C3D nor TRC: no 'PathFileType' at its beginning".to_owned());
    }
    let (_, keys) = next("the names of its properties")?;
    let (line, values) = next("the values of its properties")?;
    let properties: Vec<(&str, &str)> = keys
        .split('\t')
        .map(str::trim)
        .zip(values.split('\t').map(str::trim))
        .collect();
    let property = |name: &str| {
        let found = properties
            .iter()
            .find(|(key, _)| key.eq_ignore_ascii_case(name));
        found.map(|(_, value)| *value)
    };
    let unit = unit_in_mm(property("Units").unwrap_or_default())
        .map_err(|problem| format!("line {line}: {problem}"))?;
    let (line, names) = next("the names of its markers")?;
    let names: Vec<String> = names
        .split('\t')
        .skip(2)
        .map(str::trim)
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect();
    if let Some(count) = property("NumMarkers").and_then(|n| n.parse::<usize>().ok())
        && count != names.len()
    {
        return Err(format!(
            "line {line} names {} markers where NumMarkers says {count}",
            names.len()
        ));
    }
    next("its coordinates")?;
    let mut take = MarkerTake {
        names,
        times: Vec::new(),
        positions: Vec::new(),
    };
    for (index, text) in lines {
        if !text.trim().is_empty() {
            row(&mut take, text, unit)
                .map_err(|problem| format!("line {}: {problem}", index + 1))?;
        }
    }
    let start = take.times.first().copied().unwrap_or(0.0);
    for time in &mut take.times {
        *time -= start;
    }
    Ok(take)
}

fn row(take: &mut MarkerTake, text: &str, unit: f64) -> Result<(), String> {
    let cells: Vec<&str> = text
        .trim_end_matches(['\r', '\n'])
        .split('\t')
        .map(str::trim)
        .collect();
    let number = |cell: &str| {
        let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
        value.ok_or_else(|| format!("'{cell}' is not a finite number"))
    };
    let time = number(cells.get(1).copied().unwrap_or_default())?;
    if let Some(&last) = take.times.last()
        && time <= last
    {
        return Err(format!("time {time} s does not come after {last} s"));
    }
    take.times.push(time);
    for marker in 0..take.names.len() {
        let at = |axis: usize| {
            cells
                .get(2 + 3 * marker + axis)
                .copied()
                .unwrap_or_default()
        };
        let axes = [at(0), at(1), at(2)];
        let is_missing = axes
            .iter()
            .all(|c| c.is_empty() || c.eq_ignore_ascii_case("nan"));
        take.positions.push(if is_missing {
            None
        } else {
            let [x, y, z] = axes;
            Some(Point::new(number(x)?, number(y)?, number(z)?) * unit)
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "PathFileType\t4\t(X/Y/Z)\tx.trc\n\
                        DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n\
                        60\t60\t2\t2\tm\nFrame#\tTime\tbrow\t\t\tlip\t\t\n\
                        \t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n";

    #[test]
    fn markers_times_units_and_gaps_are_read() {
        let text = format!("{HEAD}1\t1.0\t0.1\t0.2\t0.3\t\t\t\n2\t1.5\t1\t2\t3\t4\t5\t6\n");
        let take = parse(&text).unwrap();
        assert_eq!(take.names, ["brow", "lip"]);
        assert_eq!(take.times, [0.0, 0.5]);
        assert_eq!(take.positions[0], Some(Point::new(100.0, 200.0, 300.0)));
        assert_eq!(take.frame(0)[1], None);
        assert_eq!(take.frame(1)[1], Some(Point::new(4000.0, 5000.0, 6000.0)));
    }

    #[test]
    fn errors_name_the_line() {
        let cases = [
            ("".to_owned(), "ends before"),
            ("hello\n".to_owned(), "neither C3D nor TRC"),
            (HEAD.replace("\tm\n", "\tfurlong\n"), "line 3"),
            (HEAD.replace("2\t2\tm", "2\t3\tm"), "line 4 names 2"),
            (format!("{HEAD}1\t0\tx\t0\t0\t0\t0\t0\n"), "line 7: 'x'"),
            (format!("{HEAD}1\t0\n1\t0\n"), "line 8: time 0 s"),
        ];
        for (text, part) in cases {
            let error = parse(&text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
