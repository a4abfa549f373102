//! stub
pub mod nurbs_json;
