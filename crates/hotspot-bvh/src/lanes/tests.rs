//! Rays in lanes against single rays.

use super::*;
use crate::filter::Candidate;
use crate::random::Random;
use crate::ray::Hit;
use crate::simd::{Isa, WithSimd, dispatch};
use crate::{BuildOptions, NoFilter};
use hotspot_probe::RayProbe;

/// Lets every third triangle go.
#[derive(Clone, Copy)]
struct Thirds;
impl Filter for Thirds {
    const ON: bool = true;
    fn concerns(&self, _instance: u32, primitive: u32) -> bool {
        primitive.is_multiple_of(3)
    }
    fn accept<P: RayProbe>(&mut self, _candidate: &Candidate<'_>, _probe: &mut P) -> bool {
        false
    }
}

type Vectors8 = [[f32; 3]; 8];

struct Ask<'a> {
    bvh: &'a Bvh,
    triangles: &'a [[[f32; 3]; 3]],
    origins: Vectors8,
    directions: Vectors8,
    from: [u32; 8],
    t_max: [f32; 8],
    active: u32,
    filtered: bool,
}

fn columns(vectors: &Vectors8) -> [F8; 3] {
    core::array::from_fn(|axis| F8(vectors.map(|v| v[axis])))
}

impl WithSimd for Ask<'_> {
    type Output = ([Option<Hit>; 8], u32, [Option<(u32, u32)>; 8]);

    fn run<S: Simd>(self, s: S) -> Self::Output {
        let Self { bvh, triangles, origins, directions, from, t_max, active, filtered } = self;
        let rays = Rays {
            origin: Vectors::load(s, &columns(&origins)),
            direction: Vectors::load(s, &columns(&directions)),
        };
        let (from, t_max) = (Integers::load(s, &U8(from)), Floats::load(s, &F8(t_max)));
        let ends = [from, from + 5];
        let (nearest, occluded) = if filtered {
            let filters = [Thirds; 8];
            (
                bvh.closest_of_lanes::<_, _, _, false>(s, &rays, from, active, (&filters, &mut NoProbe)),
                bvh.occluded_lanes::<_, _, _, false>(s, &rays, t_max, ends, active, (&filters, &mut NoProbe)),
            )
        } else {
            let filters = [NoFilter; 8];
            (
                bvh.closest_of_lanes::<_, _, _, false>(s, &rays, from, active, (&filters, &mut NoProbe)),
                bvh.occluded_lanes::<_, _, _, false>(s, &rays, t_max, ends, active, (&filters, &mut NoProbe)),
            )
        };
        let corner = |corner: usize| {
            columns(
                &nearest
                    .primitive
                    .store()
                    .0
                    .map(|p| triangles.get(p as usize).map_or([0.0; 3], |triangle| triangle[corner])),
            )
        };
        let corners = [0, 1, 2].map(|i| Vectors::load(s, &corner(i)));
        let hits = nearest.hits(s, &rays, corners);
        let (t, u, v) = (hits.t.store().0, hits.u.store().0, hits.v.store().0);
        let (primitive, normal) = (hits.primitive.store().0, hits.normal.store());
        let hit = |lane: usize| {
            (hits.found >> lane & 1 != 0).then(|| Hit {
                t: t[lane],
                u: u[lane],
                v: v[lane],
                primitive: primitive[lane],
                instance: NO_INSTANCE,
                normal: vector(&normal, lane),
            })
        };
        let [first, _] = bvh.closest_of_packet_in_lanes(s, [&rays, &rays], 8);
        let (t, primitive) = (first.t.store().0, first.primitive.store().0);
        let packet =
            |lane: usize| (first.found >> lane & 1 != 0).then(|| (primitive[lane], t[lane].to_bits()));
        (core::array::from_fn(hit), occluded, core::array::from_fn(packet))
    }
}

