//! glTF models: the triangles of the default scene, in world space, in their materials' base colour, and translucent
//! where a material blends. Textures, skins, cameras and animations are passed over.

use std::path::{Path, PathBuf};

use base64::Engine;
use gltf::accessor::{DataType, Dimensions};
use gltf::material::AlphaMode;
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Semantic};
use hankel_dsl::glam::{Affine3A, Mat4, Vec3};
use hankel_system::input;

use super::FAR_OFF;
use super::error::{Result, SceneError};
use super::mesh::Mesh;

/// Most triangles of a model: more would not fit the index buffers of a common device.
pub const MAX_TRIANGLES: usize = 10_000_000;

/// Most vertices of a model: as many as the most triangles have corners.
pub const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;

/// Most bytes of a model, with all the files that it names.
const MAX_BYTES: u64 = 2 << 30;

/// Loads the default scene (else the first) of a `.gltf` or `.glb` file. Normals that are missing
/// are computed, smooth over shared vertices.
///
/// Without textures a primitive has one alpha, that of its `baseColorFactor`. With `alphaMode` `BLEND` it is the opacity
/// of its vertices. With `MASK` it is there if its alpha is at least `alphaCutoff`, and left out otherwise. With `OPAQUE`
/// alpha does not count (glTF 2.0, "Alpha Coverage").
///
/// # Errors
/// [`SceneError::Read`] and [`SceneError::Model`]; [`SceneError::Empty`] for a model without
/// triangles that are drawn.
pub fn load(file: &Path) -> Result<Mesh> {
    let bytes = input::read(file, MAX_BYTES)?;
    Loader {
        file,
        mesh: Mesh::default(),
        room: MAX_BYTES - bytes.len() as u64,
    }
    .load(&bytes)
}

/// The files that a model is read from: its own, and those of its buffers.
pub fn files(file: &Path) -> Vec<PathBuf> {
    let mut files = vec![file.to_path_buf()];
    // What is wrong with it is told when it is loaded.
    let bytes = input::read(file, MAX_BYTES).unwrap_or_default();
    if let Ok(Gltf { document, .. }) = Gltf::from_slice_without_validation(&bytes) {
        let uris = document.into_json().buffers.into_iter();
        let uris = uris.filter_map(|buffer| buffer.uri);
        let is_file = |uri: &String| !uri.starts_with("data:") && !uri.contains("://");
        files.extend(uris.filter(is_file).map(|uri| beside(file, &uri)));
    }
    files
}

/// The file that a model's `uri` names.
fn beside(file: &Path, uri: &str) -> PathBuf {
    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
    file.parent().unwrap_or(Path::new("")).join(name.as_ref())
}

/// The vertices and triangles of a primitive, by what it says of itself; those that are passed over have none.
fn counts(primitive: &gltf::Primitive<'_>) -> [usize; 2] {
    let positions = primitive.get(&Semantic::Positions);
    let vertices = positions.map_or(0, |accessor| accessor.count());
    let indices = primitive.indices();
    let corners = indices.map_or(vertices, |accessor| accessor.count());
    match primitive.mode() {
        Mode::Triangles => [vertices, corners / 3],
        Mode::TriangleStrip | Mode::TriangleFan => [vertices, corners.saturating_sub(2)],
        _ => [0, 0],
    }
}

struct Loader<'a> {
    file: &'a Path,
    mesh: Mesh,
    /// Bytes that may still be read.
    room: u64,
}

