//! The slow, obvious twins of the traversal: recursion and plain loops, for tests.

use crate::Bvh;
use crate::filter::{Filter, NoFilter, counts};
use crate::instance::{clamped, search_limit};
use crate::node::Child;
use crate::ray::{Hit, NO_INSTANCE, Ray};
use crate::simd::{F8, Portable};
use crate::traverse::SlabTest;
use crate::triangle::{NO_PRIMITIVE, RayFrame, confirm, details};
use hotspot_probe::NoProbe;

/// Tests every triangle: no tree at all. `triangles` as given to the build.
pub fn brute_force(triangles: &[[[f32; 3]; 3]], ray: &Ray) -> Option<Hit> {
    brute_force_filtered(triangles, ray, NoFilter)
}

/// The same, asking `filter` about every hit.
pub fn brute_force_filtered<F: Filter>(triangles: &[[[f32; 3]; 3]], ray: &Ray, mut filter: F) -> Option<Hit> {
    let frame = RayFrame::new(ray);
    let (t, primitive) = loop_over(triangles, &frame, NO_INSTANCE, &mut filter)?;
    let (u, v, normal) = details(&frame, &triangles[primitive as usize]);
    Some(Hit { t, u, v, primitive, instance: NO_INSTANCE, normal })
}

/// Distance and index of the nearest triangle that `filter` accepts.
fn loop_over<F: Filter>(
    triangles: &[[[f32; 3]; 3]],
    frame: &RayFrame,
    instance: u32,
    filter: &mut F,
) -> Option<(f32, u32)> {
    let mut best: Option<(f32, u32)> = None;
    if !frame.ray.is_finite() {
        return None;
    }
    for (index, triangle) in triangles.iter().enumerate() {
        let primitive = index as u32;
        if let Some(t) = confirm(frame, triangle, frame.ray.t_max)
            && t < best.map_or(frame.ray.t_max, |b| b.0)
            && counts(filter, instance, primitive, frame, triangle, &mut NoProbe)
        {
            best = Some((t, primitive));
        }
    }
    best
}

/// Tests every triangle of the world and of every instance of `bvh`, which was built from `triangles` and `meshes`.
pub fn brute_force_instanced<F: Filter>(
    bvh: &Bvh,
    triangles: &[[[f32; 3]; 3]],
    meshes: &[Vec<[[f32; 3]; 3]>],
    mesh_of: &[u32],
    ray: &Ray,
    mut filter: F,
) -> Option<Hit> {
    let mut best = brute_force_filtered(triangles, ray, &mut filter);
    let frame = RayFrame::new(ray);
    if !ray.is_finite() {
        return None;
    }
    for (index, placed) in bvh.instances.iter().enumerate() {
        let Some(interval) = placed.interval(&frame, ray.t_max) else { continue };
        let inside = RayFrame::new(&placed.object_ray(ray, interval, f32::INFINITY));
        let mesh = &meshes[mesh_of[index] as usize];
        let Some((t, primitive)) = loop_over(mesh, &inside, index as u32, &mut filter) else { continue };
        let t = clamped(t, interval);
        if t < best.map_or(ray.t_max, |b| b.t) {
            let triangle = &mesh[primitive as usize];
            let (u, v, normal) = details(&inside, triangle);
            let normal = placed.world_normal(normal);
            best = Some(Hit { t, u, v, primitive, instance: index as u32, normal });
        }
    }
    best
}

/// What a query did, counted by the oracle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Inner nodes visited.
    pub nodes: u64,
    /// Child boxes tested.
    pub boxes: u64,
    /// Leaf blocks tested.
    pub leaves: u64,
    /// Triangles tested.
    pub shapes: u64,
    /// Instances entered.
    pub instances: u64,
}

/// A hit as the oracle orders them: by distance, then world before instances, then by index.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Found {
    t: f32,
    /// 0 for the world, else 1 + the instance.
    instance: u64,
    primitive: u32,
}

/// Nearest hit (primitive and t) by recursion over the tree, scalar, sorting with the standard library; counts by the
/// definitions.
pub fn closest(bvh: &Bvh, ray: &Ray) -> (Option<(u32, f32)>, Counts) {
    let (hit, counts) = closest_filtered(bvh, ray, NoFilter);
    (hit.map(|(_, primitive, t)| (primitive, t)), counts)
}

/// The same with a filter: instance, primitive and t.
pub fn closest_filtered<F: Filter>(bvh: &Bvh, ray: &Ray, filter: F) -> (Option<(u32, u32, f32)>, Counts) {
    let mut state = Search { bvh, counts: Counts::default(), filter };
    let mut best = None;
    if bvh.root != Child::EMPTY && ray.is_finite() {
        // The root has no box: it is visited even if the interval is empty.
        let space = Space { frame: &RayFrame::new(ray), instance: NO_INSTANCE };
        let end = End { t: ray.t_max, counts: false };
        state.nearest(space, bvh.root, f32::NEG_INFINITY, end, &mut best);
    }
    let instance = |found: Found| found.instance.checked_sub(1).map_or(NO_INSTANCE, |i| i as u32);
    (best.map(|found| (instance(found), found.primitive, found.t)), state.counts)
}

/// Any hit by recursion; counts by the definitions.
pub fn occluded(bvh: &Bvh, ray: &Ray) -> (bool, Counts) {
    occluded_filtered(bvh, ray, NoFilter)
}

