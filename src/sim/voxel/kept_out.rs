//! Proof that rapid moves of any tool axis stay out of what stands when they come.
//!
//! A place is in stock on a move if it lies inside of the stock and of the tool, and outside of all that
//! swept before. In a cube each of these depths has an upper bound that is linear in the cube, or convex and
//! so below its values at the corners. Where one is a touch at all corners, or the mean of two of them is, no
//! place is in stock: the mean tells surfaces that lie on one another, as those of a tool that leaves where
//! it has cut. Cubes that this does not show are divided, down to a share of a touch. Moves that cannot
//! matter in a cube are not handed on to its parts.

use super::engine::VoxelEngine;
use super::moves::{LOOSE, Tangent};
use crate::stock::corner;
use crate::{ENGAGED, InStock};
use geometry::{Point3, Vector3};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Cubes that are looked at, in all and for each rapid move; what is left then stays open.
const MOST_CUBES: usize = 200_000;
const CUBES_PER_RAPID: usize = 2_000;

/// The least cube's half side over a touch.
const LEAST: f64 = 0.1;

/// A cube with the parts of moves that may matter in it, in order.
struct Piece {
    centre: Point3,
    half: f64,
    parts: Vec<u32>,
    /// Those of rapid moves that may be in stock.
    asked: Vec<u32>,
}

/// What one cube shows.
enum Seen {
    Clear,
    /// A part of a rapid move is in stock at a place.
    Meets(u32, Point3),
    /// Open: the parts that may matter, and those of rapid moves that may be in stock.
    Divided(Vec<u32>, Vec<u32>),
}

/// A part of a rapid move, and a place.
type Found = (u32, Point3);

/// Upper bounds on a depth at the corners of a cube.
type Corners = [f64; 8];

/// Whether one of two depths is a touch all over a cube.
fn is_touch(a: &Corners, b: &Corners) -> bool {
    let most = |of: &dyn Fn(usize) -> f64| (0..8).map(of).fold(f64::NEG_INFINITY, f64::max) <= ENGAGED;
    most(&|k| a[k]) || most(&|k| b[k]) || most(&|k| 0.5 * (a[k] + b[k]))
}

