//! The path loop: one camera sample, from the camera to its end.
//!
//! Unidirectional path tracing with one light sample at each non-specular vertex; multiple importance sampling (power
//! heuristic) between light and BSDF sampling. The BSDF half reuses the continuation ray, so a vertex casts two rays, not
//! three as in pbrt-v3. Roulette follows pbrt-v3 (Pharr, Jakob, Humphreys, *Physically Based Rendering*, 3rd edition,
//! section 14.5.4) or goes for efficiency ([`roulette`](crate::roulette)). Shading happens in the shading frame, turned to the
//! side of the path; emitters use geometric normals.

use crate::bsdf::Bsdf;
use crate::cast::{closest_hit, occluded};
use crate::class::{Class, Feature, has};
use crate::geometry::{Attributes, Part, SurfacePoint};
use crate::light::{Learned, LightTarget, Outlook, Viewpoint, area_to_solid_angle, met, ray_to_position};
use crate::math::{Frame, power_heuristic};
use crate::roulette::Survival;
use crate::sampler::{Dimensions, Sampler};
use crate::scene::RenderScene;
use crate::surface::{bumped, emitted, resolve};
use crate::texture::color;
use glam::{Vec2, Vec3};
use hotspot_bvh::simd::Simd;
use hotspot_bvh::{Hit, NO_INSTANCE, Ray};
use hotspot_cost::Cause;
use hotspot_probe::{NONE, Probe, RayKind, Spawner};

/// Rec.709.
pub(crate) const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Settings of the loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathSettings<'a> {
    /// Most scattering events.
    pub(crate) max_depth: u32,
    /// Where and how likely roulette ends the path.
    pub(crate) roulette: Survival,
    /// Whether shadow rays are traced or only counted.
    pub(crate) trace_shadow_rays: bool,
    /// What was learned about lights, for kernels of [`Learning`](crate::class::Learning).
    pub(crate) learned: Option<&'a Learned>,
}

/// What a path brought and how it ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathResult {
    pub(crate) radiance: Vec3,
    pub(crate) cause: Cause,
    pub(crate) throughput: f32,
    pub(crate) first_object: u32,
}

/// How the last vertex took the direction of the present ray: what MIS needs at the next emitter.
#[derive(Clone, Copy)]
struct Scattered {
    /// BSDF pdf; infinite after a specular event or from the camera: the emitter counts in full.
    pdf: f32,
    /// Cosine of the direction with the vertex's shading normal.
    cos: f32,
    /// The vertex, where light sampling depends on it.
    from: Viewpoint,
}

/// The camera ray of a path.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    pub(crate) ray: Ray,
    /// What it hits, of `KNOWN` paths.
    pub(crate) hit: Option<Hit>,
    /// Two numbers for the light sample at the first vertex.
    pub(crate) light: [f32; 2],
}

impl Start {
    /// In place of a path.
    pub(crate) const NONE: Self = Self { ray: Ray::new([0.0; 3], [0.0; 3]), hit: None, light: [0.0; 2] };

    /// A path whose camera ray is not traced yet.
    #[inline(always)]
    pub(crate) fn new((origin, direction): (Vec3, Vec3), light: [f32; 2]) -> Self {
        Self { ray: Ray::new(origin.to_array(), direction.to_array()), hit: None, light }
    }
}

