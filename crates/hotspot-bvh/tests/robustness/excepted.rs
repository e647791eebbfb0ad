//! Triangles that a ray is known not to hit: they cost less, and nothing else changes.

use crate::support::{Heard, Listener, Rng, Scene, bits, narrow, point_on, soup, towards};
use hotspot_bvh::oracle::Counts;
use hotspot_bvh::simd::{Isa, Simd, WithSimd, dispatch};
use hotspot_bvh::{Bvh, Hit, NO_INSTANCE, Quality, Ray};

/// The nearest hit and whether there is any, but for two triangles, and what was visited for each.
struct But<'a>(&'a Bvh, &'a Ray, [u32; 2]);

impl WithSimd for But<'_> {
    type Output = (Option<Hit>, bool, [Counts; 2]);
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self(bvh, ray, except) = self;
        let (mut nearest, mut any) = (Heard::default(), Heard::default());
        let hit = bvh.closest_hit_flat(simd, ray, except, Listener(&mut nearest));
        let blocked = bvh.occluded_flat(simd, ray, except, Listener(&mut any));
        (hit, blocked, [nearest.counts, any.counts])
    }
}

/// Under every instruction set.
fn but(scene: &Scene, ray: &Ray, except: [u32; 2]) -> [<But<'static> as WithSimd>::Output; 2] {
    let [portable, auto] =
        [Isa::Portable, Isa::Auto].map(|isa| dispatch(isa, But(&scene.trees[0], ray, except)));
    [portable, auto]
}

/// Even where they are hit: 1200 rays at triangles, without what they hit first and second.
#[test]
fn excepted_triangles_are_as_if_they_were_not_there() {
    let mut rng = Rng::new(131);
    let triangles = soup(&mut rng, 300, 0.5);
    let scene = Scene::new(triangles.clone(), Quality::Medium);
    let mut behind = 0;
    for _ in 0..1200 {
        let at = *rng.pick(&triangles);
        let ray = towards(narrow(rng.cube()), point_on(&mut rng, &at));
        let mut left: Vec<u32> = (0..300).collect();
        let mut except = [u32::MAX; 2];
        for round in 0..=2 {
            let rest = Scene::new(left.iter().map(|&p| triangles[p as usize]).collect(), Quality::Fast);
            let expected = rest.check(&ray).map(|hit| Hit { primitive: left[hit.primitive as usize], ..hit });
            for (hit, blocked, _) in but(&scene, &ray, except) {
                assert_eq!(
                    (bits(hit), blocked),
                    (bits(expected), expected.is_some()),
                    "{ray:?} but {except:?}"
                );
            }
            let Some(hit) = expected.filter(|_| round < 2) else { break };
            assert_eq!(hit.instance, NO_INSTANCE);
            left.retain(|&p| p != hit.primitive);
            except[round] = hit.primitive;
            behind += u32::from(round == 1);
        }
    }
    assert!(behind > 600, "a second triangle behind the first: {behind}");
}

/// Where they are not hit, hits, visits and counts are those without. 2000 rays off triangles, which are tested first.
#[test]
fn excepting_what_is_not_hit_changes_nothing() {
    let mut rng = Rng::new(132);
    let scene = Scene::new(soup(&mut rng, 2000, 0.1), Quality::Medium);
    let mut visited = 0;
    for _ in 0..2000 {
        let from = rng.below(2000);
        let [origin, target] = [from, rng.below(2000)].map(|p| point_on(&mut rng, &scene.triangles[p]));
        let ray = Ray { t_max: 1.0, ..towards(origin, target) };
        let without = but(&scene, &ray, [u32::MAX; 2]);
        let hit = without[0].0.map(|hit| hit.primitive);
        let other = rng.below(2000) as u32;
        let except = [from as u32, other].map(|p| if hit == Some(p) { u32::MAX } else { p });
        // One that is hit further off would end a search for any hit.
        let any = without[0].1;
        for ((hit, blocked, [nearest, shadow]), (same_hit, same_blocked, [same, same_shadow])) in
            but(&scene, &ray, except).into_iter().zip(without)
        {
            assert_eq!((bits(hit), blocked, nearest), (bits(same_hit), same_blocked, same), "{ray:?}");
            assert!(any || shadow == same_shadow, "{ray:?}");
            visited += nearest.leaves;
        }
    }
    assert!(visited > 2000, "{visited} blocks visited");
}
