//! A million samples in one pixel: sums in f64, not in f32, where a million times 0.1 makes 100 958.

use hotspot_cost::FilmPixel;
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::world::{Random, World, light, pencil, rectangle};

/// What is asked for; f64 sums keep ten thousand times more.
const WITHIN: f64 = 1e-5;

/// A lamp that fills the pixel, a million times; in halves as well.
#[test]
fn a_million_samples_of_one_radiance() {
    let radiance = [0.1f32, 1.0 / 3.0, 7e-4];
    let scene =
        World::new().with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), light(radiance)).prepare();
    for intervals in [false, true] {
        let mut settings = settings(1, 1, 1_000_000, 4, 0);
        settings.intervals = intervals;
        let film = frame(&scene, &pencil([0.1, 0.2, 3.0], [0.0; 3]), &settings).frame.film_total(0, 0);
        assert_eq!(film.samples, 1_000_000);
        for (sum, radiance) in film.sum.into_iter().zip(radiance) {
            let off = (sum / 1e6 / f64::from(radiance) - 1.0).abs();
            assert!(off < WITHIN * 1e-4, "intervals {intervals}: off by {off:e}");
        }
    }
}

/// A million radiances from 1e-6 to 1e6, against a sum that carries what it rounds away (Neumaier 1974).
#[test]
fn a_million_samples_of_all_sizes() {
    let mut random = Random(1);
    let mut film = FilmPixel::default();
    let (mut sum, mut carried) = (0.0f64, 0.0f64);
    let mut single = 0.0f32;
    for _ in 0..1_000_000 {
        let value = 10f64.powf(random.within(-6.0, 6.0)) as f32;
        film.add([value; 3]);
        single += value;
        let value = f64::from(value);
        let next = sum + value;
        carried += if sum >= value { (sum - next) + value } else { (value - next) + sum };
        sum = next;
    }
    let exact = sum + carried;
    let off = (film.sum[0] / exact - 1.0).abs();
    assert!(off < WITHIN * 1e-6, "off by {off:e}");
    // Sums in f32 would not do.
    assert!((f64::from(single) / exact - 1.0).abs() > WITHIN);
}
