//! USD as text: a mesh with its polygons, texture coordinates and materials, and either
//! UsdSkel blend shapes with an animation of their weights, or points at every frame.
//!
//! Source: Pixar, Universal Scene Description: UsdGeom, UsdSkel, UsdShade schemas.

use std::io::{self, Write};
use std::path::Path;

use super::ExportError;
use super::face::{ExportFace, Frame, Shape, WeightAnimation, single};
use super::usda_text::{counts, list, matrix, prim_names, quoted, tuple, tuples};
use crate::Vector;
use crate::atomic_file::write_atomically;

/// Begins a layer.
///
/// - `last_frame` and `fps` of its animation, if it has one
pub(super) fn begin(
    out: &mut dyn Write,
    face: &ExportFace,
    animation: Option<(usize, f64)>,
) -> io::Result<()> {
    let name = &prim_names([face.name.as_str()])[0];
    let metres = face.placement.millimetres_per_unit / 1000.0;
    writeln!(out, "#usda 1.0\n(\n    defaultPrim = \"{name}\"")?;
    let generator = concat!("fabrig ", env!("CARGO_PKG_VERSION"));
    writeln!(out, "    doc = {}", quoted(generator))?;
    writeln!(out, "    metersPerUnit = {metres}\n    upAxis = \"Y\"")?;
    if let Some((last_frame, fps)) = animation {
        writeln!(out, "    startTimeCode = 0\n    endTimeCode = {last_frame}")?;
        writeln!(
            out,
            "    timeCodesPerSecond = {fps}\n    framesPerSecond = {fps}"
        )?;
    }
    writeln!(out, ")\n")
}

/// A face with blend shapes, and the animation of their weights.
pub(super) fn write_shapes(
    out: &mut dyn Write,
    face: &ExportFace,
    shapes: &[Shape],
    animation: Option<&WeightAnimation>,
    pictures: &[String],
) -> io::Result<()> {
    let root = &prim_names([face.name.as_str()])[0];
    let names = prim_names(shapes.iter().map(|s| s.name.as_str()));
    writeln!(
        out,
        "def SkelRoot \"{root}\" (\n    prepend apiSchemas = [\"SkelBindingAPI\"]\n)\n{{"
    )?;
    let animation_heads = animation.map_or(&[][..], |a| &a.heads);
    if !animation_heads.is_empty() {
        writeln!(out, "    matrix4d xformOp:transform.timeSamples = {{")?;
        for (frame, head) in animation_heads.iter().enumerate() {
            writeln!(out, "        {frame}: {},", matrix(head))?;
        }
        writeln!(
            out,
            "    }}\n    uniform token[] xformOpOrder = [\"xformOp:transform\"]"
        )?;
    }
    // Blend shapes are bound through a skeleton; its one joint never moves.
    writeln!(
        out,
        "    def Skeleton \"Skeleton\" (\n        prepend apiSchemas = [\"SkelBindingAPI\"]\n    )\n    {{\n\
         \x20       uniform token[] joints = [\"head\"]\n\
         \x20       uniform matrix4d[] bindTransforms = [{identity}]\n\
         \x20       uniform matrix4d[] restTransforms = [{identity}]\n\
         \x20       rel skel:animationSource = </{root}/Skeleton/Animation>\n\n\
         \x20       def SkelAnimation \"Animation\"\n        {{",
        identity = matrix(&nalgebra::Isometry3::identity()),
    )?;
    let tokens = list(names.iter().map(|n| quoted(n)));
    writeln!(out, "            uniform token[] blendShapes = {tokens}")?;
    match animation {
        Some(animation) => {
            writeln!(
                out,
                "            float[] blendShapeWeights.timeSamples = {{"
            )?;
            for (frame, weights) in animation.weights.iter().enumerate() {
                writeln!(out, "                {frame}: {},", list(weights))?;
            }
            writeln!(out, "            }}")?;
        }
        None => {
            let zeros = list(shapes.iter().map(|_| 0));
            writeln!(out, "            float[] blendShapeWeights = {zeros}")?;
        }
    }
    writeln!(
        out,
        "            uniform token[] joints = [\"head\"]\n\
         \x20           quatf[] rotations = [(1, 0, 0, 0)]\n\
         \x20           half3[] scales = [(1, 1, 1)]\n\
         \x20           float3[] translations = [(0, 0, 0)]\n        }}\n    }}\n"
    )?;
    begin_mesh(out, face, root, true)?;
    let points = face.positions.iter().map(|p| single(&p.coords));
    writeln!(out, "        point3f[] points = {}", tuples(points))?;
    let normals = face.normals(&face.positions);
    writeln!(
        out,
        "        normal3f[] normals = {} (\n            interpolation = \"vertex\"\n        )",
        tuples(normals.iter().map(single))
    )?;
    writeln!(
        out,
        "        int[] primvars:skel:jointIndices = [0] (\n            elementSize = 1\n            \
         interpolation = \"constant\"\n        )\n\
         \x20       float[] primvars:skel:jointWeights = [1] (\n            elementSize = 1\n            \
         interpolation = \"constant\"\n        )\n\
         \x20       rel skel:skeleton = </{root}/Skeleton>\n\
         \x20       uniform token[] skel:blendShapes = {tokens}"
    )?;
    let targets = names.iter().map(|n| format!("</{root}/Mesh/{n}>"));
    writeln!(
        out,
        "        rel skel:blendShapeTargets = {}\n",
        list(targets)
    )?;
    for (shape, name) in shapes.iter().zip(&names) {
        write_blend_shape(out, face, shape, name, &normals)?;
    }
    end_mesh(out, face, root)?;
    write_materials(out, face, pictures)?;
    writeln!(out, "}}")
}