impl VoxelEngine<'_> {
    /// The first rapid move that certainly is in stock when it comes, or else the first that is not shown to
    /// stay out; `None` where all do. The cutter may stray from the path by `strays`, mm.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    ///
    /// # Tolerance
    /// Less than [`ENGAGED`] of stock or of the tool is a touch.
    pub fn first_rapid_in_stock(
        &self,
        strays: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<InStock>, Cancelled> {
        let bounds = self.stock.bounds();
        let all = 0..self.parts.all.len() as u32;
        let asked: Vec<u32> = all.clone().filter(|&part| self.is_rapid(part)).collect();
        let mut left = MOST_CUBES + CUBES_PER_RAPID * asked.len();
        let mut level = vec![Piece {
            centre: bounds.min + 0.5 * bounds.size(),
            half: 0.5 * bounds.size().max(),
            parts: all.collect(),
            asked,
        }];
        let (mut met, mut open) = (None, None);
        let earlier = |a: Option<Found>, b: Found| Some(a.filter(|a| a.0 <= b.0).unwrap_or(b));
        while !level.is_empty() {
            check(monitor)?;
            let known = met.map_or(u32::MAX, |(part, _): Found| part);
            let seen = parallel::try_map(level.len(), |k| {
                check(monitor)?;
                Ok(self.rapids_in(&level[k], strays, known))
            })?;
            left = left.saturating_sub(level.len());
            let mut next = Vec::new();
            for (piece, seen) in level.iter().zip(seen) {
                match seen {
                    Seen::Clear => {}
                    Seen::Meets(part, at) => met = earlier(met, (part, at)),
                    Seen::Divided(_, asked) if left == 0 || piece.half < LEAST * ENGAGED => {
                        open = earlier(open, (asked[0], piece.centre));
                    }
                    Seen::Divided(parts, asked) => {
                        let half = 0.5 * piece.half;
                        next.extend((0..8).map(|k| {
                            let centre = piece.centre + corner(k) * half;
                            Piece { centre, half, parts: parts.clone(), asked: asked.clone() }
                        }));
                    }
                }
            }
            level = next;
        }
        let index = |part: u32| self.parts.all[part as usize].index;
        if let Some((part, at)) = met {
            let move_index = index(part);
            let tool =
                self.parts.of_move(move_index, &at, f64::INFINITY).map_or(0.0, |found| -found.distance);
            let depth = self.standing(&at, move_index).min(tool) - 2.0 * strays;
            return Ok(Some(InStock { move_index, at, depth: Some(depth) }));
        }
        Ok(open.map(|(part, at)| InStock { move_index: index(part), at, depth: None }))
    }

    fn is_rapid(&self, part: u32) -> bool {
        self.rapids[self.parts.all[part as usize].index as usize]
    }

    /// What of the rapid moves before the part `known` may be in stock in a cube.
    fn rapids_in(&self, piece: &Piece, strays: f64, known: u32) -> Seen {
        let Piece { centre, half, .. } = piece;
        let reach = half * 3f64.sqrt();
        let linear = |value: f64, gradient: &Vector3| -> Corners {
            std::array::from_fn(|k| value + half * gradient.dot(&corner(k)))
        };
        let foot = self.stock.foot(centre).0;
        let whole = linear(reach - foot, &Vector3::zeros());
        let sides = self.stock.sides(centre, *half).outer;
        let mut stands: Vec<Corners> = sides.iter().map(|s| linear(s.offset, &s.gradient)).collect();
        stands.push(whole);
        if stands.iter().any(|depth| is_touch(depth, depth)) {
            return Seen::Clear;
        }
        // How deep the tool may be, for the rapid moves of which that matters.
        let inside = |part: u32| -> Option<Corners> {
            let part = &self.parts.all[part as usize];
            let t = self.parts.tangent(part, centre, reach, reach + strays, LOOSE)?;
            let depth = linear(strays - t.lower, &-t.gradient);
            (!stands.iter().any(|stands| is_touch(stands, &depth))).then_some(depth)
        };
        let mut rapids: Vec<(u32, Corners)> = Vec::new();
        for &part in piece.asked.iter().take_while(|part| **part < known) {
            rapids.extend(inside(part).map(|depth| (part, depth)));
        }
        let Some(&(last, _)) = rapids.last() else { return Seen::Clear };
        let mut swept: Vec<(u32, Tangent)> = Vec::new();
        for &p in piece.parts.iter().take_while(|part| **part <= last) {
            let part = &self.parts.all[p as usize];
            let limit = reach + ENGAGED + strays;
            let Some(t) = self.parts.tangent(part, centre, reach, limit, LOOSE) else { continue };
            if t.lower - half * t.gradient.map(f64::abs).sum() >= ENGAGED + strays {
                continue;
            }
            swept.push((p, t));
            if t.distance + t.slack + reach + strays <= ENGAGED {
                // What comes later finds nothing.
                rapids.retain(|(part, _)| *part <= p);
                break;
            }
        }
        let mut corners: Vec<Option<Corners>> = vec![None; swept.len()];
        let is_widest_on_top = self.parts.is_widest_on_top();
        rapids.retain(|(part, depth)| {
            let before = swept.partition_point(|(p, _)| p < part);
            !(0..before).rev().any(|k| {
                let (p, t) = &swept[k];
                let [earlier, later] = [p, part].map(|&part| &self.parts.all[part as usize]);
                if is_widest_on_top && self.parts.has_been(earlier, later, ENGAGED, centre, reach) {
                    return true;
                }
                let left = corners[k].get_or_insert_with(|| {
                    let found = self.parts.corners(&self.parts.all[*p as usize], t, centre, *half, LOOSE);
                    found.map(|distance| distance + strays)
                });
                is_touch(left, depth)
            })
        });
        let Some(&(last, _)) = rapids.last() else { return Seen::Clear };
        if let Some(met) = rapids.iter().find_map(|(part, _)| self.meets(*part, &swept, piece, strays)) {
            return met;
        }
        let parts = swept.iter().map(|(p, _)| *p).take_while(|p| *p <= last).collect();
        Seen::Divided(parts, rapids.iter().map(|(part, _)| *part).collect())
    }

    /// Whether a part of a rapid move certainly is in stock at the middle of a cube, or halfway between its
    /// own surface and that of what stands there.
    fn meets(&self, part: u32, swept: &[(u32, Tangent)], piece: &Piece, strays: f64) -> Option<Seen> {
        let tool = |q: &Point3| self.parts.distance(&self.parts.all[part as usize], q, f64::INFINITY);
        let before = &swept[..swept.partition_point(|(p, _)| *p < part)];
        let stands = |q: &Point3| {
            before.iter().fold(-self.stock.foot(q).0, |now, (p, _)| {
                self.parts.distance(&self.parts.all[*p as usize], q, now).unwrap_or(now)
            })
        };
        let touch = ENGAGED + 2.0 * strays;
        let Piece { centre, half, .. } = piece;
        let (in_stock, from_tool) = (stands(centre), tool(centre)?);
        if in_stock.min(-from_tool) > touch {
            return Some(Seen::Meets(part, *centre));
        }
        let own = self.parts.tangent(&self.parts.all[part as usize], centre, *half, f64::INFINITY, LOOSE)?;
        let between = centre - own.gradient * (0.5 * (in_stock + from_tool));
        let within = (between - centre).amax() <= *half;
        (within && stands(&between).min(-tool(&between)?) > touch).then_some(Seen::Meets(part, between))
    }
}
