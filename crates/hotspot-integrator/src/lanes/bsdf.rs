//! Scattering at eight surfaces at once: [`crate::bsdf`] in lanes.
//!
//! What varies over a surface, and which part of a mixed material it is, is found out lane by lane; all else is computed for all lanes, each kind of
//! surface where there is one.

mod glass;
mod metal;
mod substrate;

use super::LaneScene;
use super::counts::Lookups;
use super::math::square_to_cosine_hemisphere;
use crate::bsdf::Bsdf;
use crate::class::Class;
use crate::geometry::{Attributes, Surface};
use crate::math::FRAC_1_PI;
use crate::scene::RenderScene;
use crate::surface::resolve;
use glam::Vec3;
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Mask, Simd, U8, Vectors, set_vector};
use hotspot_probe::Probe;
use metal::sample_ggx;

/// How a material scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub(super) enum Kind {
    Matte,
    Substrate,
    Metal,
    /// From here on they are of no use to light sampling.
    Mirror,
    Pane,
    Glass,
    /// Does not.
    Unlit,
    /// One of those before, by chance.
    Mixed,
}

/// Of a part's kind the bits that are [`Kind`].
const KIND: u32 = 7;
/// Added to it where textures or colours of vertices are to be looked up.
pub(super) const VARIES: u32 = 8;
/// Added to it where there is a normal map.
pub(super) const BUMPY: u32 = 16;
/// Added to it where what it emits is to be looked up.
pub(super) const GLOWS: u32 = 32;

impl Kind {
    pub(super) fn of(bsdf: &hotspot_scene::Bsdf) -> Self {
        use hotspot_scene::Bsdf as Given;
        match bsdf {
            Given::Matte { .. } => Self::Matte,
            Given::Substrate { .. } => Self::Substrate,
            Given::RoughMetal { .. } => Self::Metal,
            Given::Mirror { .. } => Self::Mirror,
            Given::Glass { thin: true, .. } => Self::Pane,
            Given::Glass { .. } => Self::Glass,
            Given::Unlit { .. } => Self::Unlit,
            Given::Mix { .. } => Self::Mixed,
        }
    }

    /// Which of these are of this kind.
    #[inline(always)]
    pub(super) fn among<S: Simd>(self, kinds: Integers<S>) -> Mask<S> {
        (kinds & KIND).is(self as u32)
    }
}

/// How eight surfaces scatter.
#[derive(Clone, Copy)]
pub(super) struct BsdfLanes<S: Simd> {
    /// [`Kind`].
    kind: Integers<S>,
    /// Reflectance of matte surfaces and mirrors, of substrates that of the base, of metals at normal incidence; what glass transmits.
    color: Vectors<S>,
    /// Reflectance of a substrate's coat at normal incidence; absorption in glass.
    specular: Vectors<S>,
    /// GGX's; of glass the relative index of refraction.
    alpha: Floats<S>,
    /// Lanes, as bits, that are of no use to light sampling.
    pub(super) speculars: u32,
}

/// The same of one surface, as numbers: kind, colour, specular, alpha.
type Numbers = (Kind, Vec3, Vec3, f32);

/// What a surface is where textures are looked up.
#[inline(always)]
fn numbers(bsdf: &Bsdf) -> Numbers {
    match *bsdf {
        Bsdf::Matte(reflectance) => (Kind::Matte, reflectance, Vec3::ZERO, 0.0),
        Bsdf::Substrate(substrate) => {
            (Kind::Substrate, substrate.diffuse, substrate.specular, substrate.alpha)
        }
        Bsdf::Mirror(reflectance) => (Kind::Mirror, reflectance, Vec3::ZERO, 0.0),
        Bsdf::RoughMetal(metal) => (Kind::Metal, metal.f0, Vec3::ZERO, metal.alpha),
        Bsdf::Glass(glass) => {
            let kind = if glass.thin { Kind::Pane } else { Kind::Glass };
            (kind, glass.transmittance, glass.absorption, glass.eta)
        }
    }
}

/// Places on triangles.
#[derive(Clone, Copy)]
pub(super) struct At<S: Simd> {
    pub(super) primitive: Integers<S>,
    pub(super) instance: Integers<S>,
    pub(super) u: Floats<S>,
    pub(super) v: Floats<S>,
}

