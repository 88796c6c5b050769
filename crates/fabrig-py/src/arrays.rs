//! The one place where arrays come in and go out.

use fabrig_core::Point;
use fabrig_core::mesh::Polygons;
use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, RowVector4, Translation3, UnitQuaternion};
use numpy::ndarray::{Array2, ArrayView2, ArrayViewMut2};
use numpy::{
    AllowTypeChange, Element, IntoPyArray, PyArray2, PyArrayLike1, PyArrayLike2, PyArrayLike3,
    PyReadwriteArray2,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList, PyTuple};

use crate::errors::input;

/// Positions from anything that NumPy makes an (N, 3) array of finite numbers from.
pub(crate) fn points(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Point>> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = value.extract().map_err(|_| {
        input(format!(
            "{name}: expected an array of numbers of shape (N, 3), got {}",
            describe(value)
        ))
    })?;
    let view: ArrayView2<'_, f64> = array.as_array();
    if view.ncols() != 3 {
        return Err(input(format!(
            "{name}: expected shape (N, 3), got ({}, {})",
            view.nrows(),
            view.ncols()
        )));
    }
    // Rows of three numbers in C order lie in memory as points do.
    Ok(match view.as_slice() {
        Some(numbers) => bytemuck::cast_slice(numbers).to_vec(),
        None => view
            .rows()
            .into_iter()
            .map(|row| Point::new(row[0], row[1], row[2]))
            .collect(),
    })
}

/// Points of many frames from anything that NumPy makes an (F, N, 3) array from.
pub(crate) fn frames(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<Point>>> {
    let wrong = || {
        input(format!(
            "{name}: expected numbers of shape (F, N, 3), got {}",
            describe(value)
        ))
    };
    let array: PyArrayLike3<'_, f64, AllowTypeChange> = value.extract().map_err(|_| wrong())?;
    let view = array.as_array();
    if view.dim().2 != 3 {
        return Err(wrong());
    }
    let frames = view.outer_iter().map(|frame| {
        let rows = frame.rows().into_iter();
        rows.map(|row| Point::new(row[0], row[1], row[2])).collect()
    });
    Ok(frames.collect())
}

/// Polygons from an integer array of shape (F, corners), or a list of lists of any lengths.
pub(crate) fn polygons(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Polygons> {
    let index = |face: usize, corner: i64| {
        u32::try_from(corner)
            .map_err(|_| input(format!("{name}: face {face} has the vertex index {corner}")))
    };
    let mut polygons = Polygons::new();
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let faces: Vec<Vec<i64>> = value.extract().map_err(|_| {
            input(format!(
                "{name}: expected lists of whole numbers, one list a face"
            ))
        })?;
        for (face, corners) in faces.into_iter().enumerate() {
            let corners: Vec<u32> = corners
                .into_iter()
                .map(|c| index(face, c))
                .collect::<PyResult<_>>()?;
            polygons.push(&corners);
        }
        return Ok(polygons);
    }
    let kind: String = value
        .getattr("dtype")
        .and_then(|dtype| dtype.getattr("kind")?.extract())
        .map_err(|_| {
            input(format!(
                "{name}: expected an integer array of shape (F, corners), got {}",
                describe(value)
            ))
        })?;
    if kind != "i" && kind != "u" {
        return Err(input(format!(
            "{name}: expected whole numbers, got {}",
            describe(value)
        )));
    }
    let array: PyArrayLike2<'_, i64, AllowTypeChange> = value.extract().map_err(|_| {
        input(format!(
            "{name}: expected shape (F, corners), got {}",
            describe(value)
        ))
    })?;
    for (face, row) in array.as_array().rows().into_iter().enumerate() {
        let corners: Vec<u32> = row
            .iter()
            .map(|&c| index(face, c))
            .collect::<PyResult<_>>()?;
        polygons.push(&corners);
    }
    Ok(polygons)
}

/// One number per entry of something, from anything that NumPy makes an (N,) array from.
pub(crate) fn numbers(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = value.extract().map_err(|_| {
        input(format!(
            "{name}: expected an array of numbers of shape (N,), got {}",
            describe(value)
        ))
    })?;
    Ok(array.as_array().iter().copied().collect())
}

/// Rows of numbers: (row count, column count, values row by row).
pub(crate) fn table(name: &str, value: &Bound<'_, PyAny>) -> PyResult<(usize, usize, Vec<f64>)> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = value.extract().map_err(|_| {
        input(format!(
            "{name}: expected an array of numbers of shape (N, M), got {}",
            describe(value)
        ))
    })?;
    let view = array.as_array();
    Ok((view.nrows(), view.ncols(), view.iter().copied().collect()))
}

/// A grid of vectors, row by row.
pub(crate) struct Grid {
    pub(crate) rows: u32,
    pub(crate) columns: u32,
    pub(crate) points: Vec<Point3<f32>>,
}

