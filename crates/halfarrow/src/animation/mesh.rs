//! Surfaces of triangles, from STL files.

use serde::Serialize;

/// A surface of triangles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mesh {
    /// The corners, nine numbers a triangle.
    pub corners: Vec<f32>,
}

impl Mesh {
    /// Reads a file of triangles (STL), as text or binary.
    ///
    /// # Errors
    /// Why it is none.
    pub(super) fn of_stl(bytes: &[u8]) -> Result<Mesh, String> {
        let corners = match binary(bytes) {
            Some(corners) => corners,
            None => text(bytes)?,
        };
        if corners.is_empty() {
            return Err("there is no triangle in it".to_string());
        }
        if !corners.iter().all(|x| x.is_finite()) {
            return Err("a corner of a triangle is no number".to_string());
        }
        Ok(Mesh { corners })
    }

    /// The same surface, so many times as large.
    pub(super) fn scaled(&self, scale: f64) -> Mesh {
        Mesh { corners: self.corners.iter().map(|x| (f64::from(*x) * scale) as f32).collect() }
    }

    /// How far its corners lie from the origin, at most.
    pub(super) fn reach(&self) -> f64 {
        let far = |c: &[f32]| c.iter().map(|x| f64::from(*x) * f64::from(*x)).sum::<f64>();
        self.corners.chunks_exact(3).map(far).fold(0.0, f64::max).sqrt()
    }
}

/// A head of 80 bytes, the number of triangles, and 50 bytes for each: a normal, three corners, two bytes more.
fn binary(bytes: &[u8]) -> Option<Vec<f32>> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    if bytes.len() - 84 != count.checked_mul(50)? {
        return None;
    }
    let number = |four: &[u8]| f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
    Some(bytes[84..].chunks_exact(50).flat_map(|t| t[12..48].chunks_exact(4).map(number)).collect())
}

/// `vertex x y z`, three times a triangle.
fn text(bytes: &[u8]) -> Result<Vec<f32>, String> {
    let none = || "it is no STL file, neither as text nor binary".to_string();
    let text = std::str::from_utf8(bytes).map_err(|_| none())?;
    if !text.trim_start().starts_with("solid") {
        return Err(none());
    }
    let mut corners = Vec::new();
    let mut words = text.split_ascii_whitespace();
    while let Some(word) = words.next() {
        if word == "vertex" {
            for _ in 0..3 {
                let number = words.next().and_then(|x| x.parse().ok());
                corners.push(number.ok_or_else(|| "a corner of a triangle has not three numbers".to_string())?);
            }
        }
    }
    match corners.len() % 9 {
        0 => Ok(corners),
        _ => Err("a triangle of it has not three corners".to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_files() {
        let words = "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1e3 0 0\nvertex 0 2e3 0\nendloop\nendfacet\nendsolid t\n";
        let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0];
        assert_eq!(Mesh::of_stl(words.as_bytes()).expect("a surface").scaled(1e-3).corners, corners);
        let mut bytes = vec![b' '; 80];
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([0.0f32; 3].iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(corners.iter().flat_map(|x: &f32| x.to_le_bytes()));
        bytes.extend([0; 2]);
        let mesh = Mesh::of_stl(&bytes).expect("a surface");
        assert_eq!((mesh.reach(), mesh.corners.as_slice()), (2.0, corners.as_slice()));
        assert!(Mesh::of_stl(&bytes[..100]).is_err());
        assert!(Mesh::of_stl(b"solid\nvertex 1 2\n").is_err());
        assert!(Mesh::of_stl(b"solid\nendsolid\n").is_err());
    }
}