fn write_blend_shape(
    out: &mut dyn Write,
    face: &ExportFace,
    shape: &Shape,
    name: &str,
    normals: &[Vector],
) -> io::Result<()> {
    let mut moved = face.positions.clone();
    for (vertex, offset) in &shape.offsets {
        moved[*vertex as usize] += offset;
    }
    let turned = face.normals(&moved);
    let turns = shape.offsets.iter().map(|(v, _)| {
        let v = *v as usize;
        single(&(turned[v] - normals[v]))
    });
    writeln!(
        out,
        "        def BlendShape \"{name}\"\n        {{\n\
         \x20           uniform vector3f[] offsets = {}\n\
         \x20           uniform vector3f[] normalOffsets = {}\n\
         \x20           uniform int[] pointIndices = {}\n        }}\n",
        tuples(shape.offsets.iter().map(|(_, offset)| single(offset))),
        tuples(turns),
        list(shape.offsets.iter().map(|(v, _)| v)),
    )
}

/// Begins a face whose points are given at every frame; [`write_frame`] follows.
pub(super) fn begin_frames(out: &mut dyn Write, face: &ExportFace) -> io::Result<()> {
    let root = &prim_names([face.name.as_str()])[0];
    writeln!(out, "def Xform \"{root}\"\n{{")?;
    begin_mesh(out, face, root, false)?;
    writeln!(out, "        point3f[] points.timeSamples = {{")
}

/// The points of one frame.
pub(super) fn write_frame(
    out: &mut dyn Write,
    face: &ExportFace,
    number: usize,
    frame: &Frame,
    with_head: bool,
) -> io::Result<()> {
    let moved = face.moved(frame, with_head);
    let points = tuples(moved.iter().map(|p| single(&p.coords)));
    writeln!(out, "            {number}: {points},")
}

/// Ends what [`begin_frames`] began.
pub(super) fn end_frames(
    out: &mut dyn Write,
    face: &ExportFace,
    pictures: &[String],
) -> io::Result<()> {
    let root = &prim_names([face.name.as_str()])[0];
    writeln!(out, "        }}\n")?;
    end_mesh(out, face, root)?;
    write_materials(out, face, pictures)?;
    writeln!(out, "}}")
}

fn begin_mesh(
    out: &mut dyn Write,
    face: &ExportFace,
    root: &str,
    is_skinned: bool,
) -> io::Result<()> {
    let skinned = if is_skinned {
        ", \"SkelBindingAPI\""
    } else {
        ""
    };
    writeln!(
        out,
        "    def Mesh \"Mesh\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"{skinned}]\n    )\n    {{\n\
         \x20       uniform token subdivisionScheme = \"none\"\n\
         \x20       uniform bool doubleSided = 1\n\
         \x20       int[] faceVertexCounts = {}\n\
         \x20       int[] faceVertexIndices = {}",
        counts(&face.polygons),
        list(face.polygons.corners()),
    )?;
    if let Some(uvs) = &face.uvs {
        writeln!(
            out,
            "        texCoord2f[] primvars:st = {} (\n            interpolation = \"faceVarying\"\n        )\n\
             \x20       int[] primvars:st:indices = {}",
            tuples(uvs.coordinates.iter().copied()),
            list(&uvs.corners),
        )?;
    }
    match &face.sections[..] {
        [only] => {
            let names = prim_names(face.appearance.materials.iter().map(|m| m.name.as_str()));
            let name = &names[only.material];
            writeln!(
                out,
                "        rel material:binding = </{root}/Materials/{name}>"
            )?;
        }
        _ => writeln!(
            out,
            "        uniform token subsetFamily:materialBind:familyType = \"partition\""
        )?,
    }
    Ok(())
}

