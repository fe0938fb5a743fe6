//! What allocates and what does not: an allocator that counts is linked into this program alone.

#[path = "../allocation.rs"]
mod allocation;
#[path = "../effects_methods.rs"]
mod effects_methods;
#[path = "../node_allocation.rs"]
mod node_allocation;
#[path = "../own_effects.rs"]
mod own_effects;
