//! Walls of the domain in the grid update: contact of their nodes, axis by axis, and which nodes that may be.

use super::grid_update::Grid;
use super::tile::{BLOCK, Node};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::contact::{ContactKind, mirrored, respond, stick_mirrored, wall_side};
use gridfall_core::sim::setup::{Axis, Setup};

/// Who hears which wall changes a velocity from what to what.
pub type Hears<'a, T, const D: usize> = dyn FnMut(usize, &[T; D], &[T; D]) + 'a;

/// The walls of the domain, and the nodes that they meet.
pub struct Walls<'a, T, const D: usize> {
    pub setup: &'a Setup,
    pub grid: &'a Grid<T, D>,
    pub tiles: &'a [Node<T>],
    pub fall: [T; D],
}

impl<T: Real, const D: usize> Walls<'_, T, D> {
    /// Which places of a grid block hold nodes that walls may change, a bit each.
    pub fn met(&self, corner: &[i32; D]) -> u64 {
        let mut met = 0;
        for a in 0..D {
            let Axis::Walls(contacts) = &self.setup.axes[a] else { continue };
            let is_sticky = |side: usize| contacts[side].kind == ContactKind::Sticky;
            for place in 0..BLOCK {
                let (i, cells) = (BLOCK * corner[a] + place, self.setup.cells[a] as i32);
                if mirrored(i, cells).is_some_and(|(side, _)| is_sticky(side))
                    || wall_side(i, cells).is_some_and(|side| !is_sticky(side))
                {
                    // All places with this one on the axis.
                    met |= match D - 1 - a {
                        0 => 0x1111_1111_1111_1111 << place,
                        1 => 0x000f_000f_000f_000f << (4 * place),
                        _ => 0xffff << (16 * place),
                    };
                }
            }
        }
        met
    }

    /// The velocity `v` of a node before contact becomes that after contact with the walls of the
    /// first `axes` axes, one after the other. `take` hears of every change.
    pub fn respond(
        &self,
        axes: usize,
        (field, g): (u32, usize),
        node: [i32; D],
        mass: T,
        v: [T; D],
        take: &mut Hears<'_, T, D>,
    ) -> [T; D] {
        let Some(a) = axes.checked_sub(1) else { return v };
        let v = self.respond(a, (field, g), node, mass, v, take);
        let Axis::Walls(contacts) = &self.setup.axes[a] else { return v };
        let (i, cells) = (node[a], self.setup.cells[a] as i32);
        let is_sticky = |side: usize| contacts[side].kind == ContactKind::Sticky;
        let (side, after) = match (mirrored(i, cells), wall_side(i, cells)) {
            (Some((side, image)), _) if is_sticky(side) => {
                let mut there = node;
                there[a] = image;
                // The mirror image of a grid is the other one, a single grid's its own.
                let other = self.grid.tables.grids - 1 - g;
                let slot = self.grid.tables.slot(field, other, there);
                let Some((m, u)) = slot.and_then(|slot| self.grid.free(slot, self.tiles, &self.fall)) else { return v };
                let u = self.respond(a, (field, other), there, m, u, &mut |_, _, _| {});
                (side, stick_mirrored([&v, &u], [mass, m]))
            }
            (_, Some(side)) if !is_sticky(side) => {
                let mut normal = [T::ZERO; D];
                normal[a] = if side == 0 { T::ONE } else { -T::ONE };
                (side, respond(&contacts[side], &v, &normal, &[T::ZERO; D]))
            }
            _ => return v,
        };
        take(2 * a + side, &v, &after);
        after
    }
}