/// Traces one path. `KNOWN`: what the camera ray hits was found before, in a packet.
#[inline(always)]
pub(crate) fn trace<S: Simd, P: Probe, C: Class, const KNOWN: bool>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings<'_>,
    Start { mut ray, hit: first, mut light }: Start,
    sampler: &Sampler<'_>,
    probe: &mut P,
) -> PathResult {
    let mut wo = -Vec3::from_array(ray.direction);
    let mut radiance = Vec3::ZERO;
    let mut throughput = Vec3::ONE;
    // Survival in roulette over throughput: squares of the indices of refraction crossed, and a gain where there is one.
    let mut survival_scale = 1.0f32;
    let mut spawner = Spawner::CAMERA;
    let mut scattered = Scattered { pdf: f32::INFINITY, cos: 1.0, from: Viewpoint::NONE };
    let learned = if C::LEARNED { settings.learned } else { None };
    let mut first_object = NONE;
    let mut bounces = 0u32;
    // The triangle of the world that the ray leaves.
    let mut from = NONE;
    // Of the glass that the path is in.
    let mut absorption = Vec3::ZERO;
    let end = |radiance, cause, throughput: Vec3, first_object| PathResult {
        radiance,
        cause,
        throughput: throughput.max_element(),
        first_object,
    };

    loop {
        let hit = if KNOWN && bounces == 0 {
            first
        } else {
            // Said again, so that the compiler sees that it is no shadow ray.
            let kind = if bounces == 0 { RayKind::Camera } else { RayKind::Bounce };
            let probe = probe.ray(Spawner { kind, ..spawner });
            closest_hit::<S, _, C>(simd, scene, &ray, from, sampler, bounces, probe)
        };
        let Some(hit) = hit else {
            if let Some((environment, mut pdf)) = scene.lights.escaped::<P, C>(-wo, scattered.cos, probe) {
                if let Some(learned) = learned {
                    pdf = learned.pdf_environment(&scene.lights, &scattered.from, -wo, pdf);
                }
                let found = throughput * environment * power_heuristic(scattered.pdf, pdf);
                tell(probe, found, settings.max_depth - bounces);
                radiance += found;
            }
            return end(radiance, Cause::Escaped, throughput, first_object);
        };
        let outlook = learned.map_or(Outlook::NONE, |learned| {
            let (p, n) = met(&ray, &hit);
            learned.outlook(simd, p, n)
        });
        let surface = if has::<C>(Feature::Instances) {
            scene.geometry.surface(hit.instance, hit.primitive)
        } else {
            scene.geometry.world_surface(hit.primitive)
        };
        let part = surface.part;
        probe.landed(hit.instance, hit.primitive, [hit.u, hit.v]);
        if bounces == 0 {
            first_object = part.object;
        }
        let material = &scene.materials[part.material as usize];
        let geometric = Vec3::from_array(hit.normal);
        let attributes = if C::TEXTURED {
            scene.geometry.attributes::<C>(surface, hit.u, hit.v)
        } else {
            Attributes::NONE
        };
        if C::TEXTURED && has::<C>(Feature::Absorption) && absorption != Vec3::ZERO {
            throughput *= Vec3::from_array((absorption * -hit.t).to_array().map(libm::expf));
        }

        if part.light_pdf_area > 0.0 {
            let cos = wo.dot(geometric);
            if cos > 0.0 || (material.double_sided && cos < 0.0) {
                let emission = if C::TEXTURED {
                    color(&scene.textures, &material.emission, &attributes, probe)
                } else {
                    Vec3::from_array(material.emission.factor)
                };
                let mut pdf_area = part.light_pdf_area;
                if let Some(learned) = learned {
                    pdf_area = learned.pdf_area(&scene.lights, &scattered.from, hit.primitive, pdf_area);
                }
                let light_pdf = area_to_solid_angle(pdf_area, hit.t * hit.t, cos);
                let found = throughput * emission * power_heuristic(scattered.pdf, light_pdf);
                tell(probe, found, settings.max_depth - bounces);
                radiance += found;
            }
        }
        if C::TEXTURED
            && has::<C>(Feature::Unlit)
            && let hotspot_scene::Bsdf::Unlit { color: shown } = &material.bsdf
        {
            let found = throughput * color(&scene.textures, shown, &attributes, probe) * attributes.tint;
            tell(probe, found, settings.max_depth - bounces);
            radiance += found;
            return end(radiance, Cause::Absorbed, throughput, first_object);
        }
        if bounces >= settings.max_depth {
            return end(radiance, Cause::DepthLimit, throughput, first_object);
        }

        // The shading frame, turned to the path's side.
        let smooth = scene.geometry.normal(surface, &hit);
        let front = wo.dot(smooth) >= 0.0;
        let mut normal = if front { smooth } else { -smooth };
        if C::TEXTURED && has::<C>(Feature::NormalMaps) && part.has_tangents() {
            normal = bumped(scene, surface, [hit.u, hit.v], &attributes, smooth, wo, probe);
        }
        let frame = Frame::new(normal);
        let local_wo = frame.to_local(wo);
        let mixed = C::TEXTURED && matches!(material.bsdf, hotspot_scene::Bsdf::Mix { .. });
        let part_choice = if mixed { sampler.get(Dimensions::choices(bounces))[2] } else { 0.0 };
        let resolved = resolve::<P, C>(scene, &material.bsdf, &attributes, front, part_choice, probe);
        let point = scene.geometry.point(surface, hit.u, hit.v);
        let in_world = !has::<C>(Feature::Instances) || hit.instance == NO_INSTANCE;
        let leaves = if in_world { hit.primitive } else { NONE };
        let viewpoint = if C::LEARNED { Viewpoint::new(point.p, frame.n, outlook) } else { Viewpoint::NONE };

        if !resolved.is_specular() {
            let direct = direct_light::<S, P, C>(
                simd,
                scene,
                settings,
                &Vertex {
                    part,
                    primitive: leaves,
                    point: &point,
                    from: &viewpoint,
                    geometric,
                    frame: &frame,
                    local_wo,
                    bounce: bounces,
                    sampler,
                    absorption,
                    bsdf: &resolved,
                    u: light,
                },
                probe,
            );
            // Of no light there is none even where the throughput is infinite.
            if direct != Vec3::ZERO {
                let found = throughput * direct;
                tell(probe, found, settings.max_depth - bounces - 1);
                radiance += found;
            }
        }

        probe.bsdf(1);
        let [u, v, next_light @ ..] = sampler.get(Dimensions::segment(bounces + 1));
        light = next_light;
        let (lobe, u) = if C::LOBES { resolved.choose_lobe(u) } else { (0.0, u) };
        let Some(sample) = resolved.sample(local_wo, lobe, Vec2::new(u, v)) else {
            return end(radiance, Cause::Absorbed, throughput, first_object);
        };
        throughput *= sample.weight;
        survival_scale *= sample.eta_scale;
        if bounces == 0
            && let Some(gain) = settings.roulette.gain
        {
            survival_scale *= Survival::relative(gain, throughput.max_element() * survival_scale);
        }

        if bounces >= settings.roulette.from {
            let survival = throughput.max_element() * survival_scale;
            if survival < 1.0 {
                let survival = survival.min(0.95);
                if sampler.get(Dimensions::choices(bounces))[1] >= survival {
                    return end(radiance, Cause::Roulette, throughput, first_object);
                }
                throughput /= survival;
            }
        }

        if P::ON {
            probe.scattered(throughput.max_element());
        }
        let wi = frame.to_world(sample.wi);
        let side = if wi.dot(geometric) < 0.0 { -geometric } else { geometric };
        // Which side the path is on goes by the surface as it is, not as it is shaded: so the ray leaves it.
        let came_from_front = wo.dot(geometric) >= 0.0;
        if C::TEXTURED
            && has::<C>(Feature::Absorption)
            && let Bsdf::Glass(glass) = &resolved
            && !glass.thin
            && came_from_front == (wi.dot(geometric) < 0.0)
        {
            absorption = if came_from_front { glass.absorption } else { Vec3::ZERO };
        }
        ray = Ray::new(point.leave(side).to_array(), wi.to_array());
        wo = -wi;
        scattered = Scattered { pdf: sample.pdf, cos: sample.wi.z, from: viewpoint };
        from = leaves;
        bounces += 1;
        spawner = Spawner {
            object: part.object,
            material: part.material,
            bounce: bounces,
            kind: RayKind::Bounce,
            light: NONE,
        };
    }
}

