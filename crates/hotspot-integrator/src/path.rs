//! The path loop: one camera sample, from the camera to its end.
//!
//! Unidirectional path tracing with one light sample at each non-specular vertex; multiple importance sampling (power
//! heuristic) between light and BSDF sampling. The BSDF half reuses the continuation ray, so a vertex casts two rays, not
//! three as in pbrt-v3. Roulette follows pbrt-v3 (Pharr, Jakob, Humphreys, *Physically Based Rendering*, 3rd edition,
//! section 14.5.4). Shading happens in the shading frame, turned to the side of the path; emitters use geometric normals.

use crate::bsdf::{Bsdf, Glass, RoughMetal, Substrate};
use crate::cutout::{Cutouts, presence};
use crate::geometry::{Attributes, Part, Surface, SurfacePoint};
use crate::light::{LightTarget, area_to_solid_angle, ray_to_position};
use crate::math::{Frame, power_heuristic};
use crate::sampler::{Dimensions, Sampler};
use crate::scene::RenderScene;
use crate::texture::{color, mapped_normal, scalar};
use glam::{Vec2, Vec3};
use hotspot_bvh::simd::Simd;
use hotspot_bvh::{Hit, NO_INSTANCE, Ray, RayProbe};
use hotspot_cost::Cause;
use hotspot_probe::{NONE, Probe, RayKind, Spawner};

/// What a kernel is compiled for.
pub(crate) trait Class {
    /// Surfaces other than matte.
    const LOBES: bool;
    /// Everything that varies over a surface or is seldom used: textures, vertex colours, bumps, mixed and unlit
    /// materials, absorption.
    const TEXTURED: bool;
}

pub(crate) struct MatteClass;
pub(crate) struct LobesClass;
pub(crate) struct FullClass;

impl Class for MatteClass {
    const LOBES: bool = false;
    const TEXTURED: bool = false;
}
impl Class for LobesClass {
    const LOBES: bool = true;
    const TEXTURED: bool = false;
}
impl Class for FullClass {
    const LOBES: bool = true;
    const TEXTURED: bool = true;
}

/// Settings of the loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathSettings {
    /// Most scattering events.
    pub(crate) max_depth: u32,
    /// Index of the first surface vertex after which roulette may end the path; `u32::MAX`: never.
    pub(crate) roulette_from: u32,
    /// Whether shadow rays are traced or only counted.
    pub(crate) trace_shadow_rays: bool,
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
}

