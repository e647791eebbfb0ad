//! Light samples for eight paths at once: those of [`Lights::sample`], bit for bit. Where there are lights without area each lane asks by itself.

use super::learned_lanes::ViewpointLanes;
use super::patches::Row;
use super::triangles::LightTriangle;
use super::{EnvironmentSampler, Learned, LightSample, LightTarget, Lights, Surroundings};
use crate::class::{Class, Feature, FullClass, has};
use crate::geometry::{Geometry, SurfaceTriangle};
use crate::lanes::PointLanes;
use crate::lanes::math::{FrameLanes, max_element, square_to_cosine_hemisphere, square_to_triangle, vec3};
use crate::math::{FRAC_1_PI, Frame};
use crate::scene::RenderScene;
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Mask, Simd, U8, Vectors, set_vector};
use hotspot_probe::Probe;
use hotspot_scene::Material;

/// What light samples read, row by row.
#[derive(Clone, Debug)]
pub(crate) struct LightLanes {
    tables: Tables,
    sky: Sky,
    /// Whether there are lights without area.
    points: bool,
}

/// What lies around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sky {
    Nothing,
    Constant([f32; 3]),
    Map,
}

#[derive(Clone, Debug)]
enum Tables {
    /// In registers.
    Few(Box<FewRows>),
    Many(ManyRows),
    /// No surface emits.
    None,
}

/// Numbers of a patch's row ([`Row`]), whole ones by their bits: cumulative and probability, triangles of its halves, their weights.
pub(super) const PATCH: usize = 8;
const CUMULATIVE: u32 = 0;

/// Numbers of an emissive triangle's row: primitive, density per area, edge, whether two-sided; normal,
/// error, emission; 1 / area.
const TRIANGLE: usize = 16;

/// Light samples in lanes, as [`LightSample`](super::LightSample) and [`LightTarget`](super::LightTarget) have them.
#[derive(Clone, Copy)]
pub(crate) struct LightSamples<S: Simd> {
    /// Lanes that have one; of others the fields hold anything.
    pub(crate) there: u32,
    /// Those of them that aim infinitely far away: only `wi`, `pdf` and `emission` are theirs.
    pub(crate) sky: u32,
    /// Those that aim at a place, `point.p`, which has no normal.
    pub(crate) positions: u32,
    /// Those that BSDF sampling never finds: `pdf` is a probability, `emission` an irradiance.
    pub(crate) delta: u32,
    pub(crate) wi: Vectors<S>,
    pub(crate) pdf: Floats<S>,
    pub(crate) point: PointLanes<S>,
    /// Barycentric weights of the second and third corner.
    pub(crate) uv: [Floats<S>; 2],
    /// Of the light's normal with the direction to the shading point.
    pub(crate) cos: Floats<S>,
    pub(crate) normal: Vectors<S>,
    pub(crate) two_sided: Mask<S>,
    pub(crate) primitive: Integers<S>,
    pub(crate) emission: Vectors<S>,
}

impl<S: Simd> LightSamples<S> {
    #[inline(always)]
    pub(super) fn none(s: S) -> Self {
        let zero = Floats::splat(s, 0.0);
        let nowhere = Vectors::new(zero, zero, zero);
        Self {
            there: 0,
            sky: 0,
            positions: 0,
            delta: 0,
            wi: nowhere,
            pdf: zero,
            point: PointLanes { p: nowhere, error: nowhere },
            uv: [zero; 2],
            cos: zero,
            normal: nowhere,
            two_sided: Mask::splat(s, false),
            primitive: Integers::splat(s, 0),
            emission: nowhere,
        }
    }

