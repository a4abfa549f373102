//! Stock, the swept cutter, and the engines that cut. Sees stock, cutter and moves only: neither
//! strategies nor the design part.

mod grid;
mod reference;
mod swept;
mod zmap;

pub use grid::{Grid, GridError};
pub use reference::cut_reference;
pub use swept::SweptMove;
pub use zmap::{NOT_CUT, ZMap};
