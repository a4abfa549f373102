//! Ends of passes that the link between them makes needless.
//!
//! A pass runs on over the border until what its own strip leaves there is cut. Where the link to the next pass runs along the border it
//! cuts some of that as well. So both ends are drawn back, together or one by one, as far as nothing stands higher afterwards than the
//! scallop height asks for, or than before.
//!
//! What is left at a place is the lowest of all moves over it: at a place of a move the cutter's profile, which is convex
//! along it. Places are looked at around both ends: along and beside the passes' contacts, and on the border.
//!
//! Enters: passes in their order, mm. Leaves: how many mm each end is drawn back, and the links.

use super::bend::Bends;
use geometry::{CurveSegment, Point2, Point3, SegmentGrid, Vector2};
use part::Part;
use work::monitor::{Cancelled, Monitor};

/// Ends are drawn back by these shares of an interval, the greatest first.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.125];

/// Places along a pass and beside it lie this share of an interval apart,
const APART: f64 = 0.25;

/// and reach so many intervals back from its end, and beyond it,
const BACK: f64 = 1.5;
const BEYOND: f64 = 0.5;

/// and so many to either side, where the strips of its neighbours begin.
const BESIDE: f64 = 0.5;

/// Halvings of the way to the border.
const HALVINGS: usize = 12;

/// Steps of the search for the lowest place of a move over a place: the golden section leaves a thousandth of its length.
const STEPS: usize = 14;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// What stands this share of the target higher than before counts as before.
const ROUNDING: f64 = 1e-3;