/// Traces one path.
#[inline(always)]
pub(crate) fn trace<S: Simd, P: Probe, C: Class>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings,
    origin: Vec3,
    direction: Vec3,
    sampler: &Sampler<'_>,
    probe: &mut P,
) -> PathResult {
    let mut ray = Ray::new(origin.to_array(), direction.to_array());
    let mut wo = -direction;
    let mut radiance = Vec3::ZERO;
    let mut throughput = Vec3::ONE;
    let mut eta_scale = 1.0f32;
    let mut spawner = Spawner::CAMERA;
    let mut scattered = Scattered { pdf: f32::INFINITY, cos: 1.0 };
    let mut first_object = NONE;
    let mut bounces = 0u32;
    // Of the glass that the path is in.
    let mut absorption = Vec3::ZERO;
    let end = |radiance, cause, throughput: Vec3, first_object| PathResult {
        radiance,
        cause,
        throughput: throughput.max_element(),
        first_object,
    };

    loop {
        let Some(hit) = closest_hit(simd, scene, &ray, sampler, bounces, probe.ray(spawner)) else {
            if let Some((environment, pdf)) = scene.lights.escaped(-wo, scattered.cos, probe) {
                radiance += throughput * environment * power_heuristic(scattered.pdf, pdf);
            }
            return end(radiance, Cause::Escaped, throughput, first_object);
        };
        let surface = scene.geometry.surface(hit.instance, hit.primitive);
        let part = surface.part;
        if bounces == 0 {
            first_object = part.object;
        }
        let material = &scene.materials[part.material as usize];
        let geometric = Vec3::from_array(hit.normal);
        let attributes =
            if C::TEXTURED { scene.geometry.attributes(surface, hit.u, hit.v) } else { Attributes::NONE };
        if C::TEXTURED && absorption != Vec3::ZERO {
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
                let light_pdf = area_to_solid_angle(part.light_pdf_area, hit.t * hit.t, cos);
                radiance += throughput * emission * power_heuristic(scattered.pdf, light_pdf);
            }
        }
        if C::TEXTURED
            && let hotspot_scene::Bsdf::Unlit { color: shown } = &material.bsdf
        {
            radiance += throughput * color(&scene.textures, shown, &attributes, probe) * attributes.tint;
            return end(radiance, Cause::Absorbed, throughput, first_object);
        }
        if bounces >= settings.max_depth {
            return end(radiance, Cause::DepthLimit, throughput, first_object);
        }

        // The shading frame, turned to the path's side.
        let smooth = scene.geometry.normal(surface, &hit);
        let front = wo.dot(smooth) >= 0.0;
        let mut normal = if front { smooth } else { -smooth };
        if C::TEXTURED && part.has_tangents() {
            normal = bumped(scene, surface, &hit, &attributes, smooth, wo, probe);
        }
        let frame = Frame::new(normal);
        let local_wo = frame.to_local(wo);
        let choices = if C::LOBES { sampler.get(Dimensions::choices(bounces)) } else { [0.0; 4] };
        let resolved = resolve::<P, C>(scene, &material.bsdf, &attributes, front, choices[2], probe);
        let point = scene.geometry.point(surface, hit.u, hit.v);
        let directions = sampler.get(Dimensions::directions(bounces));

        if !resolved.is_specular() {
            let direct = sample_light::<S, P, C>(
                simd,
                scene,
                settings,
                &Vertex {
                    part,
                    point: &point,
                    geometric,
                    frame: &frame,
                    local_wo,
                    bounce: bounces,
                    sampler,
                    absorption,
                },
                &resolved,
                [directions[2], directions[3]],
                probe,
            );
            radiance += throughput * direct;
        }

        probe.bsdf(1);
        let u = Vec2::new(directions[0], directions[1]);
        let Some(sample) = resolved.sample(local_wo, choices[0], u) else {
            return end(radiance, Cause::Absorbed, throughput, first_object);
        };
        if C::TEXTURED
            && sample.wi.z < 0.0
            && let Bsdf::Glass(glass) = &resolved
            && !glass.thin
        {
            absorption = if front { glass.absorption } else { Vec3::ZERO };
        }
        throughput *= sample.weight;
        eta_scale *= sample.eta_scale;

        if bounces >= settings.roulette_from {
            let survival = throughput.max_element() * eta_scale;
            if survival < 1.0 {
                let survival = survival.min(0.95);
                let choice = if C::LOBES { choices[1] } else { sampler.get(Dimensions::choices(bounces))[1] };
                if choice >= survival {
                    return end(radiance, Cause::Roulette, throughput, first_object);
                }
                throughput /= survival;
            }
        }

        let wi = frame.to_world(sample.wi);
        let side = if wi.dot(geometric) < 0.0 { -geometric } else { geometric };
        ray = Ray::new(point.leave(side).to_array(), wi.to_array());
        wo = -wi;
        scattered = Scattered { pdf: sample.pdf, cos: sample.wi.z };
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

/// A surface vertex, as light sampling sees it.
struct Vertex<'a> {
    part: &'a Part,
    point: &'a SurfacePoint,
    geometric: Vec3,
    frame: &'a Frame,
    local_wo: Vec3,
    bounce: u32,
    sampler: &'a Sampler<'a>,
    /// Of the glass that it is in.
    absorption: Vec3,
}