    /// With those of `other` in lanes `bits`.
    #[inline(always)]
    pub(crate) fn with(self, s: S, bits: u32, other: Self) -> Self {
        let these = Mask::of_bits(s, bits);
        Self {
            there: self.there & !bits | other.there & bits,
            sky: self.sky & !bits | other.sky & bits,
            positions: self.positions & !bits | other.positions & bits,
            delta: self.delta & !bits | other.delta & bits,
            wi: other.wi.or_where_not(these, self.wi),
            pdf: these.select(other.pdf, self.pdf),
            point: PointLanes {
                p: other.point.p.or_where_not(these, self.point.p),
                error: other.point.error.or_where_not(these, self.point.error),
            },
            uv: [these.select(other.uv[0], self.uv[0]), these.select(other.uv[1], self.uv[1])],
            cos: these.select(other.cos, self.cos),
            normal: other.normal.or_where_not(these, self.normal),
            two_sided: these & other.two_sided | self.two_sided.without(these),
            primitive: other.primitive.or_where_not(these, self.primitive),
            emission: other.emission.or_where_not(these, self.emission),
        }
    }
}

/// Where rows are.
trait Rows {
    /// Which patch the numbers choose, and the place in it.
    fn choose<S: Simd>(&self, s: S, lights: &Lights, numbers: [Floats<S>; 2]) -> Chosen<S>;

    /// An emissive triangle's row.
    fn triangle<S: Simd>(&self, triangle: Integers<S>) -> TriangleRow<S>;

    fn corners<S: Simd>(
        &self,
        geometry: &Geometry,
        triangle: Integers<S>,
        primitive: Integers<S>,
    ) -> [Vectors<S>; 3];
}

/// A place in patches.
struct Chosen<S: Simd> {
    x: Floats<S>,
    y: Floats<S>,
    /// Triangles of the patch's halves.
    triangles: [Integers<S>; 2],
    /// Which weights are theirs ([`PAIR`]).
    weights: [Integers<S>; 2],
}

struct TriangleRow<S: Simd> {
    primitive: Integers<S>,
    pdf_area: Floats<S>,
    edge: Floats<S>,
    two_sided: Mask<S>,
    normal: Vectors<S>,
    error: Vectors<S>,
    emission: Vectors<S>,
    inverse_area: Floats<S>,
}

impl<S: Simd> Chosen<S> {
    #[inline(always)]
    fn new(x: Floats<S>, y: Floats<S>, row: [Floats<S>; PATCH]) -> Self {
        let [_, _, first, second, of_first, of_second, ..] = row;
        Self { x, y, triangles: [first.bits(), second.bits()], weights: [of_first.bits(), of_second.bits()] }
    }
}

impl<S: Simd> TriangleRow<S> {
    #[inline(always)]
    fn new(here: [Floats<S>; 8], there: [Floats<S>; 8]) -> Self {
        let [primitive, pdf_area, edge, two_sided, nx, ny, nz, ex] = here;
        let [ey, ez, r, g, b, inverse_area, ..] = there;
        Self {
            primitive: primitive.bits(),
            pdf_area,
            edge,
            two_sided: two_sided.bits().is(1),
            normal: Vectors::new(nx, ny, nz),
            error: Vectors::new(ex, ey, ez),
            emission: Vectors::new(r, g, b),
            inverse_area,
        }
    }
}

/// At most eight patches, each of them a strip of its own, and triangles.
#[derive(Clone, Debug)]
struct FewRows {
    patches: [F8; PATCH],
    triangles: [[F8; 8]; 2],
    corners: [F8; 9],
}

/// Any number of strips, patches and triangles.
#[derive(Clone, Debug)]
struct ManyRows {
    /// Cumulative, probability, first patch and number of patches, the latter by their bits.
    strips: Vec<[f32; 4]>,
    patches: Vec<[f32; PATCH]>,
    triangles: Vec<[f32; TRIANGLE]>,
}

