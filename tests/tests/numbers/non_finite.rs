//! Radiance that is not finite: black, counted, and shown with pixel and sample.
//!
//! No scene should give any, so the test has to overflow f32: luminous mirrors face to face, of 3e38 each, add up to infinity
//! wherever the path meets two of them.

use hotspot_integrator::{Control, Gather, render};
use hotspot_tests::picture::settings;
use hotspot_tests::world::{World, emitting, mirror, pinhole, rectangle};

fn overflowing() -> World {
    World::new()
        .with(
            rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            emitting(mirror([1.0; 3]), [3e38, 1.0, 0.0]),
        )
        .with(
            rectangle([0.0, 0.0, 4.0], [0.0, 9.0, 0.0], [9.0, 0.0, 0.0]),
            emitting(mirror([1.0; 3]), [3e38, 1.0, 0.0]),
        )
}

#[test]
fn what_is_not_finite_is_black_counted_and_named() {
    let scene = overflowing().prepare();
    let camera = pinhole([0.3, 0.2, 3.0], [0.0; 3], 70.0);
    let (width, height, spp) = (40, 24, 200);
    let (mut lists, mut sums) = (Vec::new(), Vec::new());
    // From one scattering event on, the mirror shows the one behind the eye: infinite in red. Both kernels.
    for gather in [Gather::RADIANCE, Gather::ALL] {
        let mut settings = settings(width, height, spp, 1, 0);
        settings.gather = gather;
        let rendered = render(&scene, &camera, &settings, Control::default());
        let frame = &rendered.frame;
        let films: Vec<_> = frame.pixels().map(|(x, y)| ((x, y), frame.film_total(x, y))).collect();
        assert!(films.iter().all(|(_, film)| film.sum.iter().chain(&film.squares).all(|v| v.is_finite())));
        assert!(films.iter().all(|(_, film)| film.samples == u64::from(spp)));
        // What is beside the mirror is black anyway; on it every sample is lost, all of its channels.
        assert!(films.iter().all(|(_, film)| film.sum == [0.0; 3]));
        // Every one is counted, though the list is short.
        let lost = rendered.non_finite_count;
        assert!(lost > 20_000 && lost < u64::from(width * height * spp), "{lost}");
        assert!(rendered.non_finite.len() as u64 <= lost && rendered.non_finite.is_sorted());
        let first = rendered.non_finite[0];
        assert!(first.sample < u64::from(spp) && first.half == 0);
        // That sample again, alone in its pixel's list.
        settings.spp = first.sample as u32 + 1;
        let again = render(&scene, &camera, &settings, Control::default());
        assert!(again.non_finite.contains(&first), "{first:?}");
        lists.push((lost, first));
        sums.push(films);
    }
    assert_eq!(lists[0], lists[1]);
    assert_eq!(sums[0], sums[1]);
    // At depth 0 nothing is lost.
    let mut settings = settings(width, height, 4, 0, 0);
    settings.gather = Gather::RADIANCE;
    let rendered = render(&scene, &camera, &settings, Control::default());
    assert_eq!((rendered.non_finite_count, rendered.non_finite.len()), (0, 0));
    assert!(rendered.frame.pixels().any(|(x, y)| rendered.frame.film_total(x, y).sum[0] > 1e38));
}
