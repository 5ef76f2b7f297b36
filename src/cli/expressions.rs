//! Expressions of faces for every command that shows or writes them.

use std::sync::{Arc, OnceLock};

use super::{Failure, Report};
use crate::{
    algo::face::expression::ExpressionSet,
    files::{RealDisk, SearchPaths, load_expressions},
};

/// The expressions that come with Rigsmith, and those in the folders of the site. Files that cannot be used are told, once.
pub(super) fn of_site(report: &mut Report) -> Result<Arc<ExpressionSet>, Failure> {
    static READ: OnceLock<Arc<ExpressionSet>> = OnceLock::new();
    if let Some(known) = READ.get() {
        return Ok(known.clone());
    }
    let site = SearchPaths::of_site().map_err(|error| Failure::Input(Box::new(error)))?;
    let (set, faults) = load_expressions(&RealDisk, &site.folders);
    report.notes(faults);
    Ok(READ.get_or_init(|| Arc::new(set)).clone())
}
