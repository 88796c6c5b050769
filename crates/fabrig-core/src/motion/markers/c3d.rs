//! C3D: blocks of 512 bytes; a header, parameters, and frames of points.
//!
//! The points are stored as 16-bit integers times a scale, or as floats (a negative scale), by
//! Intel, DEC or MIPS processors. Each has a fourth number that is negative where the point was
//! not seen. Analog samples between the points are passed over.
//!
//! # Source
//!
//! *The C3D File Format User Guide*, Motion Lab Systems.

use super::{MarkerTake, unit_in_mm};
use crate::Point;

const BLOCK: usize = 512;
/// Second byte of every file.
const KEY: u8 = 0x50;

pub(super) fn is_c3d(bytes: &[u8]) -> bool {
    bytes.get(1) == Some(&KEY) && bytes.first().is_some_and(|&b| (1..0x50).contains(&b))
}

/// How a processor stores numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

struct Bytes<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl Bytes<'_> {
    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], String> {
        let end = at.checked_add(N);
        let slice = end.and_then(|end| self.bytes.get(at..end));
        let array = slice.and_then(|s| s.try_into().ok());
        array.ok_or_else(|| format!("it is cut: byte {at} is beyond its {}", self.bytes.len()))
    }

    fn u16(&self, at: usize) -> Result<u16, String> {
        let b = self.array::<2>(at)?;
        Ok(match self.processor {
            Processor::Mips => u16::from_be_bytes(b),
            Processor::Intel | Processor::Dec => u16::from_le_bytes(b),
        })
    }

    fn i16(&self, at: usize) -> Result<i16, String> {
        Ok(self.u16(at)? as i16)
    }

    fn f32(&self, at: usize) -> Result<f64, String> {
        let b = self.array::<4>(at)?;
        Ok(f64::from(match self.processor {
            Processor::Intel => f32::from_le_bytes(b),
            Processor::Mips => f32::from_be_bytes(b),
            // The halves are exchanged and the exponent is two more.
            Processor::Dec => 0.25 * f32::from_le_bytes([b[2], b[3], b[0], b[1]]),
        }))
    }
}

/// A parameter: its element size (-1 for text), dimensions, and where its data begins.
struct Parameter {
    group: u8,
    name: String,
    kind: i8,
    dimensions: Vec<usize>,
    data: usize,
}

