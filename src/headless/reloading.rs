//! Other versions of a workbench's mesh, through the same request as in an app.

use std::sync::Arc;

use bevy::prelude::*;

use super::{Pause, Workbench, WorkbenchError};
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
        let pause = Pause::new();
        loop {
            self.app.update();
            let answer = self.app.world_mut().resource_mut::<Messages<ReloadAnswer>>().drain().last();
            if let Some(answer) = answer {
                // The step that exchanges the mesh is made in this frame or in the next one.
                self.app.update();
                let report = answer.result?;
                return self.refused().map_or(Ok(report), Err);
            }
            self.check_time("exchanging the mesh")?;
            pause.rest();
        }
    }
}
