//! The ledgers as tables of the page.

use hotspot_cost::report::{LedgerRow, LedgerTable};
use hotspot_cost::{CostModel, Ledgers};
use std::collections::BTreeMap;

/// Cost by one thing, and the part of it that was shadow rays.
#[derive(Clone, Copy, Default)]
struct Sum {
    cost: f64,
    shadow: f64,
    blocked: f64,
}

/// By the object that sent the rays, by its material, by the object that was met, and by both objects.
pub(crate) fn ledger_tables(ledgers: &Ledgers, model: CostModel) -> Vec<LedgerTable> {
    let (mut objects, mut materials) = (BTreeMap::<_, Sum>::new(), BTreeMap::<_, Sum>::new());
    for row in &ledgers.spawner {
        let cost = row.traversal.cost(model);
        let shadow = if row.kind == hotspot_cost::ledger::SpawnerKind::Shadow { cost } else { 0.0 };
        for sum in [objects.entry(row.object).or_default(), materials.entry(row.material).or_default()] {
            sum.cost += cost;
            sum.shadow += shadow;
            sum.blocked += row.blocked as f64;
        }
    }
    let payers: Vec<_> = ledgers
        .payer
        .iter()
        .map(|row| (row.object, Sum { cost: row.traversal.cost(model), ..Sum::default() }))
        .collect();
    let total: f64 = payers.iter().map(|(_, sum)| sum.cost).sum();
    let pairs: BTreeMap<_, _> = ledgers
        .matrix
        .iter()
        .filter(|row| !row.others)
        .map(|row| {
            let name = format!(
                "{} → {}",
                ledgers.object_name(row.spawner, "camera"),
                ledgers.object_name(row.payer, "scene")
            );
            (name, Sum { cost: row.traversal.cost(model), ..Sum::default() })
        })
        .collect();
    let object = |id: Option<u32>, none: &str| (ledgers.object_name(id, none).to_owned(), id);
    let material = |id: Option<u32>| match id {
        Some(_) => (ledgers.material_name(id).to_owned(), id),
        None => ("camera".to_owned(), None),
    };
    vec![
        table(
            "Who sent the rays",
            "Shares of the frame's intersection cost, by the object that rays leave. A share is no saving: what is removed \
             sends its rays elsewhere.",
            false,
            total,
            objects.into_iter().map(|(id, sum)| (object(id, "camera"), sum)),
        ),
        table(
            "Their materials",
            "The same, by the material that rays leave.",
            true,
            total,
            materials.into_iter().map(|(id, sum)| (material(id), sum)),
        ),
        table(
            "Who was met",
            "The same cost, by whose triangles lie below the nodes and leaves that rays visit; \"scene\": nodes above several \
             objects.",
            false,
            total,
            payers.into_iter().map(|(id, sum)| (object(id, "scene"), sum)),
        ),
        table(
            "At whose expense",
            "Both at once: rays of the one in the tree of the other.",
            false,
            total,
            pairs.into_iter().map(|(name, sum)| ((name, None), sum)),
        ),
    ]
}

fn table(
    title: &str,
    note: &str,
    materials: bool,
    total: f64,
    sums: impl Iterator<Item = ((String, Option<u32>), Sum)>,
) -> LedgerTable {
    let mut rows: Vec<LedgerRow> = sums
        .map(|((name, id), sum)| LedgerRow {
            name,
            id,
            share: if total > 0.0 { sum.cost / total } else { 0.0 },
            detail: detail(&sum),
        })
        .collect();
    rows.sort_by(|a, b| b.share.total_cmp(&a.share).then_with(|| a.name.cmp(&b.name)));
    LedgerTable { title: title.to_owned(), note: note.to_owned(), materials, rows }
}

/// What shadow rays take of it, where that is much.
fn detail(sum: &Sum) -> String {
    let share = |part: f64| if sum.cost > 0.0 { (100.0 * part / sum.cost).round() } else { 0.0 };
    match (share(sum.shadow), share(sum.blocked)) {
        (shadow, _) if shadow < 10.0 => String::new(),
        (shadow, blocked) if blocked < 5.0 => format!("{shadow} % of it for shadow rays"),
        (shadow, blocked) => format!("{shadow} % of it for shadow rays, {blocked} % for blocked ones"),
    }
}
