//! Light sampling by what was learned, for eight paths: [`Learned`] asked lane by lane, since each asks other tables.

use super::Lights;
use super::lanes::{Frames, LightLanes, LightSamples, SkySamples};
use super::learn::{Learned, Outlook, Viewpoint, met};
use crate::geometry::Geometry;
use crate::lanes::math::{FrameLanes, vec3};
use hotspot_bvh::rays::{Hits, Rays};
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Simd, U8, Vectors, vector};
use hotspot_bvh::{Hit, NO_INSTANCE, Ray};

/// [`Viewpoint`]s in lanes.
#[derive(Clone, Copy)]
pub(crate) struct ViewpointLanes<S: Simd> {
    pub(crate) p: Vectors<S>,
    pub(crate) n: Vectors<S>,
    pub(crate) outlook: Integers<S>,
}

impl<S: Simd> ViewpointLanes<S> {
    /// [`Viewpoint::NONE`].
    #[inline(always)]
    pub(crate) fn none(s: S) -> Self {
        Self {
            p: Vectors::splat(s, [0.0; 3]),
            n: Vectors::splat(s, [0.0, 0.0, 1.0]),
            outlook: Integers::splat(s, Outlook::NONE.number()),
        }
    }

    #[inline(always)]
    pub(super) fn store(&self) -> Viewpoints {
        Viewpoints { p: self.p.store(), n: self.n.store(), outlook: self.outlook.store() }
    }
}

/// The same in memory.
pub(super) struct Viewpoints {
    p: [F8; 3],
    n: [F8; 3],
    outlook: U8,
}

impl Viewpoints {
    #[inline(always)]
    pub(super) fn of(&self, lane: usize) -> Viewpoint {
        let outlook = Outlook::of_number(self.outlook.0[lane]);
        Viewpoint::new(vec3(&self.p, lane), vec3(&self.n, lane), outlook)
    }
}

impl Learned {
    /// [`Learned::outlook`] where rays of lanes `active` hit.
    #[inline(always)]
    pub(crate) fn outlooks<S: Simd>(&self, s: S, rays: &Rays<S>, hits: &Hits<S>, active: u32) -> Integers<S> {
        let mut outlooks = U8([Outlook::NONE.number(); 8]);
        if self.has_windows() {
            let (origin, direction) = (rays.origin.store(), rays.direction.store());
            let (t, normal) = (hits.t.store(), hits.normal.store());
            for lane in Lanes(active) {
                let ray = Ray::new(vector(&origin, lane), vector(&direction, lane));
                let hit = Hit {
                    t: t.0[lane],
                    u: 0.0,
                    v: 0.0,
                    primitive: 0,
                    instance: NO_INSTANCE,
                    normal: vector(&normal, lane),
                };
                let (p, n) = met(&ray, &hit);
                outlooks.0[lane] = self.outlook(s, p, n).number();
            }
        }
        Integers::load(s, &outlooks)
    }

    /// [`Learned::pdf_area`] for lanes `active`.
    #[inline(never)]
    pub(crate) fn pdfs_area<S: Simd>(
        &self,
        s: S,
        lights: &Lights,
        from: &ViewpointLanes<S>,
        primitive: Integers<S>,
        by_power: Floats<S>,
        active: u32,
    ) -> Floats<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let (from, primitive, mut pdf) = (from.store(), primitive.store(), by_power.store());
                for lane in Lanes(active) {
                    pdf.0[lane] = self.pdf_area(lights, &from.of(lane), primitive.0[lane], pdf.0[lane]);
                }
                Floats::load(s, &pdf)
            },
        )
    }

    /// [`Learned::pdf_environment`] for lanes `active`.
    #[inline(never)]
    pub(crate) fn pdfs_environment<S: Simd>(
        &self,
        s: S,
        lights: &Lights,
        from: &ViewpointLanes<S>,
        direction: Vectors<S>,
        otherwise: Floats<S>,
        active: u32,
    ) -> Floats<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let (from, direction, mut pdf) = (from.store(), direction.store(), otherwise.store());
                for lane in Lanes(active) {
                    let direction = vec3(&direction, lane);
                    pdf.0[lane] = self.pdf_environment(lights, &from.of(lane), direction, pdf.0[lane]);
                }
                Floats::load(s, &pdf)
            },
        )
    }

    /// [`Learned::sample`] for lanes `active`; and those about whose kind of light nothing was learned.
    #[inline(never)]
    pub(crate) fn samples<S: Simd>(
        &self,
        s: S,
        (lanes, lights, geometry): (&LightLanes, &Lights, &Geometry),
        from: &ViewpointLanes<S>,
        frame: &FrameLanes<S>,
        [select, v]: [Floats<S>; 2],
        active: u32,
    ) -> (LightSamples<S>, u32) {
        s.vectorize(
            #[inline(always)]
            || {
                let share = Floats::splat(s, lights.environment_probability);
                let (mut sky, mut rest) = (0, select);
                if lanes.has_sky() {
                    sky = active & select.less(share).bits();
                    let most = Floats::splat(s, 1.0 - f32::EPSILON);
                    rest = most.min(Floats::splat(s, 0.0).max((select - share) / (1.0 - share)));
                }
                let surfaces = active & !sky;
                let mut unknown = 0;
                let mut samples = LightSamples::none(s);
                match &self.facing {
                    Some(facing) if surfaces != 0 => {
                        let (p, n) = (from.p.store(), from.n.store());
                        let chosen = facing.choose_patches(&p, &n, &rest.store(), surfaces);
                        let rest = Floats::load(s, &F8(chosen.rest));
                        let density = (1.0 - share) * Floats::load(s, &F8(chosen.probability));
                        let rows = (facing.rows(), Integers::load(s, &U8(chosen.row)));
                        let at = (lights, geometry);
                        samples = lanes.sample_patches(s, at, from.p, rows, [rest, v, density], surfaces);
                    }
                    Some(_) => {}
                    None => unknown = surfaces,
                }
                if sky != 0 {
                    let (from, frames) = (from.store(), Frames::of(frame));
                    let [select, v] = [select.store(), v.store()];
                    let mut found = SkySamples::NONE;
                    for lane in Lanes(sky) {
                        let numbers = [select.0[lane], v.0[lane]];
                        match self.sample(lights, &from.of(lane), &frames.frame(lane), numbers) {
                            None => unknown |= 1 << lane,
                            Some(None) => {}
                            Some(Some(sample)) => found.add(lane, &sample),
                        }
                    }
                    samples = samples.with(s, sky, found.load(s, samples));
                }
                (samples, unknown)
            },
        )
    }
}
