//! The page: figures as in the paper, claims beside figures.

use crate::figures::{Figure, Verdict};
use crate::stage::Scale;
use base64::{Engine, engine::general_purpose::STANDARD};
use hotspot_cost::maps::encode_png;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:0 auto;max-width:1200px;padding:20px;background:#15171a;color:#eceef1}\
h1{font-size:26px}h2{margin:40px 0 2px;font-size:20px}p{margin:4px 0}.dim{color:#a8b0ba;font-size:13px}\
.panels{display:grid;gap:12px;grid-template-columns:repeat(auto-fit,minmax(260px,1fr));margin:12px 0}\
figure{margin:0}img{width:100%;display:block;border-radius:3px}figcaption{font-size:13px;color:#a8b0ba;padding-top:3px}\
table{border-collapse:collapse;width:100%}td,th{text-align:left;vertical-align:top;padding:7px 12px 7px 0;border-top:1px solid #33383f}\
th{color:#a8b0ba;font-weight:400;font-size:13px;border:0}.agrees{color:#7fd69a}.differs{color:#ff8f7a}";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// One self-contained page.
pub(crate) fn html(figures: &[Figure], scale: Scale) -> String {
    let claims = || figures.iter().flat_map(|f| &f.claims);
    let agree = claims().filter(|c| c.verdict == Verdict::Agrees).count();
    let mut out = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\"><title>The paper, reproduced</title><style>{STYLE}</style></head>\
         <body><h1>{agree} of {} claims hold here</h1><p>The experiments of <i>Identifying and Visualizing Computational \
         Hotspots in Path Tracing</i> (Sundarrajan, van de Ruit, Eisemann 2022), rendered anew with the paper's samples \
         per pixel and depths. Verdicts follow from the numbers.</p>\
         <p class=\"dim\">What differs by design: the paper's engine (pbrt-v3) traces an extra ray for the BSDF-sampled half of \
         multiple importance sampling, this one reuses the continuation ray; its tree is binary with one visit per node, this \
         one is 8-wide with one visit per eight boxes; scenes other than the killeroo, the Cornell box and the living \
         room are this project's own.{}</p>",
        claims().count(),
        if scale == Scale::Quick { " <b>This is a quick run: too small to judge.</b>" } else { "" }
    );
    for figure in figures {
        let _ = write!(
            out,
            "<h2>{}</h2><p>{}</p><p class=\"dim\">{}</p><div class=\"panels\">",
            escape(figure.title),
            escape(&figure.scene),
            escape(&figure.settings)
        );
        for panel in &figure.panels {
            let png = encode_png(&panel.image).map(|png| STANDARD.encode(png)).unwrap_or_default();
            let _ = write!(
                out,
                "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{png}\"><figcaption>{0}</figcaption></figure>",
                escape(&panel.caption)
            );
        }
        out.push_str("</div><table><tr><th>the paper</th><th>here</th><th></th></tr>");
        for claim in &figure.claims {
            let word = claim.verdict.word();
            let why = if claim.why.is_empty() {
                String::new()
            } else {
                format!("<p class=\"dim\">{}</p>", escape(claim.why))
            };
            let _ = write!(
                out,
                "<tr><td>{}</td><td>{}{why}</td><td class=\"{word}\">{word}</td></tr>",
                escape(claim.paper),
                escape(&claim.ours)
            );
        }
        out.push_str("</table>");
    }
    out + "</body></html>\n"
}

/// The claims and figures as Markdown.
pub(crate) fn table(figures: &[Figure], scale: Scale) -> String {
    let cell = |text: &str| text.replace('|', "\\|");
    let mut out = String::new();
    if scale == Scale::Quick {
        out.push_str("A quick run: too small to judge.\n\n");
    }
    for figure in figures {
        let _ = write!(
            out,
            "## {}\n\n{}. {}.\n\n| the paper | here | |\n|---|---|---|\n",
            figure.title, figure.scene, figure.settings
        );
        for claim in &figure.claims {
            let _ =
                writeln!(out, "| {} | {} | {} |", cell(claim.paper), cell(&claim.ours), claim.verdict.word());
        }
        out.push('\n');
    }
    out
}