impl LightLanes {
    pub(crate) fn new(lights: &Lights, geometry: &Geometry, materials: &[Material]) -> Self {
        let sky = match &lights.environment {
            Surroundings::Nothing => Sky::Nothing,
            Surroundings::Constant(radiance) => Sky::Constant(radiance.to_array()),
            Surroundings::Map(_) => Sky::Map,
        };
        let row = |t: &LightTriangle| {
            let error = SurfaceTriangle::new(&geometry.triangles[t.primitive as usize]).error;
            let emission = materials[geometry.part(t.primitive).material as usize].emission.factor;
            let two_sided = f32::from_bits(t.two_sided.into());
            let mut row = [0.0; TRIANGLE];
            row[..4].copy_from_slice(&[f32::from_bits(t.primitive), t.pdf_area, t.edge, two_sided]);
            row[4..7].copy_from_slice(&t.normal.to_array());
            row[7..10].copy_from_slice(&error);
            row[10..13].copy_from_slice(&emission);
            row[13] = t.inverse_area;
            row
        };
        let triangles: Vec<[f32; TRIANGLE]> = lights.triangles.iter().map(row).collect();
        let tables = if triangles.is_empty() {
            Tables::None
        } else if let Some(patches) = lights.patches.rows_if_alone()
            && patches.len() <= 8
            && triangles.len() <= 8
        {
            let corners = |t: &LightTriangle| {
                let [[a, b, c], [d, e, f], [g, h, i]] = geometry.triangles[t.primitive as usize];
                [a, b, c, d, e, f, g, h, i]
            };
            Tables::Few(Box::new(FewRows {
                patches: columns(&patches.iter().map(patch_row).collect::<Vec<_>>()),
                triangles: [&halves(&triangles, 0), &halves(&triangles, 1)].map(|rows| columns(rows)),
                corners: columns(&lights.triangles.iter().map(corners).collect::<Vec<_>>()),
            }))
        } else {
            let (strips, patches) = lights.patches.rows();
            Tables::Many(ManyRows {
                strips: strips.into_iter().map(|row| row.map(f32::from_bits)).collect(),
                patches: patches.iter().map(patch_row).collect(),
                triangles,
            })
        };
        Self { tables, sky, points: !lights.punctual.is_empty() }
    }

    /// Whether there is an environment.
    pub(crate) fn has_sky(&self) -> bool {
        self.sky != Sky::Nothing
    }

    /// Whether there are lights without area.
    pub(crate) fn have_points(&self) -> bool {
        self.points
    }

    /// Whether there is neither.
    pub(crate) fn are_surfaces(&self) -> bool {
        !self.has_sky() && !self.points
    }

    /// What rays of lanes `escaped` in these directions meet, and the density with which [`LightLanes::sample`] takes them at surfaces whose
    /// shading normals make cosine `cos` with them.
    #[inline(always)]
    pub(crate) fn escaped<S: Simd, C: Class, P: Probe>(
        &self,
        s: S,
        lights: &Lights,
        (direction, cos): (Vectors<S>, Floats<S>),
        escaped: u32,
        probes: &mut [P; 8],
    ) -> Option<(Vectors<S>, Floats<S>)> {
        match self.sky {
            Sky::Nothing => None,
            Sky::Constant(radiance) => {
                Some((Vectors::splat(s, radiance), sky_pdf(s, lights.environment_probability, cos)))
            }
            Sky::Map if !has::<C>(Feature::EnvironmentMaps) => None,
            Sky::Map => look_up_map(s, lights, direction, escaped, probes),
        }
    }

    /// As [`Lights::sample`], seen from `p` on a surface with this shading frame, for lanes `active`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "inlined, and none goes with another")]
    pub(crate) fn sample<S: Simd, C: Class, P: Probe>(
        &self,
        s: S,
        (lights, geometry): (&Lights, &Geometry),
        p: Vectors<S>,
        frame: &FrameLanes<S>,
        [select, v]: [Floats<S>; 2],
        active: u32,
        probes: &mut [P; 8],
    ) -> LightSamples<S> {
        if self.sky == Sky::Nothing {
            return self.sample_surfaces(s, lights, geometry, p, [select, v], active);
        }
        let share = lights.environment_probability;
        let chosen = select.less(Floats::splat(s, share));
        let rest = (select - share) / Floats::splat(s, 1.0 - share);
        let sky = active & chosen.bits();
        let surfaces = self.sample_surfaces(s, lights, geometry, p, [rest, v], active & !sky);
        if sky == 0 {
            return surfaces;
        }
        let Sky::Constant(radiance) = self.sky else {
            if !has::<C>(Feature::EnvironmentMaps) {
                return surfaces;
            }
            return surfaces.with(s, sky, sample_map(s, lights, [select, v], sky, probes));
        };
        let local = square_to_cosine_hemisphere(s, select / Floats::splat(s, share), v);
        let pdf = sky_pdf(s, share, local.z);
        let sky = sky & Floats::splat(s, 0.0).less(pdf).bits();
        LightSamples {
            there: surfaces.there | sky,
            sky,
            wi: frame.to_world(local).or_where_not(chosen, surfaces.wi),
            pdf: chosen.select(pdf, surfaces.pdf),
            emission: Vectors::splat(s, radiance).or_where_not(chosen, surfaces.emission),
            ..surfaces
        }
    }

