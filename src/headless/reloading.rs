//! Other versions of a workbench's mesh, through the same request as in an app.

use std::sync::Arc;

use super::{Workbench, WorkbenchError};
use crate::{
    mesh::model::Model,
    plugins::mesh_reload::{ReloadAnswer, ReloadReport, ReloadRequest},
};

impl Workbench {
    /// Exchanges the mesh for another version of it: joints stay, and weights are transferred.
    ///
    /// # Errors
    /// See [`ReloadError`](crate::plugins::mesh_reload::ReloadError); the mesh stays as it was then.
    pub fn reload(&mut self, model: Model) -> Result<ReloadReport, WorkbenchError> {
        let mesh = self.mesh.ok_or(WorkbenchError::NoMesh)?;
        self.check_time("exchanging the mesh")?;
        self.forget_refusals();
        self.app.world_mut().write_message(ReloadRequest { mesh, model: Arc::new(model) });
        let answer: ReloadAnswer = self.await_answer("exchanging the mesh", |_| {})?;
        let report = answer.result?;
        self.refused().map_or(Ok(report), Err)
    }
}