/// Tells a probe that listens of light found after so many scattering events that `left` more would have been allowed.
#[inline(always)]
fn tell<P: Probe>(probe: &mut P, found: Vec3, left: u32) {
    if P::ON {
        probe.light(left, found.dot(LUMINANCE));
    }
}

/// A surface vertex, as light sampling sees it.
struct Vertex<'a> {
    part: &'a Part,
    /// Its triangle, if of the world.
    primitive: u32,
    point: &'a SurfacePoint,
    from: &'a Viewpoint,
    geometric: Vec3,
    frame: &'a Frame,
    local_wo: Vec3,
    bounce: u32,
    sampler: &'a Sampler<'a>,
    /// Of the glass that it is in.
    absorption: Vec3,
    bsdf: &'a Bsdf,
    /// Two numbers to choose a light and a point on it.
    u: [f32; 2],
}

/// The light-sampled half of direct light, weighted. Environment maps and punctual lights have a function of their own, so
/// that scenes lit by surfaces and constant environments do not pay for them.
#[inline(always)]
fn direct_light<S: Simd, P: Probe, C: Class>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings<'_>,
    vertex: &Vertex<'_>,
    probe: &mut P,
) -> Vec3 {
    if scene.lights.has_maps_or_points::<C>() {
        sample_any_light::<S, P, C>(simd, scene, settings, vertex, probe)
    } else {
        sample_light::<S, P, C, false>(simd, scene, settings, vertex, probe)
    }
}

