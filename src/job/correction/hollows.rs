//! Places where every path of the cutter leaves something, once one of them leaves more than the target.
//!
//! At the foot of a wall or in a groove a cutter that does not fit stands on the part elsewhere. What it leaves
//! there, and on the way to the passes beside it, depends on how far from there passes happen to lie more than on
//! how near to each other they are: it is no reason to narrow them.

mod lines;

use std::collections::HashMap;
use std::f64::consts::TAU;

use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::{Point2, Point3, Vector3};
use part::{Part, SurfacePoint};
use toolpath::{Step, plane_interval};
use work::monitor::{self, Cancelled, Monitor};

use super::SLACK;
use lines::lines_through;

/// Places that are looked up between two questions whether to go on.
const LOOKED_UP: usize = 256;

/// Of a cube with the edge of this share of an interval one place is looked at.
const APART: f64 = 0.25;

/// Directions in which is looked around a place.
const AROUND: u32 = 8;

/// Places where every path leaves something, as far as they were looked at.
pub(super) struct Hollows<'a> {
    part: &'a Part,
    cutter: Cutter,
    drop: DropCutter<'a>,
    /// What no ridge may exceed, mm.
    target: f64,
    /// From pass to pass on a plane, mm.
    interval: f64,
    /// Whether every path leaves something, by cubes with the edge [`APART`], each by one place in it.
    looked: HashMap<[i64; 3], bool>,
}

impl<'a> Hollows<'a> {
    /// Of a part under an upright cutter, none of which was looked for yet.
    pub fn of(
        part: &'a Part,
        cutter: &Cutter,
        target: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        let interval = plane_interval(cutter, Step::Scallop(target));
        let drop = DropCutter::watched(part, cutter, monitor)?;
        Ok(Self { part, cutter: *cutter, drop, target, interval, looked: HashMap::new() })
    }

    /// Takes from some places, with the heights that stand there, mm, those that nearer passes do not take lower.
    pub fn taken_from(
        &mut self,
        places: &mut Vec<(Point3, f64)>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Point3, f64)>, Cancelled> {
        let (mut kept, mut taken) = (Vec::new(), Vec::new());
        for (k, (at, height)) in places.drain(..).enumerate() {
            if k.is_multiple_of(LOOKED_UP) {
                monitor::check(monitor)?;
            }
            let is_taken = height > self.target && self.is_beside(&at);
            (if is_taken { &mut taken } else { &mut kept }).push((at, height));
        }
        *places = kept;
        Ok(taken)
    }

    /// Lines in the plan view along which the cutter stands on the part at more than one place, where a pass takes
    /// more than the target off what stands in the hollow: others leave no more than that above what every path
    /// leaves.
    pub fn creases(
        &mut self,
        places: &[(Point3, f64)],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<Point2>>, Cancelled> {
        let mut axes = Vec::new();
        for (k, (at, height)) in places.iter().enumerate() {
            if k.is_multiple_of(LOOKED_UP) {
                monitor::check(monitor)?;
            }
            let foot = self.part.closest_point(at).0;
            if self.is_hollow(&foot) {
                let first = foot.point.xy() + self.cutter.axis_offset(&foot.normal);
                let axis = self.drop.lowest_over(&self.cutter, &foot.point, first, 0.5 * self.interval);
                let left = self.drop.left_from(&self.cutter, &foot.point, axis);
                if left.is_some_and(|left| height - left * foot.normal.z > self.target) {
                    axes.push(axis);
                }
            }
        }
        Ok(lines_through(axes, APART * self.interval, self.interval))
    }

    /// Whether a place is within an interval of one where every path leaves something.
    fn is_beside(&mut self, at: &Point3) -> bool {
        let foot = self.part.closest_point(at).0;
        if self.is_hollow(&foot) {
            return true;
        }
        let across = foot.normal.cross(&Vector3::ith(foot.normal.iamin(), 1.0)).normalize();
        let along = foot.normal.cross(&across);
        [0.5, 1.0].into_iter().flat_map(|share| (0..AROUND).map(move |k| (share, k))).any(|(share, k)| {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(AROUND)).sin_cos();
            let beside = foot.point + (across * cos + along * sin) * share * self.interval;
            self.is_hollow(&self.part.closest_point(&beside).0)
        })
    }

    /// Whether every path leaves something at a place: a share of the target that plans do not make use of.
    fn is_hollow(&mut self, foot: &SurfacePoint) -> bool {
        let cube = foot.point.coords.map(|x| (x / (APART * self.interval)).floor() as i64).into();
        if let Some(&is_hollow) = self.looked.get(&cube) {
            return is_hollow;
        }
        let least = SLACK * self.target;
        let tip = foot.point + self.cutter.contact_to_tip(&foot.normal);
        // On a wall a lift leaves more along the normal than along z times the normal's z.
        let stands_off = |lowest: f64| lowest - tip.z > least * foot.normal.z;
        let is_hollow = self.drop.at(tip.x, tip.y).is_some_and(|drop| stands_off(drop.tip_z))
            && self.drop.left_by_search(&self.cutter, &foot.point, &foot.normal, least) * foot.normal.z
                > least;
        self.looked.insert(cube, is_hollow);
        is_hollow
    }
}