impl Loader<'_> {
    fn fail<T>(&self, problem: impl Into<String>) -> Result<T> {
        Err(SceneError::Model {
            file: self.file.to_path_buf(),
            problem: problem.into(),
        })
    }

    fn load(mut self, bytes: &[u8]) -> Result<Mesh> {
        // The reader subtracts the header's size from this length.
        if bytes.starts_with(b"glTF") {
            let length = bytes
                .get(8..12)
                .and_then(|b| b.try_into().ok())
                .map_or(0, u32::from_le_bytes);
            if length < 12 || length as usize > bytes.len() {
                return self.fail(format!(
                    "the header announces {length} bytes, the file has {}: it is truncated or damaged",
                    bytes.len()
                ));
            }
        }
        let bad = |e: gltf::Error| SceneError::Model {
            file: self.file.to_path_buf(),
            problem: format!("no valid glTF 2.0: {e}"),
        };
        let Gltf { document, mut blob } =
            Gltf::from_slice_without_validation(bytes).map_err(bad)?;
        let root = document.into_json();
        let least = root.asset.min_version.as_deref();
        let version = least.unwrap_or(&root.asset.version);
        if version.split('.').next() != Some("2") {
            return self.fail(format!(
                "its glTF version is {version}, and only 2 can be read"
            ));
        }
        // The validation that comes next takes this for granted.
        for (i, mesh) in root.meshes.iter().enumerate() {
            let attributes = mesh.primitives.iter().flat_map(|p| p.attributes.values());
            if attributes
                .into_iter()
                .any(|a| a.value() >= root.accessors.len())
            {
                return self.fail(format!("mesh {i}: an attribute's accessor is missing"));
            }
        }
        let document = gltf::Document::from_json(root).map_err(bad)?;
        let mut buffers = Vec::new();
        for b in document.buffers() {
            buffers.push(self.buffer(&b, &mut blob)?);
        }
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        let mut open: Vec<_> = match scene {
            Some(scene) => scene.nodes().map(|n| (n, Mat4::IDENTITY)).collect(),
            None => return self.fail("it has no scene"),
        };
        let mut seen = vec![false; document.nodes().count()];
        let mut placed = Vec::new();
        let [mut vertices, mut triangles] = [0_usize; 2];
        while let Some((node, parent)) = open.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                return self.fail(format!(
                    "node {} is reached twice: nodes must form a tree",
                    node.index()
                ));
            }
            let matrix = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
            if !matrix.is_finite() {
                return self.fail(format!(
                    "node {}: its transform is not finite",
                    node.index()
                ));
            }
            if let Some(mesh) = node.mesh() {
                // Before any of them takes memory: many nodes may have the same mesh.
                for primitive in mesh.primitives() {
                    let [more_vertices, more_triangles] = counts(&primitive);
                    vertices = vertices.saturating_add(more_vertices);
                    triangles = triangles.saturating_add(more_triangles);
                    for (count, most, what) in [
                        (vertices, MAX_VERTICES, "vertices"),
                        (triangles, MAX_TRIANGLES, "triangles"),
                    ] {
                        if count > most {
                            return self.fail(format!(
                                "with mesh {} of node {}, it has more than {most} {what}: \
                                 simplify its meshes or leave nodes out",
                                mesh.index(),
                                node.index()
                            ));
                        }
                    }
                }
                placed.push((mesh, matrix));
            }
            open.extend(node.children().map(|n| (n, matrix)));
        }
        for (mesh, matrix) in placed {
            for primitive in mesh.primitives() {
                let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
                let mut part = self.primitive(&primitive, &buffers, &place)?;
                part.transform(&Affine3A::from_mat4(matrix));
                self.mesh.append(&part);
            }
        }
        let far_off = |p: &&Vec3| !p.is_finite() || p.abs().max_element() > FAR_OFF;
        if let Some(p) = self.mesh.positions.iter().find(far_off) {
            return self.fail(format!(
                "it reaches to {p}, beyond ±{FAR_OFF}, where single precision is too coarse: \
                 scale it or move it to the origin"
            ));
        }
        self.mesh.drop_degenerate();
        if self.mesh.triangles.is_empty() {
            return Err(SceneError::Empty {
                what: self.file.display().to_string(),
            });
        }
        Ok(self.mesh)
    }

    fn buffer(&mut self, buffer: &gltf::Buffer<'_>, blob: &mut Option<Vec<u8>>) -> Result<Vec<u8>> {
        let index = buffer.index();
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => match blob.take() {
                Some(blob) => blob,
                None => return self.fail(format!("buffer {index} is missing: no binary chunk")),
            },
            gltf::buffer::Source::Uri(uri) => self.uri(uri, index)?,
        };
        if data.len() < buffer.length() {
            return self.fail(format!(
                "buffer {index} has {} bytes, {} were announced",
                data.len(),
                buffer.length()
            ));
        }
        Ok(data)
    }

    fn uri(&mut self, uri: &str, index: usize) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, text)) = data.split_once(";base64,") else {
                return self.fail(format!("buffer {index}: a data URI must be base64"));
            };
            return base64::engine::general_purpose::STANDARD
                .decode(text)
                .or_else(|e| self.fail(format!("buffer {index}: bad base64: {e}")));
        }
        if uri.contains("://") {
            return self.fail(format!("buffer {index} lies at {uri}: only files are read"));
        }
        let path = beside(self.file, uri);
        let data =
            input::read(&path, self.room).or_else(|e| self.fail(format!("buffer {index}: {e}")))?;
        self.room -= data.len() as u64;
        Ok(data)
    }

    fn primitive(
        &self,
        primitive: &gltf::Primitive<'_>,
        buffers: &[Vec<u8>],
        place: &str,
    ) -> Result<Mesh> {
        let mode = primitive.mode();
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            return Ok(Mesh::default());
        }
        let Some(accessor) = primitive.get(&Semantic::Positions) else {
            return self.fail(format!("{place}: it has no positions"));
        };
        let positions = self.vectors(&accessor, buffers, &format!("{place}, positions"))?;
        let indices = match primitive.indices() {
            Some(accessor) => self.indices(&accessor, buffers, &format!("{place}, indices"))?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(bad) = indices.iter().find(|&&i| i as usize >= positions.len()) {
            return self.fail(format!(
                "{place}: index {bad} is out of range, there are {} vertices",
                positions.len()
            ));
        }
        let triangles = match mode {
            Mode::TriangleStrip => indices
                .windows(3)
                .enumerate()
                .map(|(i, w)| {
                    if i % 2 == 0 {
                        [w[0], w[1], w[2]]
                    } else {
                        [w[1], w[0], w[2]]
                    }
                })
                .collect(),
            Mode::TriangleFan => indices
                .windows(2)
                .skip(1)
                .map(|w| [indices[0], w[0], w[1]])
                .collect(),
            _ if indices.len() % 3 != 0 => {
                return self.fail(format!(
                    "{place}: {} indices are no triangles",
                    indices.len()
                ));
            }
            _ => indices
                .chunks_exact(3)
                .map(|c| [c[0], c[1], c[2]])
                .collect(),
        };
        let mut mesh = Mesh {
            positions,
            triangles,
            ..Mesh::default()
        };
        let material = primitive.material();
        let colour = material.pbr_metallic_roughness().base_color_factor();
        // The material of those that name none is white.
        if let Some(index) = material.index()
            && !colour.iter().all(|c| (0.0..=1.0).contains(c))
        {
            return self.fail(format!(
                "{place}, material {index}: its baseColorFactor is {colour:?}, but must be four \
                 numbers from 0 to 1"
            ));
        }
        let [r, g, b, alpha] = colour;
        match material.alpha_mode() {
            AlphaMode::Opaque => {}
            AlphaMode::Mask if alpha < material.alpha_cutoff().unwrap_or(0.5) => {
                return Ok(Mesh::default());
            }
            AlphaMode::Mask => {}
            AlphaMode::Blend if alpha < 1.0 => mesh.fade(alpha),
            AlphaMode::Blend => {}
        }
        mesh.paint(Vec3::new(r, g, b));
        match primitive.get(&Semantic::Normals) {
            Some(accessor) => {
                if accessor.count() != mesh.positions.len() {
                    return self.fail(format!(
                        "{place}: {} positions, but {} normals",
                        mesh.positions.len(),
                        accessor.count()
                    ));
                }
                mesh.normals = self.vectors(&accessor, buffers, &format!("{place}, normals"))?;
                for n in &mut mesh.normals {
                    *n = n.try_normalize().unwrap_or(Vec3::Y);
                }
            }
            None => mesh.compute_normals(),
        }
        Ok(mesh)
    }

    fn vectors(
        &self,
        accessor: &Accessor<'_>,
        buffers: &[Vec<u8>],
        place: &str,
    ) -> Result<Vec<Vec3>> {
        if accessor.data_type() != DataType::F32 || accessor.dimensions() != Dimensions::Vec3 {
            return self.fail(format!("{place}: three 32-bit floats each are expected"));
        }
        let mut bad = None;
        let vectors = self
            .elements::<12>(accessor, buffers, place)?
            .enumerate()
            .map(|(i, b)| {
                let f = |k: usize| f32::from_le_bytes([b[k], b[k + 1], b[k + 2], b[k + 3]]);
                let v = Vec3::new(f(0), f(4), f(8));
                if !v.is_finite() {
                    bad.get_or_insert(i);
                }
                v
            })
            .collect();
        match bad {
            Some(i) => self.fail(format!("{place}: element {i} is not finite")),
            None => Ok(vectors),
        }
    }

    fn indices(
        &self,
        accessor: &Accessor<'_>,
        buffers: &[Vec<u8>],
        place: &str,
    ) -> Result<Vec<u32>> {
        if accessor.dimensions() != Dimensions::Scalar {
            return self.fail(format!("{place}: scalars are expected"));
        }
        Ok(match accessor.data_type() {
            DataType::U8 => self
                .elements::<1>(accessor, buffers, place)?
                .map(|b| b[0].into())
                .collect(),
            DataType::U16 => self
                .elements::<2>(accessor, buffers, place)?
                .map(|b| u16::from_le_bytes(b).into())
                .collect(),
            DataType::U32 => self
                .elements::<4>(accessor, buffers, place)?
                .map(u32::from_le_bytes)
                .collect(),
            _ => return self.fail(format!("{place}: unsigned integers are expected")),
        })
    }

    /// The bytes of an accessor's elements, `N` each.
    fn elements<'b, const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        buffers: &'b [Vec<u8>],
        place: &str,
    ) -> Result<impl Iterator<Item = [u8; N]> + use<'b, N>> {
        if accessor.sparse().is_some() {
            return self.fail(format!("{place}: sparse accessors are not read"));
        }
        let Some(view) = accessor.view() else {
            return self.fail(format!(
                "{place}: there is no data (compressed models are not read)"
            ));
        };
        let stride = view.stride().unwrap_or(N);
        let count = accessor.count();
        let data = (|| {
            let view_end = view.offset().checked_add(view.length())?;
            let data = buffers
                .get(view.buffer().index())?
                .get(view.offset()..view_end)?;
            let last = stride.checked_mul(count.checked_sub(1)?)?;
            let end = accessor.offset().checked_add(last)?.checked_add(N)?;
            data.get(accessor.offset()..end)
        })();
        match data {
            Some(data) if stride >= N => {
                // The last stride may be cut short after the element.
                Ok(data.chunks(stride).filter_map(|c| c.first_chunk().copied()))
            }
            _ => self.fail(format!(
                "{place}: {count} elements {stride} bytes apart do not fit buffer view {}",
                view.index()
            )),
        }
    }
}
