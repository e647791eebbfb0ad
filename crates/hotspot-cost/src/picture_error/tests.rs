use super::*;

const WIDTH: u32 = 40;
const HEIGHT: u32 = 30;

fn picture(value: impl Fn(u32, u32, u32) -> f32) -> Picture<'static> {
    let plane = |c| {
        Cow::Owned(
            (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))).map(|(x, y)| value(x, y, c)).collect(),
        )
    };
    Picture::new(WIDTH, HEIGHT, [plane(0), plane(1), plane(2)], "test").unwrap()
}

/// Multiples of 1/16 that look random; everything made of them below is exact in f32.
fn pattern(k: u32, x: u32, y: u32, c: u32) -> f32 {
    ((x * 7 + y * 13 + c * 5 + k * ((x * x + 3 * y) % 11)) % 32) as f32 / 16.0
}

fn half_a(x: u32, y: u32, c: u32) -> f32 {
    pattern(3, x, y, c)
}

fn half_b(x: u32, y: u32, c: u32) -> f32 {
    pattern(5, x, y, c) * 0.25 + half_a(x, y, c) * 0.75
}

fn mean_of_halves(x: u32, y: u32, c: u32) -> f32 {
    0.5 * (half_a(x, y, c) + half_b(x, y, c))
}

/// The picture, with one bright outlier.
fn spiky(x: u32, y: u32, c: u32) -> f32 {
    if (x, y) == (17, 11) {
        40.0 - 10.0 * c as f32
    } else {
        pattern(4, x, y, c) * 0.25 + mean_of_halves(x, y, c) * 0.75
    }
}

fn close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} is not {expected}");
}

/// The same arrays were written as EXR files from numpy and measured by another program (numpy in f64, functions of a script
/// that prints these figures for any pair of files): what it returned stands here.
#[test]
fn measures_agree_with_an_independent_implementation() {
    let halves = [picture(half_a), picture(half_b)];
    let reference = Reference::with_halves(picture(mean_of_halves), halves, "test").unwrap();
    let error = PictureError::of(&picture(spiky), &reference).unwrap();
    close(error.relmse, 0.632_336_141_500_356_9);
    close(error.relmse_trimmed, 0.028_936_052_625_174_773);
    close(error.relmse_unbiased.unwrap(), 0.596_518_232_698_909_7);
    close(error.rmse, 0.878_160_445_047_385_7);
    close(reference.noise_floor().unwrap(), 0.035_817_908_801_447_18);
    let ratios = [1.038_085_224_352_906_2, 1.020_242_036_685_979_7, 1.018_017_009_847_806_5];
    for (found, expected) in error.mean_ratio.into_iter().zip(ratios) {
        close(found.unwrap(), expected);
    }
    close(relmse(&picture(spiky), reference.mean()).unwrap(), error.relmse);
    let by_pixel = error_by_pixel(&picture(spiky), reference.mean()).unwrap();
    let worst = by_pixel.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    assert_eq!(worst, 11 * WIDTH as usize + 17);
}

#[test]
fn measures_by_hand() {
    let two =
        |values: [f32; 2]| Picture::new(2, 1, [0; 3].map(|_| Cow::Owned(values.to_vec())), "test").unwrap();
    let reference = Reference::new(two([0.0, 0.3]));
    let error = PictureError::of(&two([0.1, 0.5]), &reference).unwrap();
    // (0.01/0.01 + 0.04/(0.09 + 0.01))/2 and √((0.01 + 0.04)/2), up to f32.
    assert!((error.relmse - 0.7).abs() < 1e-6 && (error.rmse - 0.025_f64.sqrt()).abs() < 1e-7);
    assert!((error.mean_ratio[1].unwrap() - 2.0).abs() < 1e-6);
    assert_eq!((error.relmse_unbiased, reference.noise_floor()), (None, None));
    // Fewer than a thousand pixels: the trimmed mean drops one at least, but keeps one.
    assert!((error.relmse_trimmed - 0.4).abs() < 1e-6);
    assert_eq!(trimmed_mean(vec![5.0]), 5.0);
    let same = PictureError::of(&two([0.0, 0.3]), &reference).unwrap();
    assert_eq!((same.relmse, same.rmse, same.mean_ratio[0]), (0.0, 0.0, Some(1.0)));
    let black = PictureError::of(&two([0.1, 0.1]), &Reference::new(two([0.0, 0.0]))).unwrap();
    assert_eq!(black.mean_ratio, [None; 3]);
}

