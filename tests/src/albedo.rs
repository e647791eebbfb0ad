//! Albedos by quadrature of DESIGN's formulas, in f64.

use crate::world::dot;

/// ∫ g(h) D(h) cos θh dh over the hemisphere of halfway directions: GGX as DESIGN has it, in f64, by midpoints.
fn over_ggx(alpha: f64, g: impl Fn([f64; 3]) -> f64) -> f64 {
    let (rows, columns) = (1000, 500);
    let mid = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for i in 0..rows {
        // 1 − u = w²: evens out integrands that go with 1/cos θh.
        let w = mid(i, rows);
        let cos = w / (1.0 + (alpha * alpha - 1.0) * (1.0 - w * w)).sqrt();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        for j in 0..columns {
            let phi = mid(j, columns) * core::f64::consts::TAU;
            sum += 2.0 * w * g([sin * phi.cos(), sin * phi.sin(), cos]);
        }
    }
    sum / f64::from(rows * columns)
}

fn schlick(r: f64, cos: f64) -> f64 {
    r + (1.0 - r) * (1.0 - cos).powi(5)
}

/// ∫ f cos dω of the substrate.
pub fn substrate_albedo(rd: f64, rs: f64, alpha: f64, cos_o: f64) -> f64 {
    let coat = |cos: f64| 1.0 - (1.0 - 0.5 * cos).powi(5);
    // ∫ (1 − (1 − c/2)^5) c dω = 2π ∫ … dc by midpoints.
    let n = 4000;
    let mid = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
    let base: f64 =
        (0..n).map(|i| coat(mid(i)) * mid(i) / f64::from(n)).sum::<f64>() * core::f64::consts::TAU;
    let diffuse = 28.0 / (23.0 * core::f64::consts::PI) * rd * (1.0 - rs) * coat(cos_o) * base;
    let wo = [(1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o];
    let specular = over_ggx(alpha, |h| {
        let o_h = dot(wo, h);
        let cos_i = 2.0 * o_h * h[2] - wo[2];
        // D/(4 wo·h max) F cos_i · 4 wo·h dh
        if o_h > 0.0 && cos_i > 0.0 { schlick(rs, o_h) * cos_i / (cos_i.max(cos_o) * h[2]) } else { 0.0 }
    });
    diffuse + specular
}

/// ∫ f cos dω of rough metal.
pub fn metal_albedo(f0: f64, alpha: f64, cos_o: f64) -> f64 {
    let g1 = |c: f64| 2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 - c * c) / (c * c)).sqrt());
    let wo = [(1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o];
    over_ggx(alpha, |h| {
        let o_h = dot(wo, h);
        let cos_i = 2.0 * o_h * h[2] - wo[2];
        if o_h <= 0.0 || cos_i <= 0.0 {
            return 0.0;
        }
        schlick(f0, o_h) * g1(cos_o) * g1(cos_i) * o_h / (cos_o * h[2])
    })
}
