//! The files of feed directions that strategies name.

use std::sync::Arc;

use super::ToolpathRequest;
use io::direction_table;
use keys::{SceneError, SceneText};

/// Reads the files of a toolpath's directions into its strategy.
pub(super) fn load(request: &mut ToolpathRequest, source: &SceneText) -> Result<(), SceneError> {
    let Some(direction) = request.strategy.direction_mut() else { return Ok(()) };
    for (samples, file) in direction.files_mut().into_iter().zip(&request.directions) {
        let table = direction_table::read(&file.path).map_err(|e| {
            let message = format!("the file of directions cannot be used: {e}");
            source.error(file.span.clone(), message, "mend that file or name another one")
        })?;
        *samples = Some(Arc::new(table));
    }
    Ok(())
}