/// The same with a filter.
pub fn occluded_filtered<F: Filter>(bvh: &Bvh, ray: &Ray, filter: F) -> (bool, Counts) {
    let mut state = Search { bvh, counts: Counts::default(), filter };
    let space = Space { frame: &RayFrame::new(ray), instance: NO_INSTANCE };
    let hit = bvh.root != Child::EMPTY && ray.is_finite() && state.any(space, bvh.root);
    (hit, state.counts)
}

/// The ray in the space of the world or of an instance.
#[derive(Clone, Copy)]
struct Space<'a> {
    frame: &'a RayFrame,
    instance: u32,
}

/// Where the search ends.
#[derive(Clone, Copy)]
struct End {
    t: f32,
    /// Whether a hit at `t` itself counts, since it may win a tie with one elsewhere.
    counts: bool,
}

struct Search<'b, F> {
    bvh: &'b Bvh,
    counts: Counts,
    filter: F,
}

impl<F: Filter> Search<'_, F> {
    /// Entry distance of the children entered by `t_max`, in slot order.
    fn entered(&mut self, space: Space<'_>, child: Child, t_max: f32) -> Vec<(f32, Child)> {
        let node = &self.bvh.nodes[child.index()];
        self.counts.nodes += 1;
        let slabs = SlabTest::new(Portable, space.frame);
        let (near, bits) = slabs.enter(Portable, node, t_max);
        let F8(near) = near;
        let mut entered = Vec::new();
        for (slot, &child) in node.children.iter().enumerate() {
            if child != Child::EMPTY {
                self.counts.boxes += 1;
                if bits >> slot & 1 == 1 {
                    entered.push((near[slot], child));
                }
            }
        }
        entered
    }

    fn leaf(&mut self, child: Child) -> Vec<(u32, [[f32; 3]; 3])> {
        let block = &self.bvh.blocks[child.index()];
        self.counts.leaves += 1;
        let used: Vec<_> = (0..8)
            .filter(|&lane| block.primitives[lane] != NO_PRIMITIVE)
            .map(|lane| (block.primitives[lane], block.triangle(lane)))
            .collect();
        self.counts.shapes += used.len() as u64;
        used
    }

    fn accepts(&mut self, space: Space<'_>, primitive: u32, triangle: &[[f32; 3]; 3]) -> bool {
        counts(&mut self.filter, space.instance, primitive, space.frame, triangle, &mut NoProbe)
    }

    fn nearest(&mut self, space: Space<'_>, child: Child, near: f32, end: End, best: &mut Option<Found>) {
        let t_max = best.map_or(end.t, |b| b.t);
        if near > t_max {
            return;
        }
        if child.is_leaf() && child.is_instance() {
            self.nearest_of_instance(space, child, end.t, best);
        } else if child.is_leaf() {
            for (primitive, triangle) in self.leaf(child) {
                if let Some(t) = confirm(space.frame, &triangle, end.t)
                    && (t < end.t || end.counts)
                {
                    let instance = u64::from(space.instance.wrapping_add(1));
                    let found = Found { t, instance, primitive };
                    if best.is_none_or(|best| found < best) && self.accepts(space, primitive, &triangle) {
                        *best = Some(found);
                    }
                }
            }
        } else {
            let mut entered = self.entered(space, child, t_max);
            entered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.0.cmp(&b.1.0)));
            for (near, child) in entered {
                self.nearest(space, child, near, end, best);
            }
        }
    }

    fn nearest_of_instance(&mut self, space: Space<'_>, child: Child, end: f32, best: &mut Option<Found>) {
        let placed = &self.bvh.instances[child.index()];
        let t_max = best.map_or(end, |b| b.t);
        let Some(interval) = placed.interval(space.frame, t_max) else { return };
        self.counts.instances += 1;
        let limit = search_limit(t_max, interval);
        let ray = placed.object_ray(&space.frame.ray, interval, limit);
        if !ray.is_finite() {
            return;
        }
        let inside = Space { frame: &RayFrame::new(&ray), instance: child.index() as u32 };
        let mut found = None;
        let inner_end = End { t: limit, counts: best.is_some() && limit == t_max };
        self.nearest(inside, placed.root, f32::NEG_INFINITY, inner_end, &mut found);
        if let Some(mut found) = found {
            found.t = clamped(found.t, interval);
            if found.t < end && best.is_none_or(|best| found < best) {
                *best = Some(found);
            }
        }
    }

    fn any(&mut self, space: Space<'_>, child: Child) -> bool {
        let t_max = space.frame.ray.t_max;
        if child.is_leaf() && child.is_instance() {
            let placed = &self.bvh.instances[child.index()];
            let Some(interval) = placed.interval(space.frame, t_max) else { return false };
            if interval.0 >= t_max {
                return false;
            }
            self.counts.instances += 1;
            let limit = if interval.1 < t_max { f32::INFINITY } else { t_max };
            let ray = placed.object_ray(&space.frame.ray, interval, limit);
            let inside = Space { frame: &RayFrame::new(&ray), instance: child.index() as u32 };
            return ray.is_finite() && self.any(inside, placed.root);
        }
        if child.is_leaf() {
            let triangles = self.leaf(child);
            return triangles.iter().any(|(primitive, triangle)| {
                confirm(space.frame, triangle, t_max).is_some_and(|t| t < t_max)
                    && self.accepts(space, *primitive, triangle)
            });
        }
        let entered = self.entered(space, child, t_max);
        entered.into_iter().any(|(_, child)| self.any(space, child))
    }
}
