//! The GPU engines do what the CPU engines do: stage by stage on random states, and over whole frames.

#[path = "../common/mod.rs"]
mod common;

mod bookkeeping;
mod claims;
mod contact;
mod explicit;
mod frames;
mod implicit;
mod implicit_contact;
mod implicit_contact_frames;
mod implicit_flow;
mod implicit_frames;
mod implicit_order;
mod isolated;
mod layout;
mod meeting;
mod memory;
mod resumed;
mod shapes;
mod sides;
mod views;
