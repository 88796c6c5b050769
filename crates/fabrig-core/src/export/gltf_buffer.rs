//! The buffer of a glTF file with its views and accessors.

use serde_json::{Value, json};

/// What a buffer view holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    /// Vertex attributes.
    Vertices,
    /// Indices of primitives.
    Indices,
    /// Anything else.
    Other,
}

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

/// Everything is aligned to this.
const ALIGNMENT: usize = 4;

/// Grows the buffer and the lists that describe it.
#[derive(Debug, Default)]
pub(super) struct BufferBuilder {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl BufferBuilder {
    /// Adds bytes; returns the index of their view.
    pub(super) fn view(&mut self, bytes: &[u8], target: Target) -> usize {
        self.bytes
            .resize(self.bytes.len().next_multiple_of(ALIGNMENT), 0);
        let mut view = json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": bytes.len(),
        });
        match target {
            Target::Vertices => view["target"] = json!(34962),
            Target::Indices => view["target"] = json!(34963),
            Target::Other => {}
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds numbers, `width` an element; returns the index of their accessor.
    pub(super) fn floats(&mut self, values: &[f32], width: usize, target: Target) -> usize {
        let view = self.view(&to_bytes(values), target);
        let (low, high) = bounds(values.chunks_exact(width), width);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "type": kind,
            "count": values.len() / width, "min": low, "max": high,
        }))
    }

    /// Adds offsets of some of `count` vertices, every other one zero, the shorter way.
    pub(super) fn offsets(&mut self, count: usize, offsets: &[(u32, [f32; 3])]) -> usize {
        // A list without elements is not allowed.
        let zero = [(0, [0.0; 3])];
        let offsets = if offsets.is_empty() { &zero } else { offsets };
        let is_short = count <= usize::from(u16::MAX) + 1;
        let index_size = if is_short { 2 } else { 4 };
        if offsets.len() * (index_size + 12) + 2 * ALIGNMENT >= count * 12 {
            let mut all = vec![0.0; 3 * count];
            for (vertex, offset) in offsets {
                let start = 3 * *vertex as usize;
                all[start..start + 3].copy_from_slice(offset);
            }
            return self.floats(&all, 3, Target::Vertices);
        }
        let values: Vec<f32> = offsets.iter().flat_map(|(_, offset)| *offset).collect();
        let zeros = (offsets.len() < count).then_some(&[0.0f32; 3][..]);
        let (low, high) = bounds(values.chunks_exact(3).chain(zeros), 3);
        let indices: Vec<u8> = if is_short {
            let indices = offsets.iter().map(|(v, _)| *v as u16);
            indices.flat_map(u16::to_le_bytes).collect()
        } else {
            let indices = offsets.iter().map(|(v, _)| *v);
            indices.flat_map(u32::to_le_bytes).collect()
        };
        let indices = self.view(&indices, Target::Other);
        let values = self.view(&to_bytes(&values), Target::Other);
        let kind = if is_short {
            UNSIGNED_SHORT
        } else {
            UNSIGNED_INT
        };
        self.accessor(json!({
            "componentType": FLOAT, "type": "VEC3", "count": count, "min": low, "max": high,
            "sparse": {
                "count": offsets.len(),
                "indices": {"bufferView": indices, "componentType": kind},
                "values": {"bufferView": values},
            },
        }))
    }

    /// Adds the indices of a primitive.
    pub(super) fn indices(&mut self, indices: &[u32]) -> usize {
        // The largest value of each width restarts strips.
        let is_short = indices.iter().all(|&i| i < u32::from(u16::MAX));
        let bytes: Vec<u8> = if is_short {
            indices
                .iter()
                .flat_map(|&i| (i as u16).to_le_bytes())
                .collect()
        } else {
            indices.iter().flat_map(|i| i.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Target::Indices);
        let kind = if is_short {
            UNSIGNED_SHORT
        } else {
            UNSIGNED_INT
        };
        self.accessor(json!({
            "bufferView": view, "componentType": kind, "type": "SCALAR", "count": indices.len(),
        }))
    }
}

fn to_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn bounds<'a>(elements: impl Iterator<Item = &'a [f32]>, width: usize) -> (Vec<f64>, Vec<f64>) {
    let mut low = vec![f64::INFINITY; width];
    let mut high = vec![f64::NEG_INFINITY; width];
    for element in elements {
        for (c, &x) in element.iter().enumerate() {
            low[c] = low[c].min(f64::from(x));
            high[c] = high[c].max(f64::from(x));
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_sparse_where_that_is_shorter_and_never_empty() {
        let mut buffer = BufferBuilder::default();
        let few = buffer.offsets(100, &[(3, [1.0, -2.0, 0.5]), (70, [0.0, 1.0, 0.0])]);
        let of_few = &buffer.accessors[few];
        assert_eq!(of_few["sparse"]["count"], 2);
        assert_eq!(of_few["min"], json!([0.0, -2.0, 0.0]));
        let none = buffer.offsets(100, &[]);
        assert_eq!(buffer.accessors[none]["sparse"]["count"], 1);
        let all: Vec<(u32, [f32; 3])> = (0..100).map(|v| (v, [1.0; 3])).collect();
        let dense = buffer.offsets(100, &all);
        assert!(buffer.accessors[dense].get("sparse").is_none());
        assert_eq!(buffer.accessors[dense]["min"], json!([1.0, 1.0, 1.0]));
        assert!(
            buffer
                .views
                .iter()
                .all(|v| v["byteOffset"].as_u64().unwrap() % 4 == 0)
        );
    }
}