pub(super) fn parse(bytes: &[u8]) -> Result<MarkerTake, String> {
    let mut file = Bytes {
        bytes,
        processor: Processor::Intel,
    };
    let parameter_start = (usize::from(file.array::<1>(0)?[0]) - 1) * BLOCK;
    file.processor = match file.array::<1>(parameter_start + 3)?[0] {
        84 => Processor::Intel,
        85 => Processor::Dec,
        86 => Processor::Mips,
        other => return Err(format!("its processor type {other} is not known")),
    };
    let parameters = parameters(&file, parameter_start + 4)?;
    let point = |name: &str| {
        let group = parameters.iter().find(|p| p.data == 0 && p.name == "POINT");
        let group = group.map(|g| g.group);
        (parameters.iter()).find(|p| p.data != 0 && Some(p.group) == group && p.name == name)
    };

    let marker_count = usize::from(file.u16(2)?);
    let analog_count = usize::from(file.u16(4)?);
    let (first, last) = (usize::from(file.u16(6)?), usize::from(file.u16(8)?));
    let mut frame_count = (last + 1).saturating_sub(first);
    if let Some(frames) = point("FRAMES").filter(|p| p.kind == 2) {
        // The header's counter ends at 65535; the parameter's is then the true one.
        frame_count = frame_count.max(usize::from(file.u16(frames.data)?));
    }
    let scale = file.f32(12)?;
    let rate = match point("RATE").filter(|p| p.kind == 4) {
        Some(rate) => file.f32(rate.data)?,
        None => file.f32(20)?,
    };
    if !(rate.is_finite() && rate > 0.0) {
        return Err(format!("its frame rate {rate} is not above 0"));
    }
    let data_start = usize::from(file.u16(16)?);
    let Some(data) = data_start.checked_sub(1).map(|block| block * BLOCK) else {
        return Err("its header does not say where the data begins".to_owned());
    };
    let unit = match point("UNITS") {
        Some(units) => texts(&file, units)?.concat(),
        None => String::new(),
    };
    let unit = unit_in_mm(&unit)?;

    let is_float = scale < 0.0;
    let size = if is_float { 4 } else { 2 };
    let stride = (4 * marker_count + analog_count) * size;
    // Before anything is reserved: a damaged count must not ask for all memory.
    let needed = frame_count
        .checked_mul(stride)
        .and_then(|n| n.checked_add(data));
    if needed.is_none_or(|needed| needed > bytes.len()) {
        return Err(format!(
            "it is cut: {frame_count} frames of {marker_count} markers do not fit in its {} bytes",
            bytes.len()
        ));
    }
    let mut positions = Vec::with_capacity(frame_count * marker_count);
    for frame in 0..frame_count {
        for marker in 0..marker_count {
            let at = data + frame * stride + 4 * marker * size;
            let number = |k: usize| -> Result<f64, String> {
                if is_float {
                    file.f32(at + 4 * k)
                } else {
                    Ok(f64::from(file.i16(at + 2 * k)?))
                }
            };
            let factor = unit * if is_float { 1.0 } else { scale };
            let place = Point::new(number(0)?, number(1)?, number(2)?) * factor;
            let is_seen = number(3)? >= 0.0 && place.iter().all(|c| c.is_finite());
            positions.push(is_seen.then_some(place));
        }
    }
    let mut names = match point("LABELS") {
        Some(labels) => texts(&file, labels)?,
        None => Vec::new(),
    };
    names.truncate(marker_count);
    for marker in names.len()..marker_count {
        names.push(format!("marker_{}", marker + 1));
    }
    Ok(MarkerTake {
        names,
        times: (0..frame_count).map(|i| i as f64 / rate).collect(),
        positions,
    })
}

/// Groups (without data) and parameters.
fn parameters(file: &Bytes<'_>, start: usize) -> Result<Vec<Parameter>, String> {
    let mut found = Vec::new();
    let mut at = start;
    loop {
        let length = usize::from((file.array::<1>(at)?[0] as i8).unsigned_abs());
        if length == 0 {
            return Ok(found);
        }
        let id = file.array::<1>(at + 1)?[0] as i8;
        let name = file.bytes.get(at + 2..at + 2 + length);
        let name = name.ok_or_else(|| "it is cut in the name of a parameter".to_owned())?;
        let name = String::from_utf8_lossy(name).trim().to_ascii_uppercase();
        let offset_at = at + 2 + length;
        let offset = usize::from(file.u16(offset_at)?);
        let mut parameter = Parameter {
            group: id.unsigned_abs(),
            name,
            kind: 0,
            dimensions: Vec::new(),
            data: 0,
        };
        if id > 0 {
            parameter.kind = file.array::<1>(offset_at + 2)?[0] as i8;
            let count = usize::from(file.array::<1>(offset_at + 3)?[0]);
            for k in 0..count {
                let dimension = file.array::<1>(offset_at + 4 + k)?[0];
                parameter.dimensions.push(usize::from(dimension));
            }
            parameter.data = offset_at + 4 + count;
        }
        found.push(parameter);
        if offset == 0 {
            return Ok(found);
        }
        at = offset_at + offset;
    }
}