    /// A point of the patches of these rows that were chosen with `density`, by what the choice left of its number and the second number;
    /// seen from `p`, for lanes `active`.
    #[inline(always)]
    pub(super) fn sample_patches<S: Simd>(
        &self,
        s: S,
        (lights, geometry): (&Lights, &Geometry),
        p: Vectors<S>,
        (patches, row): (&[[f32; PATCH]], Integers<S>),
        [rest, v, density]: [Floats<S>; 3],
        active: u32,
    ) -> LightSamples<S> {
        let row = Floats::gather_eights(patches.as_flattened(), row.shift_left::<3>());
        let chosen = Chosen::new(rest, v, row);
        match &self.tables {
            Tables::Few(rows) => point_of(s, &**rows, lights, geometry, p, chosen, Some(density), active),
            Tables::Many(rows) => point_of(s, rows, lights, geometry, p, chosen, Some(density), active),
            Tables::None => LightSamples::none(s),
        }
    }

    #[inline(always)]
    fn sample_surfaces<S: Simd>(
        &self,
        s: S,
        lights: &Lights,
        geometry: &Geometry,
        p: Vectors<S>,
        numbers: [Floats<S>; 2],
        active: u32,
    ) -> LightSamples<S> {
        match &self.tables {
            Tables::Few(rows) => sample_of(s, &**rows, lights, geometry, p, numbers, active),
            Tables::Many(rows) if active != 0 => sample_of(s, rows, lights, geometry, p, numbers, active),
            Tables::Many(_) | Tables::None => LightSamples::none(s),
        }
    }
}

/// [`Lights::constant_pdf`].
#[inline(always)]
fn sky_pdf<S: Simd>(s: S, share: f32, cos: Floats<S>) -> Floats<S> {
    Floats::splat(s, share * FRAC_1_PI) * cos.max(Floats::splat(s, 0.0))
}

/// A point of the emissive triangles, as [`LightTriangle::sample`] takes it.
#[inline(always)]
fn sample_of<S: Simd, R: Rows>(
    s: S,
    rows: &R,
    lights: &Lights,
    geometry: &Geometry,
    p: Vectors<S>,
    numbers: [Floats<S>; 2],
    active: u32,
) -> LightSamples<S> {
    let chosen = rows.choose(s, lights, numbers);
    point_of(s, rows, lights, geometry, p, chosen, None, active)
}

