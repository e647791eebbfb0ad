//! Scattering at eight surfaces at once: [`crate::bsdf`] in lanes.
//!
//! Matte and substrate are computed for all lanes; of what is neither each is asked by itself, and so are textures.

use super::LaneScene;
use super::counts::Lookups;
use super::math::{pow5, sin_cos_turn, square_to_cosine_hemisphere, vec3};
use crate::bsdf::Bsdf;
use crate::class::Class;
use crate::geometry::{Attributes, Surface};
use crate::math::{FRAC_1_PI, PI};
use crate::scene::RenderScene;
use crate::surface::resolve;
use glam::Vec2;
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Mask, Simd, U8, Vectors, set_vector};
use hotspot_probe::{NoProbe, Probe};

/// How a material scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Kind {
    Matte,
    Substrate,
    /// Asked one by one.
    Other,
    /// The same, and of no use to light sampling.
    Specular,
}

/// Of a part's kind the bits that are [`Kind`].
const KIND: u32 = 3;
/// Added to it where textures or colours of vertices are to be looked up.
pub(super) const VARIES: u32 = 4;
/// Added to it where there is a normal map.
pub(super) const BUMPY: u32 = 8;

impl Kind {
    /// `None`: lanes do not know it.
    pub(super) fn of(bsdf: &hotspot_scene::Bsdf) -> Option<Self> {
        use hotspot_scene::Bsdf as Given;
        match bsdf {
            Given::Matte { .. } => Some(Self::Matte),
            Given::Substrate { .. } => Some(Self::Substrate),
            Given::RoughMetal { .. } => Some(Self::Other),
            Given::Glass { absorption, .. } if *absorption != [0.0; 3] => None,
            Given::Mirror { .. } | Given::Glass { .. } => Some(Self::Specular),
            Given::Unlit { .. } | Given::Mix { .. } => None,
        }
    }
}

/// How eight surfaces scatter.
#[derive(Clone, Copy)]
pub(super) struct BsdfLanes<S: Simd> {
    /// Reflectance of matte surfaces, of substrates that of the base.
    color: Vectors<S>,
    specular: Vectors<S>,
    alpha: Floats<S>,
    substrate: Mask<S>,
    /// Lanes, as bits: [`Kind::Other`] and [`Kind::Specular`], and the latter alone.
    others: u32,
    pub(super) speculars: u32,
    /// What the others are asked by: where they are, and whether paths come from the front.
    at: At<S>,
    front: u32,
}

/// Places on triangles.
#[derive(Clone, Copy)]
pub(super) struct At<S: Simd> {
    pub(super) primitive: Integers<S>,
    pub(super) u: Floats<S>,
    pub(super) v: Floats<S>,
}

/// The same in memory.
pub(super) struct Places {
    primitive: U8,
    u: F8,
    v: F8,
}

impl<S: Simd> At<S> {
    #[inline(always)]
    pub(super) fn store(&self) -> Places {
        Places { primitive: self.primitive.store(), u: self.u.store(), v: self.v.store() }
    }
}

impl Places {
    /// The surface at a lane's place, with what varies over it.
    #[inline(always)]
    pub(super) fn surface<'s, C: Class>(
        &self,
        scene: &'s RenderScene,
        lane: usize,
    ) -> (Surface<'s>, Attributes) {
        let surface = scene.geometry.world_surface(self.primitive.0[lane]);
        let attributes = if C::TEXTURED {
            scene.geometry.attributes::<C>(surface, self.u.0[lane], self.v.0[lane])
        } else {
            Attributes::NONE
        };
        (surface, attributes)
    }

    /// Barycentric weights of its second and third corner.
    #[inline(always)]
    pub(super) fn weights(&self, lane: usize) -> [f32; 2] {
        [self.u.0[lane], self.v.0[lane]]
    }

    /// What its material is there.
    #[inline(always)]
    fn bsdf<C: Class, P: Probe>(&self, scene: &RenderScene, lane: usize, front: u32, probe: &mut P) -> Bsdf {
        let (surface, attributes) = self.surface::<C>(scene, lane);
        let material = &scene.materials[surface.part.material as usize];
        let front = front >> lane & 1 != 0;
        resolve::<_, C>(scene, &material.bsdf, &attributes, front, 0.0, probe)
    }
}

