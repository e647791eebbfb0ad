//! Tests of the comparison's page.

use super::super::codec::tests::unpack;
use super::super::sample::{Sample, comparison};
use super::*;

#[test]
fn differences_travel_with_their_sign() {
    let (a, b) = (Sample::new(64, 36, 1.0, 1), Sample::new(64, 36, 0.5, 1));
    let flags = vec![true; 64 * 36];
    let input = comparison(&a, &b, &flags);
    let data = data(&input, 64, 36, 0);
    let back = unpack(&data["maps"][0]["plane"]);
    for (i, value) in back.iter().enumerate() {
        let want = b.planes[0][i] - a.planes[0][i];
        assert!((value - want).abs() <= want.abs() * 0.01 + 0.01, "{value} {want}");
    }
    let scale = &data["maps"][0]["scale"];
    assert_eq!(scale["lo"].as_f64().unwrap(), -scale["hi"].as_f64().unwrap());
    assert_eq!(scale["map"], "red-blue");
}

#[test]
fn a_full_comparison_stays_below_five_megabytes() {
    let (a, b) = (Sample::new(640, 360, 1.0, 1), Sample::new(640, 360, 0.8, 2));
    let flags = vec![true; 640 * 360];
    let page = compare_html(&comparison(&a, &b, &flags));
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    assert!(!page.contains("{{") && page.contains("no: within noise"));
}

#[test]
fn layers_that_do_not_fit_are_left_out() {
    let (a, b) = (Sample::new(16, 9, 1.0, 1), Sample::new(15, 9, 0.8, 2));
    let page = compare_html(&comparison(&a, &b, &[]));
    assert!(page.contains("\"maps\":[]"));
    let empty = Sample::new(0, 0, 1.0, 1);
    assert!(compare_html(&comparison(&empty, &empty, &[])).ends_with("</html>\n"));
}