/// The same of what was chosen; `density`: with which, over the triangle's area, unless by power.
#[expect(clippy::too_many_arguments, reason = "inlined, and none goes with another")]
#[inline(always)]
fn point_of<S: Simd, R: Rows>(
    s: S,
    rows: &R,
    lights: &Lights,
    geometry: &Geometry,
    p: Vectors<S>,
    Chosen { x, y, triangles, weights: which }: Chosen<S>,
    density: Option<Floats<S>>,
    active: u32,
) -> LightSamples<S> {
    let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));

    // The place in the patch. Of one that is a single triangle both halves are the same.
    let first = (x + y).less(one);
    let weights = [
        first.select(one - x - y, (x - (one - y)).max(zero)),
        first.select(x, one - y),
        first.select(y, one - x),
    ];
    let which = which[0].or_where_not(first, which[1]);
    let triangle = triangles[0].or_where_not(first, triangles[1]);
    let pair = (which & PAIR).is(PAIR);
    let b = weight(which & 3, weights);
    let c = weight(which.shift_right::<2>() & 3, weights);
    let (folded_b, folded_c) = square_to_triangle(x, y);
    let (b, c) = (pair.select(b, folded_b), pair.select(c, folded_c));

    // The point, off the triangle's edges.
    let row = rows.triangle(triangle);
    let TriangleRow { primitive, normal, two_sided, emission, .. } = row;
    let corners = rows.corners(geometry, triangle, primitive);
    let shows = zero.less(normal.dot(p - corners[0]));
    let mut there = active & (shows | two_sided).bits();
    let mut point = PointLanes::new(s, corners, row.error, b, c);
    let near_edge = b.min(c).min(one - b - c).less(row.edge).bits() & there;
    if near_edge != 0 {
        let (triangles, b, c) = (triangle.store(), b.store(), c.store());
        point = point.replaced(s, near_edge, |lane| {
            let light = &lights.triangles[triangles.0[lane] as usize];
            light.triangle.point_off_edges(b.0[lane], c.0[lane])
        });
    }
    let d = point.p - p;
    let distance2 = d.dot(d);
    let length = distance2.sqrt();
    let wi = Vectors::new(d.x / length, d.y / length, d.z / length);
    let cos = -wi.dot(normal);
    let pdf_area = match density {
        Some(density) => density * row.inverse_area,
        None => row.pdf_area,
    };
    let pdf = pdf_area * distance2 / cos.abs();
    let somewhere = Mask::splat(s, true).without(distance2.is(0.0));
    let valid = somewhere & zero.less(pdf) & pdf.less(Floats::splat(s, f32::INFINITY));
    there &= valid.bits();
    let (sky, positions, delta, uv) = (0, 0, 0, [b, c]);
    LightSamples {
        there,
        sky,
        positions,
        delta,
        wi,
        pdf,
        point,
        uv,
        cos,
        normal,
        two_sided,
        primitive,
        emission,
    }
}

/// Light samples in memory.
pub(super) struct Samples {
    there: u32,
    sky: u32,
    positions: u32,
    delta: u32,
    two_sided: u32,
    wi: [F8; 3],
    pdf: F8,
    p: [F8; 3],
    error: [F8; 3],
    uv: [F8; 2],
    cos: F8,
    normal: [F8; 3],
    primitive: U8,
    emission: [F8; 3],
}

impl Samples {
    pub(super) const NONE: Self = Self {
        there: 0,
        sky: 0,
        positions: 0,
        delta: 0,
        two_sided: 0,
        wi: [F8([0.0; 8]); 3],
        pdf: F8([0.0; 8]),
        p: [F8([0.0; 8]); 3],
        error: [F8([0.0; 8]); 3],
        uv: [F8([0.0; 8]); 2],
        cos: F8([0.0; 8]),
        normal: [F8([0.0; 8]); 3],
        primitive: U8([0; 8]),
        emission: [F8([0.0; 8]); 3],
    };

    /// Sets a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, scene: &RenderScene, lane: usize, sample: &LightSample) {
        let bit = 1 << lane;
        self.there |= bit;
        set_vector(&mut self.wi, lane, sample.wi.to_array());
        self.pdf.0[lane] = sample.pdf;
        let emission = match sample.target {
            LightTarget::Environment(radiance) => {
                self.sky |= bit;
                radiance
            }
            LightTarget::Direction(irradiance) => {
                self.sky |= bit;
                self.delta |= bit;
                irradiance
            }
            LightTarget::Position { irradiance, position } => {
                self.positions |= bit;
                self.delta |= bit;
                set_vector(&mut self.p, lane, position.to_array());
                irradiance
            }
            LightTarget::Surface { primitive, point, uv, cos, normal } => {
                let material = &scene.materials[scene.geometry.part(primitive).material as usize];
                self.two_sided |= if material.double_sided { bit } else { 0 };
                set_vector(&mut self.p, lane, point.p.to_array());
                set_vector(&mut self.error, lane, point.error.to_array());
                (self.uv[0].0[lane], self.uv[1].0[lane]) = (uv.x, uv.y);
                self.cos.0[lane] = cos;
                set_vector(&mut self.normal, lane, normal.to_array());
                self.primitive.0[lane] = primitive;
                material.emission.factor.into()
            }
        };
        set_vector(&mut self.emission, lane, emission.to_array());
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, s: S) -> LightSamples<S> {
        LightSamples {
            there: self.there,
            sky: self.sky,
            positions: self.positions,
            delta: self.delta,
            wi: Vectors::load(s, &self.wi),
            pdf: Floats::load(s, &self.pdf),
            point: PointLanes { p: Vectors::load(s, &self.p), error: Vectors::load(s, &self.error) },
            uv: [Floats::load(s, &self.uv[0]), Floats::load(s, &self.uv[1])],
            cos: Floats::load(s, &self.cos),
            normal: Vectors::load(s, &self.normal),
            two_sided: Mask::of_bits(s, self.two_sided),
            primitive: Integers::load(s, &self.primitive),
            emission: Vectors::load(s, &self.emission),
        }
    }
}

