//! Accessors of a glTF file, checked against the buffers before anything is read or reserved.
//!
//! The glTF crate checks that indices of the document are in range; whether the bytes that an
//! accessor speaks of are there, of the type that is expected and of a stride that holds it, is
//! checked here, so that its readers neither overflow nor make more than the file holds.

use ::gltf::Accessor;
use ::gltf::accessor::{DataType, Dimensions, Iter};
use ::gltf::buffer::{Buffer, Data, View};
use ::gltf::mesh::util::{ReadIndices, ReadTexCoords};

/// The contents of a file's buffers.
pub(super) struct Buffers<'a> {
    data: &'a [Data],
}

impl<'a> Buffers<'a> {
    pub(super) fn new(data: &'a [Data]) -> Self {
        Self { data }
    }

    /// Bytes in all of them.
    pub(super) fn total_length(&self) -> usize {
        self.data.iter().map(|data| data.0.len()).sum()
    }

    fn get(&self) -> impl Clone + Fn(Buffer<'_>) -> Option<&'a [u8]> {
        let data = self.data;
        move |buffer| data.get(buffer.index()).map(|d| &d.0[..])
    }

    /// Reads three floats an element.
    pub(super) fn vectors(&self, accessor: &Accessor<'_>) -> Result<Vec<[f32; 3]>, String> {
        self.check(accessor, Dimensions::Vec3, &[DataType::F32])?;
        if accessor.view().is_none() && accessor.sparse().is_none() {
            return Ok(vec![[0.0; 3]; accessor.count()]);
        }
        let values = Iter::<[f32; 3]>::new(accessor.clone(), self.get());
        self.all(accessor, values)
    }

    /// Reads texture coordinates of any type that glTF allows.
    pub(super) fn coordinates(&self, accessor: &Accessor<'_>) -> Result<Vec<[f32; 2]>, String> {
        let types = [DataType::F32, DataType::U8, DataType::U16];
        self.check(accessor, Dimensions::Vec2, &types)?;
        let get = self.get();
        let values = match accessor.data_type() {
            DataType::U8 => Iter::new(accessor.clone(), get).map(ReadTexCoords::U8),
            DataType::U16 => Iter::new(accessor.clone(), get).map(ReadTexCoords::U16),
            _ => Iter::new(accessor.clone(), get).map(ReadTexCoords::F32),
        };
        self.all(accessor, values.map(ReadTexCoords::into_f32))
    }

    /// Reads indices of any type that glTF allows.
    pub(super) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, String> {
        let types = [DataType::U8, DataType::U16, DataType::U32];
        self.check(accessor, Dimensions::Scalar, &types)?;
        let get = self.get();
        let values = match accessor.data_type() {
            DataType::U8 => Iter::new(accessor.clone(), get).map(ReadIndices::U8),
            DataType::U16 => Iter::new(accessor.clone(), get).map(ReadIndices::U16),
            _ => Iter::new(accessor.clone(), get).map(ReadIndices::U32),
        };
        self.all(accessor, values.map(ReadIndices::into_u32))
    }

    fn all<T>(
        &self,
        accessor: &Accessor<'_>,
        values: Option<impl Iterator<Item = T>>,
    ) -> Result<Vec<T>, String> {
        let values = values.map(|values| values.collect::<Vec<T>>());
        values
            .filter(|values| values.len() == accessor.count())
            .ok_or_else(|| format!("has an unreadable accessor {}", accessor.index()))
    }

    fn check(
        &self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        types: &[DataType],
    ) -> Result<(), String> {
        let index = accessor.index();
        if accessor.dimensions() != dimensions || !types.contains(&accessor.data_type()) {
            return Err(format!(
                "has an accessor {index} of {:?} {:?} where {dimensions:?} {:?} is expected",
                accessor.dimensions(),
                accessor.data_type(),
                types[0]
            ));
        }
        let outside =
            |what: &str| format!("has an accessor {index} whose {what} is not in its buffer");
        let (count, size) = (accessor.count(), accessor.size());
        if count == 0 {
            return Err(format!("has an accessor {index} without elements"));
        }
        if let Some(view) = accessor.view() {
            self.range(&view, accessor.offset(), count, size)
                .ok_or_else(|| outside("data"))?;
        } else if count > self.total_length() {
            // Zeros, all but the sparse ones: any number of them costs nothing to write.
            return Err(format!(
                "has an accessor {index} of {count} elements without data"
            ));
        }
        if let Some(sparse) = accessor.sparse() {
            let changed = sparse.count();
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = indices.index_type().size();
            if changed == 0 || changed > count {
                return Err(format!(
                    "has an accessor {index} with {changed} sparse values for {count} elements"
                ));
            }
            self.range(&indices.view(), indices.offset(), changed, index_size)
                .ok_or_else(|| outside("list of sparse indices"))?;
            self.range(&values.view(), values.offset(), changed, size)
                .ok_or_else(|| outside("list of sparse values"))?;
        }
        Ok(())
    }

    /// Whether `count` elements of `size` bytes are there, strides and all.
    fn range(&self, view: &View<'_>, offset: usize, count: usize, size: usize) -> Option<()> {
        let stride = view.stride().unwrap_or(size);
        let length = stride.checked_mul(count - 1)?.checked_add(size)?;
        let end = offset.checked_add(length)?;
        let buffer = self.data.get(view.buffer().index())?.0.len();
        let view_end = view.offset().checked_add(view.length())?;
        (stride >= size && end <= view.length() && view_end <= buffer).then_some(())
    }
}
