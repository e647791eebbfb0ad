//! Raw triangles to a [`Mesh`] that later floors can rely on: finite positions, unit normals, no degenerate triangles.
//!
//! Works in object space; every mend is counted.

use crate::notes::Notes;
use crate::scene::Mesh;

/// Cleans a mesh whose indices are in range. `element` names it in the notes.
pub(crate) fn clean(mut mesh: Mesh, element: &str, notes: &mut Notes) -> Mesh {
    let finite: Vec<bool> = mesh.positions.iter().map(|p| p.iter().all(|c| c.is_finite())).collect();
    let all_finite = finite.iter().all(|ok| *ok);
    let (mut broken, mut degenerate) = (0u64, 0u64);
    let positions = &mesh.positions;
    mesh.triangles.retain(|triangle| {
        if !all_finite && !triangle.iter().all(|i| finite.get(*i as usize) == Some(&true)) {
            broken += 1;
            return false;
        }
        let keep = cross(positions, *triangle).is_some_and(|n| n != [0.0; 3]);
        degenerate += u64::from(!keep);
        keep
    });
    notes.repair("triangles with infinite or NaN corners dropped", element, broken);
    notes.repair("degenerate triangles dropped", element, degenerate);
    if !all_finite {
        drop_unused_vertices(&mut mesh);
    }
    mend_normals(&mut mesh, element, notes);
    mend_uvs(&mut mesh, element, notes);
    mesh
}

/// Twice the area times the normal, in f64: differences of f32 numbers of like size are exact there, so that zero means
/// zero. `None` when an index is out of range.
fn cross(positions: &[[f32; 3]], triangle: [u32; 3]) -> Option<[f64; 3]> {
    let [a, b, c] = triangle.map(|i| positions.get(i as usize).map(|p| p.map(f64::from)));
    let (a, b, c) = (a?, b?, c?);
    let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    Some([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
}

/// Removes vertices that no triangle uses; called where some of them are not finite.
fn drop_unused_vertices(mesh: &mut Mesh) {
    let mut new_index = vec![u32::MAX; mesh.positions.len()];
    let mut kept = Vec::new();
    for index in mesh.triangles.iter_mut().flatten() {
        if let Some(new) = new_index.get_mut(*index as usize) {
            if *new == u32::MAX {
                // At most as many as there were: fits.
                *new = kept.len() as u32;
                kept.push(*index as usize);
            }
            *index = *new;
        }
    }
    fn pick<T: Copy>(items: &[T], kept: &[usize]) -> Vec<T> {
        kept.iter().filter_map(|i| items.get(*i).copied()).collect()
    }
    mesh.positions = pick(&mesh.positions, &kept);
    mesh.normals = mesh.normals.as_deref().map(|n| pick(n, &kept));
    mesh.uvs = mesh.uvs.as_deref().map(|uv| pick(uv, &kept));
    mesh.colors = mesh.colors.as_deref().map(|c| pick(c, &kept));
}

/// Makes normals unit; replaces those that have no direction by the area-weighted geometric normal of the vertex.
fn mend_normals(mesh: &mut Mesh, element: &str, notes: &mut Notes) {
    let Some(normals) = &mut mesh.normals else { return };
    let mut bad = Vec::new();
    for (i, normal) in normals.iter_mut().enumerate() {
        match unit(normal.map(f64::from)) {
            Some(n) => *normal = n,
            None => bad.push(i),
        }
    }
    if bad.is_empty() {
        return;
    }
    let mut sums = vec![[0.0f64; 3]; normals.len()];
    for triangle in &mesh.triangles {
        let Some(n) = cross(&mesh.positions, *triangle) else { continue };
        for index in triangle {
            if let Some(sum) = sums.get_mut(*index as usize) {
                for (s, c) in sum.iter_mut().zip(n) {
                    *s += c;
                }
            }
        }
    }
    for i in &bad {
        if let (Some(normal), Some(sum)) = (normals.get_mut(*i), sums.get(*i)) {
            // No direction at all: the vertex is unused, or its triangles cancel. Any unit vector will do.
            *normal = unit(*sum).unwrap_or([0.0, 0.0, 1.0]);
        }
    }
    notes.repair("zero or NaN normals replaced by geometric ones", element, bad.len() as u64);
}

/// `v` scaled to length 1, or `None` when it has no direction. Scaled by its largest component first, so that squares
/// neither overflow nor vanish.
fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    let largest = v.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    if !(largest > 0.0 && largest.is_finite() && v.iter().all(|c| c.is_finite())) {
        return None;
    }
    let v = v.map(|c| c / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    Some(v.map(|c| (c / length) as f32))
}

fn mend_uvs(mesh: &mut Mesh, element: &str, notes: &mut Notes) {
    let mut bad = 0;
    for uv in mesh.uvs.iter_mut().flatten() {
        if !uv.iter().all(|c| c.is_finite()) {
            *uv = [0.0; 2];
            bad += 1;
        }
    }
    notes.repair("infinite or NaN texture coordinates set to 0", element, bad);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh { positions: positions.into(), triangles: triangles.into(), ..Mesh::default() }
    }

    #[test]
    fn broken_and_degenerate_triangles_go_and_the_others_stay() {
        let positions = [[0.0; 3], [f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]];
        let mut raw = mesh(&positions, &[[0, 1, 2], [0, 2, 3], [0, 2, 4], [3, 3, 2], [2, 4, 3]]);
        raw.uvs = Some(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, f32::INFINITY], [4.0, 4.0]]);
        let mut notes = Notes::default();
        let clean = clean(raw, "m", &mut notes);
        assert_eq!(clean.triangles, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(clean.positions, [positions[0], positions[2], positions[3], positions[4]]);
        assert_eq!(clean.uvs.unwrap(), [[0.0, 0.0], [2.0, 2.0], [0.0, 0.0], [4.0, 4.0]]);
        let counts: Vec<_> = notes.into_lists().1.into_iter().map(|r| r.count).collect();
        assert_eq!(counts, [1, 2, 1]);
    }

    #[test]
    fn tiny_and_huge_triangles_are_not_degenerate() {
        for scale in [1e-38f32, 1e-20, 1e18, 3e38] {
            let raw = mesh(&[[0.0; 3], [scale, 0.0, 0.0], [0.0, scale, 0.0]], &[[0, 1, 2]]);
            assert_eq!(clean(raw, "m", &mut Notes::default()).triangles.len(), 1, "{scale}");
        }
    }

    #[test]
    fn normals_become_unit_or_geometric() {
        let mut raw = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3]], &[[0, 1, 2]]);
        raw.normals = Some(vec![[0.0, 3e38, 0.0], [0.0; 3], [f32::NAN, 0.0, 1.0], [1e-40, 0.0, 0.0]]);
        let mut notes = Notes::default();
        let normals = clean(raw, "m", &mut notes).normals.unwrap();
        assert_eq!(normals, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        assert_eq!(notes.into_lists().1[0].count, 2);
    }
}