/// The light-sampled half of direct light, weighted.
#[inline(always)]
fn sample_light<S: Simd, P: Probe, C: Class>(
    simd: S,
    scene: &RenderScene,
    settings: &PathSettings,
    vertex: &Vertex<'_>,
    bsdf: &Bsdf,
    u: [f32; 2],
    probe: &mut P,
) -> Vec3 {
    let lights = &scene.lights;
    let Some(light) = lights.sample(vertex.point.p, vertex.frame, u, probe) else {
        return Vec3::ZERO;
    };
    probe.bsdf(1);
    let (f_cos, mut bsdf_pdf) = bsdf.eval(vertex.local_wo, vertex.frame.to_local(light.wi));
    if f_cos == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let side = if light.wi.dot(vertex.geometric) < 0.0 { -vertex.geometric } else { vertex.geometric };
    let origin = vertex.point.leave(side);
    let (emission, ray, aim) = match light.target {
        LightTarget::Environment(radiance) => {
            (radiance, Ray::new(origin.to_array(), light.wi.to_array()), NONE)
        }
        LightTarget::Surface { primitive, point, uv, cos, normal } => {
            let part = scene.geometry.part(primitive);
            let material = &scene.materials[part.material as usize];
            if !(cos > 0.0 || (material.double_sided && cos < 0.0)) {
                return Vec3::ZERO;
            }
            let emission = if C::TEXTURED {
                let surface = scene.geometry.surface(NO_INSTANCE, primitive);
                let attributes = scene.geometry.attributes(surface, uv.x, uv.y);
                let (share, lookups, bytes) = presence(scene, material, &attributes);
                if lookups > 0 {
                    probe.texture(lookups, bytes);
                }
                if share == 0.0 {
                    return Vec3::ZERO;
                }
                color(&scene.textures, &material.emission, &attributes, probe) * share
            } else {
                Vec3::from_array(material.emission.factor)
            };
            let target = point.meet(if cos < 0.0 { -normal } else { normal }, origin);
            let mut ray = Ray::new(origin.to_array(), (target - origin).to_array());
            ray.t_max = 1.0;
            (emission, ray, part.object)
        }
        // BSDF sampling never finds these: it has no share.
        LightTarget::Position { irradiance, position } => {
            let Some(ray) = ray_to_position(origin, position) else { return Vec3::ZERO };
            bsdf_pdf = 0.0;
            (irradiance, ray, NONE)
        }
        LightTarget::Direction(irradiance) => {
            bsdf_pdf = 0.0;
            (irradiance, Ray::new(origin.to_array(), light.wi.to_array()), NONE)
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
    if occluded(simd, scene, &ray, vertex.sampler, vertex.bounce, probe.ray(spawner)) {
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

/// The material at a point: textures looked up, one part of a mixed material chosen by `choice`.
#[inline(always)]
fn resolve<P: Probe, C: Class>(
    scene: &RenderScene,
    bsdf: &hotspot_scene::Bsdf,
    point: &Attributes,
    front: bool,
    mut choice: f32,
    probe: &mut P,
) -> Bsdf {
    use hotspot_scene::Bsdf as Given;
    if !C::LOBES {
        return match bsdf {
            Given::Matte { reflectance } => Bsdf::Matte(Vec3::from_array(reflectance.factor)),
            _ => unreachable!("a scene of class matte holds only matte surfaces"),
        };
    }
    let mut bsdf = bsdf;
    if C::TEXTURED {
        // A linear mix is the expectation of choosing one part with its share as probability.
        while let Given::Mix { weight, base, other } = bsdf {
            let share = scalar(&scene.textures, weight, point, probe);
            // What is left of the number is uniform again.
            (bsdf, choice) = if choice < share {
                (other, choice / share)
            } else {
                (base, (choice - share) / (1.0 - share))
            };
        }
    }
    let mut colored = |c: &hotspot_scene::Color| {
        if C::TEXTURED { color(&scene.textures, c, point, probe) } else { Vec3::from_array(c.factor) }
    };
    // Vertex colours multiply the base colour.
    let tint = |base: Vec3| if C::TEXTURED { base * point.tint } else { base };
    // α = max(roughness², 1e-3)
    match bsdf {
        Given::Matte { reflectance } => Bsdf::Matte(tint(colored(reflectance))),
        Given::Substrate { diffuse, specular, specular_weight, roughness } => Bsdf::Substrate(Substrate {
            diffuse: tint(colored(diffuse)),
            specular: colored(specular) * number::<P, C>(scene, specular_weight, point, probe),
            alpha: alpha::<P, C>(scene, roughness, point, probe),
        }),
        Given::Mirror { reflectance } => Bsdf::Mirror(tint(colored(reflectance))),
        Given::RoughMetal { f0, roughness } => Bsdf::RoughMetal(RoughMetal {
            f0: tint(colored(f0)),
            alpha: alpha::<P, C>(scene, roughness, point, probe),
        }),
        Given::Glass { ior, thin, transmittance, absorption } => Bsdf::Glass(Glass {
            transmittance: tint(colored(transmittance)),
            absorption: Vec3::from_array(*absorption),
            eta: if *thin || front { *ior } else { 1.0 / *ior },
            thin: *thin,
        }),
        Given::Unlit { .. } | Given::Mix { .. } => Bsdf::Matte(Vec3::ZERO),
    }
}

#[inline(always)]
fn number<P: Probe, C: Class>(
    scene: &RenderScene,
    given: &hotspot_scene::Scalar,
    point: &Attributes,
    probe: &mut P,
) -> f32 {
    if C::TEXTURED { scalar(&scene.textures, given, point, probe) } else { given.factor }
}

#[inline(always)]
fn alpha<P: Probe, C: Class>(
    scene: &RenderScene,
    roughness: &hotspot_scene::Scalar,
    point: &Attributes,
    probe: &mut P,
) -> f32 {
    let roughness = number::<P, C>(scene, roughness, point, probe);
    (roughness * roughness).max(1e-3)
}

/// The nearest hit. Cutouts and instances have a traversal of their own, so that a scene without them does not pay.
#[inline(always)]
fn closest_hit<S: Simd, R: RayProbe>(
    simd: S,
    scene: &RenderScene,
    ray: &Ray,
    sampler: &Sampler<'_>,
    bounce: u32,
    probe: R,
) -> Option<Hit> {
    if scene.cutouts {
        let filter = Cutouts { scene, ray_key: sampler.ray_key(2 * bounce) };
        scene.bvh.closest_hit_filtered(simd, ray, filter, probe)
    } else {
        scene.bvh.closest_hit_with(simd, ray, probe)
    }
}

/// Whether a shadow ray is blocked.
#[inline(always)]
fn occluded<S: Simd, R: RayProbe>(
    simd: S,
    scene: &RenderScene,
    ray: &Ray,
    sampler: &Sampler<'_>,
    bounce: u32,
    probe: R,
) -> bool {
    if scene.cutouts {
        let filter = Cutouts { scene, ray_key: sampler.ray_key(2 * bounce + 1) };
        scene.bvh.occluded_filtered(simd, ray, filter, probe)
    } else {
        scene.bvh.occluded_with(simd, ray, probe)
    }
}

/// The shading normal on the path's side, under a normal map. `smooth` is the interpolated normal.
///
/// A mapped normal may point away from where the path came from although the surface does not. It is then tilted back until
/// the path arrives just above the horizon: a surface must not vanish behind its own bumps.
#[inline(never)]
fn bumped<P: Probe>(
    scene: &RenderScene,
    surface: Surface<'_>,
    hit: &Hit,
    point: &Attributes,
    smooth: Vec3,
    wo: Vec3,
    probe: &mut P,
) -> Vec3 {
    const LEAST_COS: f32 = 1e-3;
    let side = if wo.dot(smooth) >= 0.0 { 1.0 } else { -1.0 };
    let material = &scene.materials[surface.part.material as usize];
    let (Some(map), Some((tangent, bitangent))) =
        (&material.normal_map, scene.geometry.tangents(surface, smooth, hit.u, hit.v))
    else {
        return smooth * side;
    };
    let n = mapped_normal(&scene.textures, map, point, probe);
    let Some(mapped) = (tangent * n.x + bitangent * n.y + smooth * n.z).try_normalize() else {
        return smooth * side;
    };
    let normal = mapped * side;
    let cos = wo.dot(normal);
    if cos >= LEAST_COS {
        return normal;
    }
    (normal + wo * (LEAST_COS - cos)).try_normalize().unwrap_or(smooth * side)
}