/// Samples of the environment in memory.
pub(super) struct SkySamples {
    there: u32,
    wi: [F8; 3],
    pdf: F8,
    emission: [F8; 3],
}

impl SkySamples {
    pub(super) const NONE: Self =
        Self { there: 0, wi: [F8([0.0; 8]); 3], pdf: F8([0.0; 8]), emission: [F8([0.0; 8]); 3] };

    #[inline(always)]
    pub(super) fn add(&mut self, lane: usize, sample: &LightSample) {
        let LightTarget::Environment(radiance) = sample.target else { return };
        self.there |= 1 << lane;
        set_vector(&mut self.wi, lane, sample.wi.to_array());
        self.pdf.0[lane] = sample.pdf;
        set_vector(&mut self.emission, lane, radiance.to_array());
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, s: S, others: LightSamples<S>) -> LightSamples<S> {
        LightSamples {
            there: self.there,
            sky: self.there,
            wi: Vectors::load(s, &self.wi),
            pdf: Floats::load(s, &self.pdf),
            emission: Vectors::load(s, &self.emission),
            ..others
        }
    }
}

/// Frames in memory.
pub(super) struct Frames([[F8; 3]; 3]);

impl Frames {
    #[inline(always)]
    pub(super) fn of<S: Simd>(frames: &FrameLanes<S>) -> Self {
        Self(frames.store())
    }

    #[inline(always)]
    pub(super) fn frame(&self, lane: usize) -> Frame {
        let [s, t, n] = &self.0;
        Frame { s: vec3(s, lane), t: vec3(t, lane), n: vec3(n, lane) }
    }
}

/// What lanes `asked` see of an environment map, and with which density it is sampled.
#[inline(never)]
fn look_up_map<S: Simd, P: Probe>(
    s: S,
    lights: &Lights,
    direction: Vectors<S>,
    asked: u32,
    probes: &mut [P; 8],
) -> Option<(Vectors<S>, Floats<S>)> {
    let Surroundings::Map(map) = &lights.environment else { return None };
    s.vectorize(
        #[inline(always)]
        || {
            for lane in Lanes(asked) {
                probes[lane].texture(1, EnvironmentSampler::LOOKUP_BYTES);
            }
            let look = map.look_ups(s, direction, asked);
            Some((look.radiance, Floats::splat(s, lights.environment_probability) * look.pdf))
        },
    )
}

/// Samples of an environment map for lanes `asked`, which chose it.
#[inline(never)]
fn sample_map<S: Simd, P: Probe>(
    s: S,
    lights: &Lights,
    [select, v]: [Floats<S>; 2],
    asked: u32,
    probes: &mut [P; 8],
) -> LightSamples<S> {
    let Surroundings::Map(map) = &lights.environment else { return LightSamples::none(s) };
    s.vectorize(
        #[inline(always)]
        || {
            let share = Floats::splat(s, lights.environment_probability);
            let most = Floats::splat(s, 1.0 - f32::EPSILON);
            let (wi, look, there) = map.samples(s, [(select / share).min(most), v.min(most)], asked);
            for lane in Lanes(there) {
                probes[lane].texture(1, EnvironmentSampler::LOOKUP_BYTES);
            }
            let pdf = share * look.pdf;
            LightSamples { there, sky: there, wi, pdf, emission: look.radiance, ..LightSamples::none(s) }
        },
    )
}