/// [`crate::bsdf::BsdfSample`] in lanes.
pub(super) struct SampledLanes<S: Simd> {
    /// Lanes that have one.
    pub(super) there: u32,
    /// In the shading frame.
    pub(super) wi: Vectors<S>,
    pub(super) weight: Vectors<S>,
    pub(super) pdf: Floats<S>,
    pub(super) eta_scale: Floats<S>,
}

impl<S: Simd> BsdfLanes<S> {
    /// Of parts of these numbers and kinds, in lanes `alive`.
    #[inline(always)]
    pub(super) fn new<C: Class>(
        s: S,
        (lanes, scene): (&LaneScene, &RenderScene),
        (part, kind): (Integers<S>, Integers<S>),
        at: At<S>,
        (front, alive): (Mask<S>, u32),
        lookups: &mut [Lookups; 8],
    ) -> Self {
        let [r, g, b, x, y, z, alpha, _] =
            Floats::gather_eights(lanes.rows.as_flattened(), part.shift_left::<4>() + 8);
        let mut this = Self {
            color: Vectors::new(r, g, b),
            specular: Vectors::new(x, y, z),
            alpha,
            substrate: Mask::splat(s, false),
            others: 0,
            speculars: 0,
            at,
            front: front.bits(),
        };
        if C::LOBES {
            let scatters = kind & KIND;
            this.substrate = scatters.is(Kind::Substrate as u32);
            this.speculars = scatters.is(Kind::Specular as u32).bits() & alive;
            this.others = this.speculars | scatters.is(Kind::Other as u32).bits() & alive;
        }
        if C::TEXTURED {
            let varies = (kind & VARIES).is(VARIES).bits() & alive & !this.others;
            if varies != 0 {
                this = this.varied::<C>(s, scene, varies, lookups);
            }
        }
        this
    }

    /// With what textures say in lanes `asked`.
    #[inline(never)]
    fn varied<C: Class>(self, s: S, scene: &RenderScene, asked: u32, lookups: &mut [Lookups; 8]) -> Self {
        s.vectorize(
            #[inline(always)]
            || {
                let places = self.at.store();
                let (mut color, mut specular) = (self.color.store(), self.specular.store());
                let mut alpha = self.alpha.store();
                for lane in Lanes(asked) {
                    match places.bsdf::<C, _>(scene, lane, self.front, &mut lookups[lane]) {
                        Bsdf::Matte(reflectance) => set_vector(&mut color, lane, reflectance.to_array()),
                        Bsdf::Substrate(substrate) => {
                            set_vector(&mut color, lane, substrate.diffuse.to_array());
                            set_vector(&mut specular, lane, substrate.specular.to_array());
                            alpha.0[lane] = substrate.alpha;
                        }
                        _ => {}
                    }
                }
                Self {
                    color: Vectors::load(s, &color),
                    specular: Vectors::load(s, &specular),
                    alpha: Floats::load(s, &alpha),
                    ..self
                }
            },
        )
    }

