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
//! * `placed`: meshes placed in the world, and the check that the next two rooms share
//! * `instances`: agreement, ties and ends of rays with meshes placed many times
//! * `instance_building`: what cannot be placed; words, memory and bounds
//! * `instance_geometry`: instances against copies, leaks of placed meshes, seams
//! * `filters`: which hits count, and which of them the filter is asked about
//!
//! All randomness is seeded; nothing here has a false-alarm rate.

mod agreement;
mod counts;
mod determinism;
mod distance;
mod excepted;
mod filters;
mod hostile;
mod instance_building;
mod instance_geometry;
mod instances;
mod intervals;
mod meshes;
mod placed;
mod support;
mod ties;
mod watertight;
