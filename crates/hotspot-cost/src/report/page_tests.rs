//! Tests of the render's page.

use super::super::sample::Sample;
use super::*;
use crate::Rect;
use crate::maps::{ColorMap, Scale};
use crate::report::{Fact, MapLayer, ObjectLayer, ValueKind};
use image::RgbImage;

/// The JSON that the page embeds.
fn embedded(page: &str) -> Value {
    let start = page.find("id=\"data\">").unwrap() + 10;
    let end = start + page[start..].find("</script>").unwrap();
    serde_json::from_str(&page[start..end]).unwrap()
}

#[test]
fn a_full_page_stays_below_five_megabytes() {
    let sample = Sample::new(640, 360, 1.0, 1);
    let page = html(&sample.report());
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    let data = embedded(&page);
    assert_eq!(data["maps"].as_array().unwrap().len(), 23);
    assert_eq!(data["maps"][1]["metric"], "intersection");
    let back = codec::tests::unpack(&data["maps"][1]["plane"]);
    let worst =
        sample.planes[1].iter().zip(&back).map(|(a, b)| (a - b).abs() / a.max(1.0)).fold(0.0, f32::max);
    assert!(worst < 0.005, "{worst}");
    assert!(page.contains("<h1>41\u{a0}% of the cost lies in 14\u{a0}% of the pixels"));
}

#[test]
fn the_page_asks_for_nothing_from_outside() {
    let page = html(&Sample::new(32, 18, 1.0, 1).report());
    for hint in ["http:", "https:", "//cdn", "@import", "url(", "fetch(", "XMLHttp"] {
        assert!(!page.contains(hint), "{hint}");
    }
    assert!(page.contains("default-src 'none'"));
    assert!(!page.contains("{{"), "all places of the template are filled");
}

#[test]
fn the_legend_says_what_the_view_altered() {
    let sample = Sample::new(640, 360, 1.0, 1);
    let data = embedded(&html(&sample.report()));
    let scale = &data["maps"][2]["scale"];
    assert!(scale["despikeAbove"].as_f64().unwrap() > 0.0);
    let notes = scale["notes"].to_string();
    assert!(notes.contains("despiked") && notes.contains("99.9th percentile"), "{notes}");
    assert!(data["maps"][1]["scale"]["despikeAbove"].is_null());
}

#[test]
fn ledgers_are_rows_that_can_be_shown() {
    let page = html(&Sample::new(32, 18, 1.0, 1).report());
    assert!(page.contains("data-kind=\"objects\" data-id=\"0\""));
    assert!(page.contains("Wall &lt;b&gt;") && page.contains("<span>camera</span>"));
    assert!(page.contains("--share:60.0%") && page.contains("40 % shadow rays"));
}

#[test]
fn hostile_names_stay_text() {
    let evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&{{data}}\u{202e}\0<!--";
    let sample = Sample::new(16, 9, 1.0, 1);
    let mut input = sample.report();
    for text in [&mut input.title, &mut input.verdict, &mut input.raw_json] {
        *text = evil.into();
    }
    input.hotspots[0].name = evil.into();
    input.hotspots[0].cause = evil.into();
    input.hotspots[0].fix = evil.into();
    input.hotspots[0].factors = vec![Fact::new(evil, evil)];
    input.facts = vec![Fact::new(evil, evil)];
    input.totals[0].label = evil.into();
    input.unmodelled = vec![evil.into(); 2000];
    input.maps[0].label = evil.into();
    input.maps[0].unit = evil.into();
    input.maps[0].metric = evil.into();
    input.objects = Some(ObjectLayer { ids: &sample.ids, names: vec![evil.into(); 5] });
    let page = html(&input);
    assert_eq!(page.matches("<script").count(), 2);
    assert_eq!(page.matches("</script>").count(), 2);
    assert!(!page.contains("<img src=x") && !page.contains("<!--") && !page.contains('\u{202e}'));
    assert_eq!(
        embedded(&page)["maps"][0]["label"].as_str().unwrap().chars().take(9).collect::<String>(),
        "</script>"
    );
}