    /// [`Bsdf::eval`] for lanes `asked`.
    #[inline(always)]
    pub(super) fn eval<C: Class>(
        &self,
        s: S,
        scene: &RenderScene,
        wo: Vectors<S>,
        wi: Vectors<S>,
        asked: u32,
    ) -> (Vectors<S>, Floats<S>) {
        let zero = Floats::splat(s, 0.0);
        let pdf = Floats::splat(s, FRAC_1_PI) * wi.z;
        let above = zero.less(wi.z) & zero.less(wo.z);
        let f_cos = self.color.scaled(pdf);
        if !C::LOBES {
            return (f_cos.or_zero(above), pdf);
        }
        let (mut f_cos, mut pdf) = (f_cos, pdf);
        if self.substrate.bits() & asked != 0 {
            let (coated, coated_pdf) = self.eval_substrate(s, wo, wi);
            f_cos = coated.or_where_not(self.substrate, f_cos);
            pdf = self.substrate.select(coated_pdf, pdf);
        }
        (f_cos, pdf) = (f_cos.or_zero(above), above.or_zero(pdf));
        if self.others & asked != 0 {
            (f_cos, pdf) = self.eval_others::<C>(s, scene, [wo, wi], (f_cos, pdf), self.others & asked);
        }
        (f_cos, pdf)
    }

    /// [`Bsdf::sample`], by `lobe` and two numbers as [`Bsdf::choose_lobe`] leaves them, for lanes `asked`.
    #[inline(always)]
    pub(super) fn sample<C: Class>(
        &self,
        s: S,
        scene: &RenderScene,
        wo: Vectors<S>,
        [lobe, v]: [Floats<S>; 2],
        asked: u32,
        lookups: &mut [Lookups; 8],
    ) -> SampledLanes<S> {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let half = Floats::splat(s, 0.5);
        let mut u = lobe;
        if C::LOBES {
            let stretched = lobe.less(half).select(lobe * 2.0, lobe * 2.0 - 1.0);
            u = self.substrate.select(stretched, u);
        }
        let wi = square_to_cosine_hemisphere(s, u, v);
        let pdf = Floats::splat(s, FRAC_1_PI) * wi.z;
        let mut sample = SampledLanes { there: asked, wi, weight: self.color, pdf, eta_scale: one };
        if C::LOBES && self.substrate.bits() & asked != 0 {
            let about = reflect(wo, self.sample_ggx(s, u, v));
            let reflected = self.substrate.without(lobe.less(half));
            sample.wi = about.or_where_not(reflected, wi);
            let (f_cos, pdf) = self.eval_substrate(s, wo, sample.wi);
            let weight = Vectors::new(f_cos.x / pdf, f_cos.y / pdf, f_cos.z / pdf);
            // What lies below has no density.
            let above = zero.less(sample.wi.z);
            sample.pdf = self.substrate.select(above.or_zero(pdf), sample.pdf);
            sample.weight = weight.or_where_not(self.substrate, sample.weight);
        }
        let there = zero.less(sample.pdf) & sample.weight.any();
        sample.there &= there.bits();
        if C::LOBES && self.others & asked != 0 {
            sample = self.sample_others::<C>(s, scene, wo, [lobe, v], (sample, self.others & asked), lookups);
        }
        sample
    }

    /// [`Substrate::eval`](crate::bsdf::Substrate::eval) where both directions lie above.
    #[inline(always)]
    fn eval_substrate(&self, s: S, wo: Vectors<S>, wi: Vectors<S>) -> (Vectors<S>, Floats<S>) {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let half = Floats::splat(s, 0.5);
        let h = wi + wo;
        let length = h.dot(h).sqrt();
        let some = Floats::splat(s, 1e-7).less_equal(length);
        let h = Vectors::new(h.x / length, h.y / length, h.z / length);
        let wi_h = half * length;
        let d = ggx(s, h, self.alpha);
        let ones = Vectors::new(one, one, one);
        let coat = Floats::splat(s, 28.0 / (23.0 * PI))
            * (one - pow5(one - half * wi.z))
            * (one - pow5(one - half * wo.z));
        let diffuse = (self.color * (ones - self.specular)).scaled(coat);
        let schlick = pow5((one - wi_h).max(zero));
        let fresnel = self.specular + (ones - self.specular).scaled(schlick);
        let lobe = d / (Floats::splat(s, 4.0) * wi_h);
        let f_cos = diffuse.scaled(wi.z) + fresnel.scaled(lobe * (wi.z / wi.z.max(wo.z)));
        let pdf = half * (Floats::splat(s, FRAC_1_PI) * wi.z + lobe * h.z.abs());
        (f_cos.or_zero(some), some.or_zero(pdf))
    }

