//! The physics of the CPU engine, which the GPU is compared with: conservation, closed forms, contact.

mod conservation;
mod contact;
mod elastic;
mod implicit;
mod one_step;
mod prescribed;
mod problems;
mod reactions;
mod streams;
mod verify;
