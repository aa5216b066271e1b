//! The models of the vehicle from outside.

mod linkages;
mod no_alloc;
mod roads;
mod three_bodies;
mod truth;

#[global_allocator]
static COUNTING: testkit::Counting = testkit::Counting;