/// Light samples for lanes `active`, each by itself, by what was learned where anything was: for scenes with lights without area.
#[expect(clippy::too_many_arguments, reason = "none goes with another")]
#[inline(never)]
pub(crate) fn sample_each<S: Simd, P: Probe>(
    s: S,
    scene: &RenderScene,
    learned: Option<&Learned>,
    from: &ViewpointLanes<S>,
    frame: &FrameLanes<S>,
    [select, v]: [Floats<S>; 2],
    active: u32,
    probes: &mut [P; 8],
) -> LightSamples<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let lights = &scene.lights;
            let (from, frames) = (from.store(), Frames::of(frame));
            let (select, v) = (select.store(), v.store());
            let mut samples = Samples::NONE;
            for lane in Lanes(active) {
                let (from, frame, u) = (from.of(lane), frames.frame(lane), [select.0[lane], v.0[lane]]);
                let sample = match learned.and_then(|learned| learned.sample(lights, &from, &frame, u)) {
                    Some(sample) => sample,
                    None => lights.sample::<_, FullClass, true>(from.p, &frame, u, &mut probes[lane]),
                };
                if let Some(sample) = sample {
                    samples.set(scene, lane, &sample);
                }
            }
            samples.load(s)
        },
    )
}

/// From origins to places, and where shadow rays along that way end: [`ray_to_position`](super::ray_to_position).
#[inline(always)]
pub(crate) fn way_to_positions<S: Simd>(
    s: S,
    origin: Vectors<S>,
    position: Vectors<S>,
) -> (Vectors<S>, Floats<S>) {
    let way = position - origin;
    let length = max_element(way.abs());
    let size = max_element(position.abs()).max(max_element(origin.abs()));
    let shorter = Floats::splat(s, f32::EPSILON) * (Floats::splat(s, 5.0) + size / length);
    (way, (1.0 - shorter).max(Floats::splat(s, 0.0)))
}

impl Rows for FewRows {
    #[inline(always)]
    fn choose<S: Simd>(&self, s: S, lights: &Lights, [select, v]: [Floats<S>; 2]) -> Chosen<S> {
        let row = eight_of(&self.patches, strip(s, lights, select));
        let [cumulative, probability, ..] = row;
        Chosen::new(clamped(s, (select - cumulative) / probability), v, row)
    }

    #[inline(always)]
    fn triangle<S: Simd>(&self, triangle: Integers<S>) -> TriangleRow<S> {
        let [here, there] = &self.triangles;
        TriangleRow::new(eight_of(here, triangle), eight_of(there, triangle))
    }

    #[inline(always)]
    fn corners<S: Simd>(&self, _: &Geometry, triangle: Integers<S>, _: Integers<S>) -> [Vectors<S>; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = self.corners;
        [
            Vectors::look_up(&[ax, ay, az], triangle),
            Vectors::look_up(&[bx, by, bz], triangle),
            Vectors::look_up(&[cx, cy, cz], triangle),
        ]
    }
}

/// The entries of eight tables.
#[inline(always)]
fn eight_of<S: Simd>([a, b, c, d, e, f, g, h]: &[F8; 8], index: Integers<S>) -> [Floats<S>; 8] {
    [
        Floats::look_up(a, index),
        Floats::look_up(b, index),
        Floats::look_up(c, index),
        Floats::look_up(d, index),
        Floats::look_up(e, index),
        Floats::look_up(f, index),
        Floats::look_up(g, index),
        Floats::look_up(h, index),
    ]
}

