//! Robustness of the tree, tested by another hand than the one that wrote it: every query is held against a loop over
//! all triangles, every count against a recursive twin, every closed mesh against leaks.
//!
//! * `support`: seeded random numbers, rays, triangle soups, and the one check that all rooms share
//! * `meshes`: closed convex meshes
//! * `watertight`: rays at closed meshes, from far, from inside and from just under the surface
//! * `agreement`: tree and loop over hostile origins, directions, sizes and scales
//! * `intervals`: the open interval (`t_min`, `t_max`)
//! * `ties`: equal distances, degenerate and unusable triangles
//! * `counts`: what probes are told
//! * `determinism`: the same tree and hits whatever the instruction set and thread pool
//! * `distance`: t, barycentrics and normal against exact arithmetic
//! * `hostile`: geometry made to degrade the tree
//!
//! All randomness is seeded; nothing here has a false-alarm rate.

mod agreement;
mod counts;
mod determinism;
mod distance;
mod hostile;
mod intervals;
mod meshes;
mod support;
mod ties;
mod watertight;
