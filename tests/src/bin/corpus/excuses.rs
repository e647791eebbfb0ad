//! Which models may be refused, and why: `may_fail` of `packages.json`, by the name of the package's folder.

use std::path::Path;

use serde_json::Value;

/// Paths below a package's folder, which stands before them, with reasons.
pub(crate) struct Excuses(Vec<(String, String)>);

impl Excuses {
    pub(crate) fn read() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/packages.json");
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let packages: Value = serde_json::from_str(&text).unwrap_or_default();
        let mut excuses = Vec::new();
        for (folder, package) in packages["packages"].as_object().into_iter().flatten() {
            for entry in package["may_fail"].as_array().into_iter().flatten() {
                if let (Some(path), Some(why)) = (entry["path"].as_str(), entry["why"].as_str()) {
                    excuses.push((format!("{folder}/{path}"), why.to_owned()));
                }
            }
        }
        Self(excuses)
    }

    pub(crate) fn of(&self, file: &Path) -> Option<&str> {
        let file = file.to_string_lossy().replace('\\', "/");
        let hit = self.0.iter().find(|(path, _)| match path.strip_suffix('/') {
            Some(folder) => file.contains(&format!("/{folder}/")),
            None => file.ends_with(&format!("/{path}")),
        });
        hit.map(|(_, why)| why.as_str())
    }
}