/// Grids from a sequence of anything that NumPy makes (rows, columns, 3) arrays from.
pub(crate) fn grids(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Grid>> {
    let items = value.try_iter().map_err(|_| {
        input(format!(
            "{name}: expected a sequence of arrays of shape (rows, columns, 3), got {}",
            describe(value)
        ))
    })?;
    items
        .enumerate()
        .map(|(index, item)| {
            let item = item?;
            let wrong = || {
                input(format!(
                    "{name}: patch {index}: expected numbers of shape (rows, columns, 3), got {}",
                    describe(&item)
                ))
            };
            let array: PyArrayLike3<'_, f32, AllowTypeChange> =
                item.extract().map_err(|_| wrong())?;
            let view = array.as_array();
            let (rows, columns, axes) = view.dim();
            let (Ok(rows), Ok(columns), 3) = (u32::try_from(rows), u32::try_from(columns), axes)
            else {
                return Err(wrong());
            };
            let points = view
                .rows()
                .into_iter()
                .map(|row| Point3::new(row[0], row[1], row[2]))
                .collect();
            Ok(Grid {
                rows,
                columns,
                points,
            })
        })
        .collect()
}

/// A vector of three finite numbers.
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f32; 3]> {
    match numbers(name, value)?[..] {
        [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => {
            Ok([x as f32, y as f32, z as f32])
        }
        _ => Err(input(format!("{name}: expected three finite numbers"))),
    }
}

/// What an argument is, for messages: its shape and type where it is an array.
fn describe(value: &Bound<'_, PyAny>) -> String {
    let text = |name: &str| {
        value
            .getattr(name)
            .and_then(|a| a.str())
            .map(|s| s.to_string())
    };
    match (text("shape"), text("dtype")) {
        (Ok(shape), Ok(dtype)) => format!("shape {shape} of {dtype}"),
        _ => value
            .get_type()
            .name()
            .map_or_else(|_| "something else".to_owned(), |name| name.to_string()),
    }
}

/// A fresh (N, K) array of numbers that lie row by row.
pub(crate) fn from_rows<'py, T: Element + Copy>(
    py: Python<'py>,
    columns: usize,
    numbers: &[T],
) -> Bound<'py, PyArray2<T>> {
    let rows = numbers.len() / columns.max(1);
    let whole = numbers[..rows * columns].to_vec();
    match Array2::from_shape_vec((rows, columns), whole) {
        Ok(array) => array.into_pyarray(py),
        // Lengths agree by construction; an empty array would show it if they did not.
        Err(_) => PyArray2::zeros(py, [0, columns], false),
    }
}

/// A fresh (N, 3) array.
pub(crate) fn from_points<'py>(py: Python<'py>, points: &[Point]) -> Bound<'py, PyArray2<f64>> {
    from_rows(py, 3, bytemuck::cast_slice(points))
}

/// A fresh (N, 3) array.
pub(crate) fn from_points_f32<'py>(
    py: Python<'py>,
    points: &[Point3<f32>],
) -> Bound<'py, PyArray2<f32>> {
    from_rows(py, 3, bytemuck::cast_slice(points))
}

/// Puts points into the caller's own (N, 3) array of 32- or 64-bit floats.
pub(crate) fn into_out(out: &Bound<'_, PyAny>, points: &[Point3<f64>]) -> PyResult<()> {
    if let Ok(mut array) = out.extract::<PyReadwriteArray2<'_, f64>>() {
        return fill(array.as_array_mut(), points, |x| x);
    }
    if let Ok(mut array) = out.extract::<PyReadwriteArray2<'_, f32>>() {
        return fill(array.as_array_mut(), points, |x| x as f32);
    }
    Err(input(format!(
        "out: expected a writable array of 32- or 64-bit floats of shape ({}, 3), got {}",
        points.len(),
        describe(out)
    )))
}

fn fill<T>(
    mut out: ArrayViewMut2<'_, T>,
    points: &[Point3<f64>],
    number: impl Fn(f64) -> T,
) -> PyResult<()> {
    if out.dim() != (points.len(), 3) {
        return Err(input(format!(
            "out: expected shape ({}, 3), got {:?}",
            points.len(),
            out.dim()
        )));
    }
    for (mut row, point) in out.rows_mut().into_iter().zip(points) {
        for axis in 0..3 {
            row[axis] = number(point[axis]);
        }
    }
    Ok(())
}

/// A fresh (N, corners) array of triangles.
pub(crate) fn from_triangles<'py>(
    py: Python<'py>,
    triangles: &[[u32; 3]],
) -> Bound<'py, PyArray2<u32>> {
    from_rows(py, 3, bytemuck::cast_slice(triangles))
}

/// A fresh (4, 4) array.
pub(crate) fn from_matrix<'py>(
    py: Python<'py>,
    matrix: &nalgebra::Matrix4<f64>,
) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((4, 4), |(row, column)| matrix[(row, column)]).into_pyarray(py)
}

/// A rigid motion from a (4, 4) matrix.
pub(crate) fn rigid(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Isometry3<f64>> {
    let (rows, columns, numbers) = table(name, value)?;
    let wrong = |what: &str| input(format!("{name}: expected a rigid motion (4, 4), {what}"));
    if (rows, columns) != (4, 4) {
        return Err(wrong(&format!("got shape ({rows}, {columns})")));
    }
    let matrix = Matrix4::from_row_slice(&numbers);
    let turn = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let is_turn = (turn * turn.transpose() - Matrix3::identity()).abs().max() < 1e-4
        && turn.determinant() > 0.0;
    let is_last = (matrix.row(3) - RowVector4::new(0.0, 0.0, 0.0, 1.0))
        .abs()
        .max()
        < 1e-9;
    // A matrix with NaN fails both.
    if !(is_turn && is_last && numbers.iter().all(|x| x.is_finite())) {
        return Err(wrong(
            "its upper left is no rotation or its last row not 0 0 0 1",
        ));
    }
    let rotation = UnitQuaternion::from_matrix(&turn);
    let translation = Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    Ok(Isometry3::from_parts(translation, rotation))
}

/// Anything serializable as Python dicts and lists.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    value: &impl serde::Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|e| input(e.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// What `__reduce__` returns: the function of `fabrig._pickle` that makes the object again, and
/// its bytes.
pub(crate) fn restored_by<'py>(
    py: Python<'py>,
    function: &str,
    bytes: &[u8],
) -> PyResult<Bound<'py, PyTuple>> {
    let function = py.import("fabrig._pickle")?.getattr(function)?;
    let arguments = (PyBytes::new(py, bytes),).into_pyobject(py)?;
    PyTuple::new(py, [function, arguments.into_any()])
}