    /// [`crate::bsdf::sample_ggx`].
    #[inline(always)]
    fn sample_ggx(&self, s: S, u: Floats<S>, v: Floats<S>) -> Vectors<S> {
        let a2 = self.alpha * self.alpha;
        let (up, out) = (Floats::splat(s, 1.0) - u, a2 * u);
        let denominator = up + out;
        let cos = (up / denominator).sqrt();
        let sin = (out / denominator).sqrt();
        let (y, x) = sin_cos_turn(s, v);
        Vectors::new(sin * x, sin * y, cos)
    }

    #[inline(never)]
    fn eval_others<C: Class>(
        &self,
        s: S,
        scene: &RenderScene,
        [wo, wi]: [Vectors<S>; 2],
        (f_cos, pdf): (Vectors<S>, Floats<S>),
        asked: u32,
    ) -> (Vectors<S>, Floats<S>) {
        s.vectorize(
            #[inline(always)]
            || {
                let (places, wo, wi) = (self.at.store(), wo.store(), wi.store());
                let (mut f_cos, mut pdf) = (f_cos.store(), pdf.store());
                for lane in Lanes(asked) {
                    let bsdf = places.bsdf::<C, _>(scene, lane, self.front, &mut NoProbe);
                    let (f, p) = bsdf.eval(vec3(&wo, lane), vec3(&wi, lane));
                    set_vector(&mut f_cos, lane, f.to_array());
                    pdf.0[lane] = p;
                }
                (Vectors::load(s, &f_cos), Floats::load(s, &pdf))
            },
        )
    }

    #[inline(never)]
    fn sample_others<C: Class>(
        &self,
        s: S,
        scene: &RenderScene,
        wo: Vectors<S>,
        [lobe, v]: [Floats<S>; 2],
        (sample, asked): (SampledLanes<S>, u32),
        lookups: &mut [Lookups; 8],
    ) -> SampledLanes<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let (places, wo) = (self.at.store(), wo.store());
                let (lobe, v) = (lobe.store(), v.store());
                let (mut wi, mut weight) = (sample.wi.store(), sample.weight.store());
                let (mut pdf, mut eta_scale) = (sample.pdf.store(), sample.eta_scale.store());
                let mut there = sample.there & !asked;
                for lane in Lanes(asked) {
                    let bsdf = places.bsdf::<C, _>(scene, lane, self.front, &mut lookups[lane]);
                    let (choice, u) = bsdf.choose_lobe(lobe.0[lane]);
                    let Some(one) = bsdf.sample(vec3(&wo, lane), choice, Vec2::new(u, v.0[lane])) else {
                        continue;
                    };
                    there |= 1 << lane;
                    set_vector(&mut wi, lane, one.wi.to_array());
                    set_vector(&mut weight, lane, one.weight.to_array());
                    pdf.0[lane] = one.pdf;
                    eta_scale.0[lane] = one.eta_scale;
                }
                SampledLanes {
                    there,
                    wi: Vectors::load(s, &wi),
                    weight: Vectors::load(s, &weight),
                    pdf: Floats::load(s, &pdf),
                    eta_scale: Floats::load(s, &eta_scale),
                }
            },
        )
    }
}

/// [`crate::bsdf::reflect`].
#[inline(always)]
fn reflect<S: Simd>(w: Vectors<S>, h: Vectors<S>) -> Vectors<S> {
    h.scaled(w.dot(h) * 2.0) - w
}

/// [`crate::bsdf::ggx`].
#[inline(always)]
fn ggx<S: Simd>(s: S, h: Vectors<S>, alpha: Floats<S>) -> Floats<S> {
    let a2 = alpha * alpha;
    let t = h.x * h.x + h.y * h.y + a2 * (h.z * h.z);
    a2 * Floats::splat(s, FRAC_1_PI) / (t * t)
}