/// 200 references with noise of their own against one picture: the plain relMSE holds the reference's error on top, the
/// unbiased one does not. Four standard errors: a false alarm in 16,000 seeds, and the seed is fixed.
#[test]
fn halves_take_the_references_own_noise_out() {
    let mut random = crate::testing::Random::new(3);
    let truth = |x, y, c| 1.0 + pattern(3, x, y, c);
    let shown = picture(|x, y, c| truth(x, y, c) + 0.1 * (pattern(7, x, y, c) - 1.0));
    let exact = relmse(&shown, &picture(truth)).unwrap();
    let (mut plain, mut unbiased, mut squares) = (0.0, 0.0, 0.0);
    let count = 200.0;
    for _ in 0..200 {
        let mut noisy = || {
            let noise: Vec<f32> = (0..3 * WIDTH * HEIGHT).map(|_| 0.1 * random.normal() as f32).collect();
            picture(|x, y, c| truth(x, y, c) + noise[((c * HEIGHT + y) * WIDTH + x) as usize])
        };
        let halves = [noisy(), noisy()];
        let mean = picture(|x, y, c| {
            let i = (y * WIDTH + x) as usize;
            0.5 * (halves[0].planes()[c as usize][i] + halves[1].planes()[c as usize][i])
        });
        let reference = Reference::with_halves(mean, halves, "test").unwrap();
        let error = PictureError::of(&shown, &reference).unwrap();
        let value = error.relmse_unbiased.unwrap();
        plain += (error.relmse - reference.noise_floor().unwrap()) / count;
        unbiased += value / count;
        squares += value * value / count;
    }
    let deviation = ((squares - unbiased * unbiased) / count).sqrt();
    // The denominator's own noise moves both by less than 1 %.
    assert!((unbiased - exact).abs() < 4.0 * deviation + 0.01 * exact, "{unbiased} {exact} {deviation}");
    assert!((plain - exact).abs() < 0.05 * exact, "{plain} {exact}");
}

#[test]
fn what_cannot_be_compared_is_refused_with_its_place() {
    let fine: [Cow<'_, [f32]>; 3] = [0; 3].map(|_| Cow::Owned(vec![1.0; 6]));
    let mut bad = fine.clone();
    bad[1].to_mut()[4] = f32::NAN;
    bad[2].to_mut()[5] = f32::INFINITY;
    let error = Picture::new(3, 2, bad, "ref.exr").unwrap_err().to_string();
    assert!(error.starts_with("ref.exr: 2 of its pixels") && error.contains("(1, 1)"), "{error}");
    assert!(Picture::new(3, 3, fine.clone(), "x").is_err() && Picture::new(0, 0, fine.clone(), "x").is_err());
    let (wide, tall) =
        (Picture::new(3, 2, fine.clone(), "x").unwrap(), Picture::new(2, 3, fine, "x").unwrap());
    let error = PictureError::of(&wide, &Reference::new(tall.clone())).unwrap_err().to_string();
    assert!(error.contains("2 x 3") && error.contains("3 x 2"), "{error}");
    assert!(Reference::with_halves(wide.clone(), [wide.clone(), tall], "x").is_err());
    let double = Picture::new(3, 2, [0; 3].map(|_| Cow::Owned(vec![2.0; 6])), "x").unwrap();
    let error = Reference::with_halves(wide.clone(), [wide, double], "x").unwrap_err().to_string();
    assert!(error.contains("not the mean of its halves but off by 50.0 %"), "{error}");
    let mut layers = Layers::new(2, 1);
    layers.insert("Y", vec![1.0; 2]);
    let error = Picture::of_layers(&layers, "grey.exr").unwrap_err().to_string();
    assert!(error.contains("grey.exr: it has no channel R, only Y"), "{error}");
}

#[cfg(feature = "exr")]
#[test]
fn references_are_read_with_their_halves() {
    use crate::exr_io::{Header, Limits, write};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.exr");
    let layers = |value: f32, half: Option<f32>| {
        let mut layers = Layers::new(3, 2);
        for (name, long) in RADIANCE {
            layers.insert(name, vec![value; 6]);
            if let Some(half) = half {
                layers.insert(format!("half.{long}"), vec![half; 6]);
            }
        }
        layers
    };
    let read = || Reference::read(&path, &Limits::default());
    write(&path, &layers(1.0, None), &Header::default()).unwrap();
    assert!(read().unwrap().halves().is_none());
    for (half, value) in [("a", 1.25), ("b", 0.75)] {
        write(&folder.path().join(format!("r_{half}.exr")), &layers(value, None), &Header::default())
            .unwrap();
    }
    let beside = read().unwrap();
    assert!((beside.noise_floor().unwrap() - 0.0625 / 1.01).abs() < 1e-9);
    // Channels of its own go first.
    write(&path, &layers(1.0, Some(0.5)), &Header::default()).unwrap();
    let own = read().unwrap();
    assert!((own.noise_floor().unwrap() - 0.25 / 1.01).abs() < 1e-9);
    assert_eq!(own.halves().unwrap()[1].planes()[2][0], 0.5);
    std::fs::remove_file(&path).unwrap();
    assert!(read().unwrap_err().to_string().contains("r.exr"));
}

/// Values that tell a wrong exposure, order or scale from a right one.
#[cfg(feature = "flip")]
#[test]
fn flip_is_zero_for_the_same_and_grows_with_the_difference() {
    let reference = picture(half_a);
    assert_eq!(flip(&reference, &reference), Some(0.0));
    let off = |by: f32| flip(&picture(|x, y, c| half_a(x, y, c) * (1.0 + by)), &reference).unwrap();
    let (small, large) = (off(0.05), off(0.5));
    assert!(small > 0.0 && small < large && large < 1.0, "{small} {large}");
    // Exposure follows the reference, so that a common factor of both changes nothing but rounding.
    let bright = picture(|x, y, c| 8.0 * half_a(x, y, c));
    let both = flip(&picture(|x, y, c| 12.0 * half_a(x, y, c)), &bright).unwrap();
    assert!((both - large).abs() < 0.01, "{both} {large}");
    assert!(flip(&picture(spiky), &picture(mean_of_halves)).is_some());
}

#[cfg(not(feature = "flip"))]
#[test]
fn without_the_feature_there_is_no_flip() {
    assert_eq!(flip(&picture(half_a), &picture(half_a)), None);
}
