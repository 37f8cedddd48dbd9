//! Physics of the CPU engine, the reference for the GPU: conservation, closed forms, contact.

mod conforming;
mod conservation;
mod contact;
mod damping;
mod elastic;
mod faces;
mod implicit;
mod meeting;
mod one_step;
mod prescribed;
mod pressed;
mod problems;
mod reactions;
mod sheets;
mod sides;
mod streams;
mod turning;
mod verify;
mod volume;