impl Rows for ManyRows {
    #[inline(always)]
    fn choose<S: Simd>(&self, s: S, lights: &Lights, [select, v]: [Floats<S>; 2]) -> Chosen<S> {
        let strip = strip(s, lights, select).shift_left::<2>();
        let [cumulative, probability, first, count] = Floats::gather_fours(self.strips.as_flattened(), strip);
        let (first, count) = (first.bits(), count.bits());
        let x = clamped(s, (select - cumulative) / probability);
        let patches = self.patches.as_flattened();
        let alone = count.is(1);
        if alone.bits() == 0xff {
            return Chosen::new(x, v, Floats::gather_eights(patches, first.shift_left::<3>()));
        }
        // Whole numbers of patches are exact as floats.
        let counts = count.to_floats();
        let interval = (v * counts).min(counts - 1.0).truncate();
        let mut patch = first + Integers::gather(lights.patches.guide(), first + interval);
        let last = first + count - 1;
        loop {
            let next = patch + 1;
            let begins = Floats::gather(patches, next.shift_left::<3>() + CUMULATIVE);
            let more = begins.less_equal(v).without(patch.equal(last));
            if more.bits() == 0 {
                break;
            }
            patch = next.or_where_not(more, patch);
        }
        let row = Floats::gather_eights(patches, patch.shift_left::<3>());
        let [cumulative, probability, ..] = row;
        let y = clamped(s, (v - cumulative) / probability);
        Chosen::new(x, alone.select(v, y), row)
    }

    #[inline(always)]
    fn triangle<S: Simd>(&self, triangle: Integers<S>) -> TriangleRow<S> {
        let rows = self.triangles.as_flattened();
        let first = triangle.shift_left::<4>();
        TriangleRow::new(Floats::gather_eights(rows, first), Floats::gather_eights(rows, first + 8))
    }

    #[inline(always)]
    fn corners<S: Simd>(
        &self,
        geometry: &Geometry,
        _: Integers<S>,
        primitive: Integers<S>,
    ) -> [Vectors<S>; 3] {
        geometry.corners_in_lanes(primitive)
    }
}

/// Which strip the first number chooses.
#[inline(always)]
fn strip<S: Simd>(s: S, lights: &Lights, select: Floats<S>) -> Integers<S> {
    let (cumulative, guide) = (&lights.cumulative, &lights.guide);
    let count = cumulative.len();
    if count == 1 {
        return Integers::splat(s, 0);
    }
    // Beyond the last there is the last.
    let mut index = Integers::gather(guide, (select * count as f32).truncate());
    loop {
        let next = index + 1;
        let more = Floats::gather(cumulative, next).less_equal(select);
        let more = more.without(index.is(count as u32 - 1));
        if more.bits() == 0 {
            return index;
        }
        index = next.or_where_not(more, index);
    }
}

/// From 0 to below 1.
#[inline(always)]
fn clamped<S: Simd>(s: S, x: Floats<S>) -> Floats<S> {
    Floats::splat(s, 1.0 - 0.5 * f32::EPSILON).min(Floats::splat(s, 0.0).max(x))
}

/// Weight 0, 1 or 2.
#[inline(always)]
fn weight<S: Simd>(which: Integers<S>, weights: [Floats<S>; 3]) -> Floats<S> {
    which.is(0).select(weights[0], which.is(1).select(weights[1], weights[2]))
}

/// In a half's weights: whether the patch has two triangles. Below it which weights are those of the triangle's second and third corner.
const PAIR: u32 = 16;

pub(super) fn patch_row(patch: &Row) -> [f32; PATCH] {
    let weights = |i: usize| {
        let [b, c] = patch.weights[i].map(u32::from);
        f32::from_bits(b | c << 2 | if patch.pair { PAIR } else { 0 })
    };
    let [first, second] = patch.triangles.map(f32::from_bits);
    [patch.cumulative, patch.probability, first, second, weights(0), weights(1), 0.0, 0.0]
}

/// At most eight rows, number by number.
fn columns<const N: usize>(rows: &[[f32; N]]) -> [F8; N] {
    core::array::from_fn(|number| F8(core::array::from_fn(|i| rows.get(i).map_or(0.0, |row| row[number]))))
}

/// The first or second eight numbers of rows.
fn halves(rows: &[[f32; TRIANGLE]], half: usize) -> Vec<[f32; 8]> {
    rows.iter().map(|row| row.as_chunks::<8>().0[half]).collect()
}