#[inline(never)]
fn sample_any_light<S: Simd, P: Probe, C: Class>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings<'_>,
    vertex: &Vertex<'_>,
    probe: &mut P,
) -> Vec3 {
    simd.vectorize(
        #[inline(always)]
        || sample_light::<S, P, C, true>(simd, scene, settings, vertex, probe),
    )
}

/// `ANY`: the scene has an environment map or punctual lights.
#[inline(always)]
fn sample_light<S: Simd, P: Probe, C: Class, const ANY: bool>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings<'_>,
    vertex: &Vertex<'_>,
    probe: &mut P,
) -> Vec3 {
    let lights = &scene.lights;
    let learned = if C::LEARNED { settings.learned } else { None };
    let light = match learned.and_then(|l| l.sample(lights, vertex.from, vertex.frame, vertex.u)) {
        Some(light) => light,
        None => lights.sample::<P, C, ANY>(vertex.point.p, vertex.frame, vertex.u, probe),
    };
    let Some(light) = light else { return Vec3::ZERO };
    probe.bsdf(1);
    let (f_cos, mut bsdf_pdf) = vertex.bsdf.eval(vertex.local_wo, vertex.frame.to_local(light.wi));
    if f_cos == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let side = if light.wi.dot(vertex.geometric) < 0.0 { -vertex.geometric } else { vertex.geometric };
    let origin = vertex.point.leave(side);
    let (emission, ray, aim, target) = match light.target {
        LightTarget::Environment(radiance) => {
            (radiance, Ray::new(origin.to_array(), light.wi.to_array()), NONE, NONE)
        }
        LightTarget::Surface { primitive, point, uv, cos, normal } => {
            let part = scene.geometry.part(primitive);
            let material = &scene.materials[part.material as usize];
            if !(cos > 0.0 || (material.double_sided && cos < 0.0)) {
                return Vec3::ZERO;
            }
            let emission = emitted::<P, C>(scene, primitive, uv, probe);
            let target = point.meet(if cos < 0.0 { -normal } else { normal }, origin);
            let mut ray = Ray::new(origin.to_array(), (target - origin).to_array());
            ray.t_max = 1.0;
            (emission, ray, part.object, primitive)
        }
        // BSDF sampling never finds these: it has no share.
        _ if !ANY || !has::<C>(Feature::PunctualLights) => return Vec3::ZERO,
        LightTarget::Position { irradiance, position } => {
            let Some(ray) = ray_to_position(origin, position) else { return Vec3::ZERO };
            bsdf_pdf = 0.0;
            (irradiance, ray, NONE, NONE)
        }
        LightTarget::Direction(irradiance) => {
            bsdf_pdf = 0.0;
            (irradiance, Ray::new(origin.to_array(), light.wi.to_array()), NONE, NONE)
        }
    };
    if emission == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let spawner = Spawner {
        object: vertex.part.object,
        material: vertex.part.material,
        bounce: vertex.bounce,
        kind: RayKind::Shadow,
        light: aim,
    };
    if !settings.trace_shadow_rays {
        probe.untraced(spawner);
        return Vec3::ZERO;
    }
    let ends = [vertex.primitive, target];
    let (sampler, bounce) = (vertex.sampler, vertex.bounce);
    if occluded::<S, _, C>(simd, scene, &ray, ends, sampler, bounce, probe.ray(spawner)) {
        return Vec3::ZERO;
    }
    let mut arriving = emission;
    // A light that is in the same glass; what is infinitely far away is not.
    if C::TEXTURED && vertex.absorption != Vec3::ZERO && ray.t_max.is_finite() {
        let length = Vec3::from_array(ray.direction).length() * ray.t_max;
        arriving *= Vec3::from_array((vertex.absorption * -length).to_array().map(libm::expf));
    }
    f_cos * arriving * (power_heuristic(light.pdf, bsdf_pdf) / light.pdf)
}