/// Soups with shared corners and equal triangles, and nothing at all; rays aimed at corners, edges and anywhere, along axes, with
/// components of either zero, subnormal, infinite and no numbers, or of no length.
#[test]
fn lanes_find_what_single_rays_find() {
    let mut random = Random(11);
    let odd = [0.0, -0.0, 1e-42, -1e-39, f32::INFINITY, f32::NAN, 3e38];
    let (mut found, mut blocked) = (0, 0);
    for soup in 0..12 {
        let mut triangles: Vec<[[f32; 3]; 3]> = Vec::new();
        for index in 0..if soup == 0 { 0 } else { 200 } {
            let mut point = || core::array::from_fn(|_| random.signed());
            let mut triangle = [point(), point(), point()];
            if index % 3 == 1 {
                triangle[0] = triangles[index - 1][1];
            } else if index % 7 == 5 {
                triangle = triangles[index - 3];
            }
            triangles.push(triangle);
        }
        let bvh = Bvh::build(&triangles, BuildOptions::default()).expect("soups can be built");
        for round in 0..200 {
            let mut origins = [[0.0; 3]; 8];
            let mut directions = [[0.0; 3]; 8];
            for lane in 0..8 {
                let origin: [f32; 3] = core::array::from_fn(|_| 2.0 * random.signed());
                let mut towards: [f32; 3] = core::array::from_fn(|_| random.signed());
                if lane % 2 == 1 && !triangles.is_empty() {
                    let [a, b, _] = triangles[(round * 8 + lane) % triangles.len()];
                    let share = [0.0, 0.5][round % 2];
                    towards = core::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
                }
                let mut direction = core::array::from_fn(|i| towards[i] - origin[i]);
                if lane % 4 == 2 {
                    direction[(round + lane) % 3] = odd[round % odd.len()];
                }
                if lane == 6 && round % 5 == 0 {
                    direction = [0.0; 3];
                }
                (origins[lane], directions[lane]) = (origin, direction);
            }
            if round % 3 == 0 {
                // Close together, as packets want them.
                origins = [origins[1]; 8];
                let first = directions[1];
                directions = core::array::from_fn(|_| first.map(|c| c + 1e-3 * random.signed()));
            }
            let from: [u32; 8] = core::array::from_fn(|lane| (round * 13 + lane * 7) as u32 % 200);
            let t_max = [0.5, 1.0, f32::INFINITY, 2.0, 1.0, f32::NAN, 0.0, 1e-30];
            let active = 0xff & !(1 << (round % 9));
            for filtered in [false, true] {
                let ask = || Ask {
                    bvh: &bvh,
                    triangles: &triangles,
                    origins,
                    directions,
                    from,
                    t_max,
                    active,
                    filtered,
                };
                for isa in [Isa::Auto, Isa::Portable] {
                    let (hits, occluded, packet) = dispatch(isa, ask());
                    for lane in 0..8 {
                        let ray = Ray::new(origins[lane], directions[lane]);
                        let shadow = Ray { t_max: t_max[lane], ..ray };
                        let (a, b) = (from[lane], from[lane] + 5);
                        let s = crate::simd::Portable;
                        let (mut hit, mut shadowed) = if filtered {
                            (
                                bvh.closest_hit_filtered(s, &ray, [a], Thirds, NoProbe),
                                bvh.occluded_filtered(s, &shadow, [a, b], Thirds, NoProbe),
                            )
                        } else {
                            (
                                bvh.closest_hit_flat(s, &ray, [a], NoProbe),
                                bvh.occluded_flat(s, &shadow, [a, b], NoProbe),
                            )
                        };
                        if active >> lane & 1 == 0 {
                            (hit, shadowed) = (None, false);
                        }
                        let place = format!("soup {soup}, round {round}, lane {lane}");
                        assert_eq!(hits[lane], hit, "{place}");
                        assert_eq!(occluded >> lane & 1 != 0, shadowed, "{place}");
                        let alone = bvh.closest_hit_flat(s, &ray, [], NoProbe);
                        let alone = alone.map(|hit| (hit.primitive, hit.t.to_bits()));
                        assert_eq!(packet[lane], alone, "{place}, packet");
                        found += u32::from(hit.is_some());
                        blocked += u32::from(shadowed);
                    }
                }
            }
        }
    }
    assert!(found > 20_000 && blocked > 5000, "{found} hits, {blocked} blocked");
}
