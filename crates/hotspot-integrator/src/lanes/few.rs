//! Rays in lanes among few triangles: all of these are tried at once, and what rays would have visited in the tree is told to those who count it.

use super::counts::{BookedRays, Listener, Senders, TalliedRays};
use super::tree::{self, Query};
use crate::class::MatteClass;
use crate::scene::RenderScene;
use hotspot_bvh::few::{Blocked, FewTriangles, FewVisits, Tried};
use hotspot_bvh::rays::{Hits, Rays};
use hotspot_bvh::simd::{Floats, Integers, Mask, Simd};

/// The triangles of a scene that has few.
#[derive(Clone, Debug)]
pub(crate) struct Few {
    triangles: FewTriangles,
    /// Where visits can be told without a search.
    visits: Option<FewVisits>,
}

impl Few {
    /// `reach`: see [`FewTriangles::new`].
    pub(super) fn new(scene: &RenderScene, reach: f32) -> Option<Self> {
        let triangles = FewTriangles::new(&scene.geometry.triangles, reach)?;
        Some(Self { triangles, visits: FewVisits::new(&scene.bvh) })
    }

    /// See [`FewTriangles::has_along`].
    pub(super) fn has_along(&self, direction: [f32; 3]) -> bool {
        self.triangles.has_along(direction)
    }

    /// Whether it serves where visits are counted.
    pub(crate) fn counts(&self) -> bool {
        self.visits.is_some()
    }
}

/// What the rays hit; where somebody is to be `told`, with what they visit.
#[inline(always)]
pub(super) fn hits<S: Simd>(
    s: S,
    few: &Few,
    query: &Query<'_, S>,
    mut told: Option<(&mut Listener<'_>, Senders<'_>)>,
) -> Hits<S> {
    let Tried { hits, doubtful } = few.triangles.closest_hits(s, query.rays, query.from, query.active);
    let mut again = doubtful;
    if let (Some((listener, senders)), Some(visits)) = (&mut told, &few.visits) {
        let sure = query.active & !doubtful;
        again |= tell_of_nearest(s, visits, query.rays, (hits.t, hits.found), sure, (listener, senders));
    }
    if again == 0 { hits } else { searched(s, query, hits, again, told) }
}

/// Which rays are blocked before they reach the triangles `to`, which they do at their directions' length.
#[inline(always)]
pub(super) fn blocked<S: Simd>(
    s: S,
    few: &Few,
    query: &Query<'_, S>,
    to: Integers<S>,
    mut told: Option<(&mut Listener<'_>, Senders<'_>)>,
) -> u32 {
    let ends = [query.from, to];
    let blocked = if let (Some((listener, senders)), Some(visits)) = (&mut told, &few.visits) {
        tell_of_shadow(s, few, visits, (query, ends), (listener, senders))
    } else {
        few.triangles.blocked(s, query.rays, ends, query.active)
    };
    let again = blocked.doubtful;
    if again == 0 {
        return blocked.surely;
    }
    let (query, t_max) = (Query { active: again, ..*query }, Floats::splat(s, 1.0));
    let found = match told {
        None => query.blocked::<MatteClass>(s, to, t_max),
        Some((listener, senders)) => query.blocked_counted::<MatteClass>(s, (to, t_max), listener, &senders),
    };
    blocked.surely | found
}

/// Hits with those of rays `again`, from the tree.
#[inline(never)]
fn searched<S: Simd>(
    s: S,
    query: &Query<'_, S>,
    hits: Hits<S>,
    again: u32,
    told: Option<(&mut Listener<'_>, Senders<'_>)>,
) -> Hits<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let query = Query { active: again, ..*query };
            let nearest = match told {
                None => query.nearest::<MatteClass>(s),
                Some((listener, senders)) => query.nearest_counted::<MatteClass>(s, listener, &senders),
            };
            let found = tree::hits(s, query.scene, query.rays, nearest);
            let sure = Mask::of_bits(s, !again);
            let [a, b, c] = hits.corners;
            let [d, e, f] = found.corners;
            Hits {
                found: hits.found | found.found,
                primitive: hits.primitive.or_where_not(sure, found.primitive),
                corners: [a.or_where_not(sure, d), b.or_where_not(sure, e), c.or_where_not(sure, f)],
                t: sure.select(hits.t, found.t),
                u: sure.select(hits.u, found.u),
                v: sure.select(hits.v, found.v),
                normal: hits.normal.or_where_not(sure, found.normal),
            }
        },
    )
}

/// Tells what the rays of `lanes` visit, whose nearest hits are known; those of which it cannot be said.
#[inline(never)]
fn tell_of_nearest<S: Simd>(
    s: S,
    visits: &FewVisits,
    rays: &Rays<S>,
    hits: (Floats<S>, u32),
    lanes: u32,
    (listener, senders): (&mut Listener<'_>, &Senders<'_>),
) -> u32 {
    s.vectorize(
        #[inline(always)]
        || match listener {
            Listener::Tallies(tallies) => {
                visits.of_nearest(s, rays, hits, lanes, &mut TalliedRays { tallies, senders })
            }
            Listener::Books(books, booking) => {
                visits.of_nearest(s, rays, hits, lanes, &mut BookedRays { books, booking, senders })
            }
        },
    )
}

/// Which shadow rays are blocked; and tells what they visit of those of which that is sure.
#[inline(never)]
fn tell_of_shadow<S: Simd>(
    s: S,
    few: &Few,
    visits: &FewVisits,
    (query, ends): (&Query<'_, S>, [Integers<S>; 2]),
    (listener, senders): (&mut Listener<'_>, &Senders<'_>),
) -> Blocked {
    s.vectorize(
        #[inline(always)]
        || {
            let Query { rays, active, .. } = *query;
            let (blocked, hit) = few.triangles.blocked_where(s, rays, ends, active, visits.leaf_of());
            let lanes = active & !blocked.doubtful;
            let end = (Floats::splat(s, 1.0), hit);
            match listener {
                Listener::Tallies(tallies) => {
                    visits.of_shadow(s, rays, end, lanes, &mut TalliedRays { tallies, senders });
                }
                Listener::Books(books, booking) => {
                    visits.of_shadow(s, rays, end, lanes, &mut BookedRays { books, booking, senders });
                }
            }
            blocked
        },
    )
}