/// The same in memory.
pub(super) struct Places {
    primitive: U8,
    instance: U8,
    u: F8,
    v: F8,
}

impl<S: Simd> At<S> {
    #[inline(always)]
    pub(super) fn store(&self) -> Places {
        Places {
            primitive: self.primitive.store(),
            instance: self.instance.store(),
            u: self.u.store(),
            v: self.v.store(),
        }
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
        let surface = scene.geometry.surface(self.instance.0[lane], self.primitive.0[lane]);
        let attributes = if C::TEXTURED {
            scene.geometry.attributes::<C>(surface, self.u.0[lane], self.v.0[lane])
        } else {
            Attributes::NONE
        };
        (surface, attributes)
    }

    #[inline(always)]
    pub(super) fn primitive(&self, lane: usize) -> u32 {
        self.primitive.0[lane]
    }

    /// Barycentric weights of its second and third corner.
    #[inline(always)]
    pub(super) fn weights(&self, lane: usize) -> [f32; 2] {
        [self.u.0[lane], self.v.0[lane]]
    }

    /// What its material is there, of a mixed one the part that `choice` chooses.
    #[inline(always)]
    fn bsdf<C: Class, P: Probe>(
        &self,
        scene: &RenderScene,
        lane: usize,
        (front, choice): (bool, f32),
        probe: &mut P,
    ) -> Bsdf {
        let (surface, attributes) = self.surface::<C>(scene, lane);
        let material = &scene.materials[surface.part.material as usize];
        resolve::<_, C>(scene, &material.bsdf, &attributes, front, choice, probe)
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
    /// Of parts of these numbers and kinds, in lanes `alive`, on the side that paths come from; `choice` chooses among mixed ones.
    #[inline(always)]
    pub(super) fn new<C: Class>(
        s: S,
        (lanes, scene): (&LaneScene, &RenderScene),
        (part, kind): (Integers<S>, Integers<S>),
        (at, choice): (At<S>, Floats<S>),
        (front, alive): (Mask<S>, u32),
        lookups: &mut [Lookups; 8],
    ) -> Self {
        let [r, g, b, x, y, z, alpha, _] =
            Floats::gather_eights(lanes.rows.as_flattened(), part.shift_left::<4>() + 8);
        let mut this = Self {
            kind: kind & KIND,
            color: Vectors::new(r, g, b),
            specular: Vectors::new(x, y, z),
            alpha,
            speculars: 0,
        };
        if !C::LOBES {
            return this;
        }
        let glass = this.is(Kind::Glass);
        if glass.bits() & alive != 0 {
            this.alpha = glass.without(front).select(1.0 / alpha, alpha);
        }
        if C::TEXTURED {
            let varies = (kind & VARIES).is(VARIES).bits() & alive;
            if varies != 0 {
                this = this.varied::<C>(s, scene, (at, choice, front.bits()), varies, lookups);
            }
        }
        let least = Integers::splat(s, Kind::Mirror as u32);
        this.speculars = least.to_floats().less_equal(this.kind.to_floats()).bits() & alive;
        this
    }

    /// Where it is of this kind.
    #[inline(always)]
    fn is(&self, kind: Kind) -> Mask<S> {
        self.kind.is(kind as u32)
    }

    /// With what textures say and chance chooses in lanes `asked`.
    #[inline(never)]
    fn varied<C: Class>(
        self,
        s: S,
        scene: &RenderScene,
        (at, choice, front): (At<S>, Floats<S>, u32),
        asked: u32,
        lookups: &mut [Lookups; 8],
    ) -> Self {
        s.vectorize(
            #[inline(always)]
            || {
                let (places, choice) = (at.store(), choice.store());
                let (mut color, mut specular) = (self.color.store(), self.specular.store());
                let (mut alpha, mut kind) = (self.alpha.store(), self.kind.store());
                for lane in Lanes(asked) {
                    let by = (front >> lane & 1 != 0, choice.0[lane]);
                    let bsdf = places.bsdf::<C, _>(scene, lane, by, &mut lookups[lane]);
                    let (is, of_color, of_specular, of_alpha) = numbers(&bsdf);
                    set_vector(&mut color, lane, of_color.to_array());
                    set_vector(&mut specular, lane, of_specular.to_array());
                    (alpha.0[lane], kind.0[lane]) = (of_alpha, is as u32);
                }
                Self {
                    kind: Integers::load(s, &kind),
                    color: Vectors::load(s, &color),
                    specular: Vectors::load(s, &specular),
                    alpha: Floats::load(s, &alpha),
                    ..self
                }
            },
        )
    }

    /// [`Bsdf::eval`] for lanes `asked`, which none that is of no use to light sampling is among.
    #[inline(always)]
    pub(super) fn eval<C: Class>(
        &self,
        s: S,
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
        let substrate = self.is(Kind::Substrate);
        if substrate.bits() & asked != 0 {
            let (coated, coated_pdf) = self.eval_substrate(s, wo, wi);
            f_cos = coated.or_where_not(substrate, f_cos);
            pdf = substrate.select(coated_pdf, pdf);
        }
        let metal = self.is(Kind::Metal);
        if metal.bits() & asked != 0 {
            let (reflected, reflected_pdf) = self.eval_metal(s, wo, wi);
            f_cos = reflected.or_where_not(metal, f_cos);
            pdf = metal.select(reflected_pdf, pdf);
        }
        (f_cos.or_zero(above), above.or_zero(pdf))
    }

    /// [`Bsdf::sample`], by `lobe` and two numbers as [`Bsdf::choose_lobe`] leaves them, for lanes `asked`.
    #[inline(always)]
    pub(super) fn sample<C: Class>(
        &self,
        s: S,
        wo: Vectors<S>,
        [lobe, v]: [Floats<S>; 2],
        asked: u32,
    ) -> SampledLanes<S> {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let substrate = self.is(Kind::Substrate);
        let (mut u, mut diffuse) = (lobe, substrate);
        if C::LOBES {
            diffuse = lobe.less(Floats::splat(s, 0.5));
            u = substrate.select(diffuse.select(lobe * 2.0, lobe * 2.0 - 1.0), lobe);
        }
        let wi = square_to_cosine_hemisphere(s, u, v);
        let pdf = Floats::splat(s, FRAC_1_PI) * wi.z;
        let mut sample = SampledLanes { there: asked, wi, weight: self.color, pdf, eta_scale: one };
        if C::LOBES {
            if substrate.bits() & asked != 0 {
                let about = reflect(wo, sample_ggx(s, self.alpha, u, v));
                sample.wi = about.or_where_not(substrate.without(diffuse), wi);
                let (f_cos, pdf) = self.eval_substrate(s, wo, sample.wi);
                sample.weigh(s, substrate, f_cos, pdf);
            }
            let metal = self.is(Kind::Metal);
            if metal.bits() & asked != 0 {
                let about = reflect(wo, self.sample_visible_normal(s, wo, u, v));
                sample.wi = about.or_where_not(metal, sample.wi);
                let (f_cos, pdf) = self.eval_metal(s, wo, sample.wi);
                sample.weigh(s, metal, f_cos, pdf);
            }
            if self.speculars & asked != 0 {
                sample = self.sample_specular(s, wo, lobe, sample, asked);
            }
        }
        let there = zero.less(sample.pdf) & sample.weight.any();
        sample.there &= there.bits();
        sample
    }
}

impl<S: Simd> SampledLanes<S> {
    /// Sets weight and density where `which`, of directions with this f·cos and density; what lies below has none.
    #[inline(always)]
    fn weigh(&mut self, s: S, which: Mask<S>, f_cos: Vectors<S>, pdf: Floats<S>) {
        let weight = Vectors::new(f_cos.x / pdf, f_cos.y / pdf, f_cos.z / pdf);
        let above = Floats::splat(s, 0.0).less(self.wi.z);
        self.pdf = which.select(above.or_zero(pdf), self.pdf);
        self.weight = weight.or_where_not(which, self.weight);
    }
}

/// [`crate::bsdf::reflect`].
#[inline(always)]
fn reflect<S: Simd>(w: Vectors<S>, h: Vectors<S>) -> Vectors<S> {
    h.scaled(w.dot(h) * 2.0) - w
}