fn end_mesh(out: &mut dyn Write, face: &ExportFace, root: &str) -> io::Result<()> {
    if face.sections.len() > 1 {
        let materials = prim_names(face.appearance.materials.iter().map(|m| m.name.as_str()));
        // Beside the blend shapes, whose names they must not take.
        for section in &face.sections {
            let name = &materials[section.material];
            writeln!(
                out,
                "        def GeomSubset \"material_{name}\" (\n            prepend apiSchemas = \
                 [\"MaterialBindingAPI\"]\n        )\n        {{\n\
                 \x20           uniform token elementType = \"face\"\n\
                 \x20           uniform token familyName = \"materialBind\"\n\
                 \x20           int[] indices = {}\n\
                 \x20           rel material:binding = </{root}/Materials/{name}>\n        }}\n",
                list(&section.polygons),
            )?;
        }
    }
    writeln!(out, "    }}\n")
}

fn write_materials(out: &mut dyn Write, face: &ExportFace, pictures: &[String]) -> io::Result<()> {
    let root = &prim_names([face.name.as_str()])[0];
    let materials = &face.appearance.materials;
    let names = prim_names(materials.iter().map(|m| m.name.as_str()));
    writeln!(out, "    def Scope \"Materials\"\n    {{")?;
    for (material, name) in materials.iter().zip(&names) {
        let path = format!("/{root}/Materials/{name}");
        let [r, g, b, opacity] = material.color.map(|c| c as f32);
        writeln!(
            out,
            "        def Material \"{name}\"\n        {{\n\
             \x20           token outputs:surface.connect = <{path}/Surface.outputs:surface>\n\n\
             \x20           def Shader \"Surface\"\n            {{\n\
             \x20               uniform token info:id = \"UsdPreviewSurface\""
        )?;
        let picture = material.picture.and_then(|p| pictures.get(p));
        match picture {
            Some(_) => writeln!(
                out,
                "                color3f inputs:diffuseColor.connect = <{path}/Picture.outputs:rgb>"
            )?,
            None => writeln!(
                out,
                "                color3f inputs:diffuseColor = {}",
                tuple([r, g, b])
            )?,
        }
        writeln!(
            out,
            "                float inputs:opacity = {opacity}\n\
             \x20               float inputs:roughness = {}\n\
             \x20               float inputs:metallic = {}\n\
             \x20               token outputs:surface\n            }}",
            material.roughness, material.metallic
        )?;
        if let Some(picture) = picture {
            writeln!(
                out,
                "\n            def Shader \"Picture\"\n            {{\n\
                 \x20               uniform token info:id = \"UsdUVTexture\"\n\
                 \x20               asset inputs:file = @./{picture}@\n\
                 \x20               float4 inputs:scale = {}\n\
                 \x20               token inputs:wrapS = \"repeat\"\n\
                 \x20               token inputs:wrapT = \"repeat\"\n\
                 \x20               float2 inputs:st.connect = <{path}/Coordinates.outputs:result>\n\
                 \x20               float3 outputs:rgb\n            }}\n\n\
                 \x20           def Shader \"Coordinates\"\n            {{\n\
                 \x20               uniform token info:id = \"UsdPrimvarReader_float2\"\n\
                 \x20               string inputs:varname = \"st\"\n\
                 \x20               float2 outputs:result\n            }}",
                tuple([r, g, b, opacity])
            )?;
        }
        writeln!(out, "        }}\n")?;
    }
    writeln!(out, "    }}")
}

/// Writes the pictures of materials beside the file; returns their names and their bytes.
pub(super) fn write_pictures(
    path: &Path,
    face: &ExportFace,
) -> Result<(Vec<String>, u64), ExportError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let pictures = &face.appearance.pictures;
    let plain = prim_names(pictures.iter().map(|p| p.name.as_str()));
    let mut names = Vec::new();
    let mut bytes = 0;
    for (picture, plain) in pictures.iter().zip(plain) {
        // An at sign would end the name of the file.
        let stem = stem.replace('@', "_");
        let name = format!("{stem}_{plain}.{}", picture.extension());
        let file = path.with_file_name(&name);
        write_atomically(&file, |out| out.write_all(&picture.bytes))
            .map_err(ExportError::io(&file))?;
        bytes += picture.bytes.len() as u64;
        names.push(name);
    }
    Ok((names, bytes))
}
