//! stub
use super::ZMap;
use crate::cutter::Cutter;
use crate::monitor::{Cancelled, Monitor};
use crate::toolpath::Toolpath;
/// Cuts.
pub fn cut_reference(
    _stock: &ZMap,
    _cutter: &Cutter,
    _path: &Toolpath,
    _monitor: &dyn Monitor,
) -> Result<ZMap, Cancelled> {
    todo!()
}