#[test]
fn hostile_sizes_still_give_a_page() {
    let empty = RgbImage::new(0, 0);
    let one = RgbImage::new(3, 2);
    for beauty in [&empty, &one] {
        for values in [
            &[][..],
            &[f32::NAN; 6],
            &[f32::INFINITY; 6],
            &[1.0; 5],
            &[f32::MAX, f32::MIN, 0.0, 1.0, 2.0, 3.0],
        ] {
            let layer = MapLayer {
                metric: "m".into(),
                label: "M".into(),
                unit: String::new(),
                kind: ValueKind::Amount,
                values,
                scale: Scale::Fixed(f32::NAN, 0.0),
                map: ColorMap::Turbo,
                despike: true,
            };
            let mut input = Sample::new(1, 1, 1.0, 1).report().hotspots;
            input[0].bbox = Rect { x: u32::MAX, y: 0, width: u32::MAX, height: u32::MAX };
            input[0].cost_share = f64::NAN;
            let page = html(&ReportInput {
                title: String::new(),
                verdict: String::new(),
                beauty,
                maps: vec![layer],
                objects: Some(ObjectLayer { ids: &[1, 2], names: Vec::new() }),
                materials: Some(ObjectLayer { ids: &[1], names: Vec::new() }),
                hotspot_pixels: &[1, 2, 3],
                ledgers: Vec::new(),
                hotspots: input,
                facts: Vec::new(),
                totals: Vec::new(),
                unmodelled: Vec::new(),
                repairs: Vec::new(),
                raw_json: String::new(),
            });
            assert!(page.ends_with("</html>\n"));
            embedded(&page);
        }
    }
}

#[test]
fn precise_keeps_five_digits() {
    assert_eq!((precise(12.345_678_9), precise(0.0)), ("12.346".into(), "0".into()));
    assert_eq!((precise(f64::NAN), precise(123_456_789.0)), ("–".into(), "123456789".into()));
}

/// Writes sample pages and maps to look at: `cargo test -p hotspot-cost -- --ignored sample_pages`; the folder is
/// `hotspot-report-sample` among the temporary files.
#[test]
#[ignore = "writes files to look at"]
fn sample_pages() {
    let folder = std::env::temp_dir().join("hotspot-report-sample");
    std::fs::create_dir_all(&folder).unwrap();
    for (name, width, height) in [("wide", 640, 360), ("square", 512, 512), ("tiny", 64, 64)] {
        let a = Sample::new(width, height, 1.0, 1);
        let b = Sample::new(width, height, 0.8, 2);
        std::fs::write(folder.join(format!("{name}.html")), html(&a.report())).unwrap();
        let significant: Vec<bool> = a.ids.iter().map(|id| *id == 2).collect();
        let input = super::super::sample::comparison(&a, &b, &significant);
        std::fs::write(folder.join(format!("{name}.compare.html")), crate::report::compare_html(&input))
            .unwrap();
        let difference: Vec<f32> = a.planes[1].iter().zip(&b.planes[1]).map(|(a, b)| b - a).collect();
        let planes = [
            (&a.planes[1], ColorMap::Inferno),
            (&a.planes[2], ColorMap::Viridis),
            (&difference, ColorMap::RedBlue),
        ];
        for (k, (values, map)) in planes.into_iter().enumerate() {
            let options = crate::maps::HeatOptions {
                label: "Intersection cost".into(),
                unit: "nodes + triangles per path, µs".into(),
                map,
                scale: Scale::default(),
                despike: k == 1,
            };
            let heat = crate::maps::heat_map(width, height, values, &options);
            crate::maps::write_png(&folder.join(format!("{name}.{k}.png")), &heat.image).unwrap();
        }
    }
}

/// How long a page of 1920 × 1080 takes and how large it is: `cargo test -p hotspot-cost -- --ignored --nocapture full_hd`.
#[test]
#[ignore = "measures"]
#[expect(clippy::print_stderr, reason = "its result")]
fn full_hd() {
    let sample = Sample::new(1920, 1080, 1.0, 1);
    let input = sample.report();
    let start = std::time::Instant::now();
    let page = html(&input);
    let seconds = start.elapsed().as_secs_f64();
    std::fs::write(std::env::temp_dir().join("hotspot-full-hd.html"), &page).unwrap();
    assert!(page.len() < 12_000_000, "{} bytes in {seconds:.2} s", page.len());
    let data = embedded(&page);
    let grains: Vec<String> = data["maps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| format!("{}/{}", m["plane"]["steps"], m["plane"]["shrink"]))
        .collect();
    eprintln!("{} bytes in {seconds:.2} s; steps and shrinking {grains:?}", page.len());
}