/// Texts of a parameter: the first dimension is their length, the others their number.
fn texts(file: &Bytes<'_>, parameter: &Parameter) -> Result<Vec<String>, String> {
    if parameter.kind != -1 {
        return Err(format!(
            "its parameter POINT:{} is not text",
            parameter.name
        ));
    }
    let length = parameter.dimensions.first().copied().unwrap_or(1);
    let count: usize = parameter.dimensions.iter().skip(1).product();
    (0..count)
        .map(|k| {
            let at = parameter.data + k * length;
            let bytes = file.bytes.get(at..at + length);
            let bytes = bytes.ok_or_else(|| format!("it is cut in POINT:{}", parameter.name))?;
            let text = String::from_utf8_lossy(bytes);
            Ok(text.trim_matches(['\0', ' ']).to_owned())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of two markers and two frames, in floats or integers.
    fn file(processor: u8, is_float: bool) -> Vec<u8> {
        let big = processor == 86;
        let two = |v: i16| {
            if big {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            }
        };
        let four = |v: f32| match processor {
            86 => v.to_be_bytes(),
            85 => {
                let b = (4.0 * v).to_le_bytes();
                [b[2], b[3], b[0], b[1]]
            }
            _ => v.to_le_bytes(),
        };
        let mut bytes = vec![0u8; 2 * BLOCK];
        bytes[..2].copy_from_slice(&[2, KEY]);
        let scale = if is_float { -1.0 } else { 0.5 };
        for (at, value) in [(2, 2), (4, 1), (6, 1), (8, 2), (16, 3)] {
            bytes[at..at + 2].copy_from_slice(&two(value));
        }
        bytes[12..16].copy_from_slice(&four(scale));
        bytes[20..24].copy_from_slice(&four(50.0));
        bytes[BLOCK + 3] = processor;
        let mut p: Vec<u8> = Vec::new();
        let mut record = |id: i8, name: &str, body: &[u8]| {
            p.push(name.len() as u8);
            p.push(id as u8);
            p.extend(name.bytes());
            p.extend(two(body.len() as i16 + 2));
            p.extend(body);
        };
        record(-1, "POINT", &[0]);
        record(1, "UNITS", &[&[255u8, 1, 2][..], b"cm", &[0]].concat());
        record(
            1,
            "LABELS",
            &[&[255u8, 2, 4, 2][..], b"lip brow", &[0]].concat(),
        );
        p.push(0);
        bytes[BLOCK + 4..BLOCK + 4 + p.len()].copy_from_slice(&p);
        let mut data = Vec::new();
        for frame in 0..2 {
            for marker in 0..2 {
                let seen = if frame == 1 && marker == 1 { -1 } else { 0 };
                for v in [frame * 10 + 2, marker * 10 + 4, 6, seen] {
                    if is_float {
                        data.extend(four(v as f32));
                    } else {
                        data.extend(two(v));
                    }
                }
            }
            // The analog sample.
            data.extend(if is_float {
                four(7.0).to_vec()
            } else {
                two(7).to_vec()
            });
        }
        bytes.extend(data);
        bytes
    }

    #[test]
    fn points_of_every_processor_are_read() {
        for processor in [84, 85, 86] {
            for (is_float, factor) in [(true, 10.0), (false, 5.0)] {
                let take = MarkerTake::parse(&file(processor, is_float), "x").unwrap();
                assert_eq!(take.names, ["lip", "brow"]);
                assert_eq!(take.times, [0.0, 0.02]);
                assert_eq!(take.frame(0)[1], Some(Point::new(2.0, 14.0, 6.0) * factor));
                assert_eq!(take.frame(1)[0], Some(Point::new(12.0, 4.0, 6.0) * factor));
                assert_eq!(take.frame(1)[1], None, "not seen");
            }
        }
    }

    #[test]
    fn damaged_files_are_refused_and_never_panic() {
        let whole = file(84, true);
        for length in 0..whole.len() {
            assert!(
                MarkerTake::parse(&whole[..length], "x").is_err(),
                "{length}"
            );
        }
        for at in 0..BLOCK + 60 {
            for value in [0, 1, 127, 128, 255] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                let _ = MarkerTake::parse(&damaged, "x");
            }
        }
    }
}
