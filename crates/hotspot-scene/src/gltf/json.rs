//! Walking through JSON with the path in hand, so that every complaint names its element.

use serde_json::Value;

use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid};

/// A JSON value and where it stands, such as `accessors[3].sparse`.
#[derive(Clone)]
pub(crate) struct Element<'a> {
    pub(crate) value: &'a Value,
    pub(crate) path: String,
}

impl<'a> Element<'a> {
    pub(crate) fn new(value: &'a Value, path: String) -> Self {
        Self { value, path }
    }

    /// The path of a member.
    pub(crate) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    /// An error about a member.
    pub(crate) fn wrong(&self, key: &str, problem: impl Into<String>) -> LoadError {
        invalid(self.path_of(key), problem, REEXPORT)
    }

    /// An error about this element.
    pub(crate) fn wrong_here(&self, problem: impl Into<String>) -> LoadError {
        invalid(self.path.clone(), problem, REEXPORT)
    }

    /// A member, whatever it is. An explicit `null` counts as absent.
    pub(crate) fn get(&self, key: &str) -> Option<Element<'a>> {
        match self.value.get(key) {
            None | Some(Value::Null) => None,
            Some(value) => Some(Element { value, path: self.path_of(key) }),
        }
    }

    /// A member that must be an object where present.
    pub(crate) fn object(&self, key: &str) -> Result<Option<Element<'a>>> {
        match self.get(key) {
            Some(element) if !element.value.is_object() => Err(self.wrong(key, "this is not an object")),
            other => Ok(other),
        }
    }

    /// A member that must be an array where present.
    pub(crate) fn array(&self, key: &str) -> Result<&'a [Value]> {
        match self.value.get(key) {
            None | Some(Value::Null) => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(_) => Err(self.wrong(key, "this is not an array")),
        }
    }

    /// The object at `index` of an array member.
    pub(crate) fn item(&self, key: &str, index: usize) -> Result<Element<'a>> {
        let items = self.array(key)?;
        let path = format!("{}[{index}]", self.path_of(key));
        match items.get(index) {
            Some(value) if value.is_object() => Ok(Element { value, path }),
            Some(_) => Err(invalid(path, "this is not an object", REEXPORT)),
            None => Err(invalid(path, format!("there are only {} {key}", items.len()), REEXPORT)),
        }
    }

    pub(crate) fn string(&self, key: &str) -> Result<Option<&'a str>> {
        match self.value.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(_) => Err(self.wrong(key, "this is not a string")),
        }
    }

    pub(crate) fn boolean(&self, key: &str) -> Result<bool> {
        match self.value.get(key) {
            None | Some(Value::Null) => Ok(false),
            Some(Value::Bool(value)) => Ok(*value),
            Some(_) => Err(self.wrong(key, "this is neither true nor false")),
        }
    }

    /// A whole number of at least 0; `3.0` counts as one.
    pub(crate) fn integer(&self, key: &str) -> Result<Option<u64>> {
        match self.value.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => match whole(value) {
                Some(number) => Ok(Some(number)),
                None => Err(self.wrong(key, format!("{value} is not a whole number of at least 0"))),
            },
        }
    }

    /// The index of one of `count` `things`.
    pub(crate) fn index(&self, key: &str, count: usize, things: &str) -> Result<Option<usize>> {
        let Some(number) = self.integer(key)? else { return Ok(None) };
        match usize::try_from(number) {
            Ok(index) if index < count => Ok(Some(index)),
            _ => {
                Err(self.wrong(key, format!("index {number} is out of range, the file has {count} {things}")))
            }
        }
    }

    /// A finite number.
    pub(crate) fn number(&self, key: &str) -> Result<Option<f64>> {
        match self.value.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => match value.as_f64().filter(|n| n.is_finite()) {
                Some(number) => Ok(Some(number)),
                None => Err(self.wrong(key, format!("{} is not a finite number", brief(value)))),
            },
        }
    }

    /// A number that is finite as f32.
    pub(crate) fn float(&self, key: &str) -> Result<Option<f32>> {
        match self.number(key)? {
            None => Ok(None),
            Some(number) if (number as f32).is_finite() => Ok(Some(number as f32)),
            Some(number) => Err(self.wrong(key, format!("{number} is too large"))),
        }
    }

    /// Exactly `N` finite numbers.
    pub(crate) fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>> {
        if self.get(key).is_none() {
            return Ok(None);
        }
        let items = self.array(key)?;
        let mut numbers = [0.0; N];
        if items.len() != N {
            return Err(self.wrong(key, format!("this has {} numbers instead of {N}", items.len())));
        }
        for (number, item) in numbers.iter_mut().zip(items) {
            *number = item
                .as_f64()
                .filter(|n| n.is_finite())
                .ok_or_else(|| self.wrong(key, format!("{} is not a finite number", brief(item))))?;
        }
        Ok(Some(numbers))
    }

    /// Exactly `N` numbers that are finite as f32.
    pub(crate) fn floats<const N: usize>(&self, key: &str) -> Result<Option<[f32; N]>> {
        let Some(numbers) = self.numbers::<N>(key)? else { return Ok(None) };
        let floats = numbers.map(|n| n as f32);
        if floats.iter().all(|f| f.is_finite()) {
            Ok(Some(floats))
        } else {
            Err(self.wrong(key, "a number is too large"))
        }
    }

    /// An extension object on this element.
    pub(crate) fn extension(&self, name: &str) -> Result<Option<Element<'a>>> {
        match self.object("extensions")? {
            Some(extensions) => extensions.object(name),
            None => Ok(None),
        }
    }

    /// The names of the extension objects on this element.
    pub(crate) fn extension_names(&self) -> Result<Vec<&'a str>> {
        let extensions = self.object("extensions")?;
        Ok(extensions
            .and_then(|e| e.value.as_object())
            .map(|map| map.keys().map(String::as_str).collect())
            .unwrap_or_default())
    }

    /// Path and name for people: `materials[3] "Velvet"`.
    pub(crate) fn label(&self) -> String {
        match self.value.get("name").and_then(Value::as_str) {
            Some(name) => format!("{} \"{name}\"", self.path),
            None => self.path.clone(),
        }
    }
}

/// A whole number of at least 0, also when written `3.0`.
pub(crate) fn whole(value: &Value) -> Option<u64> {
    // 2^53: beyond, an f64 no longer says which whole number is meant.
    let exact = |n: &f64| n.fract() == 0.0 && (0.0..=9_007_199_254_740_992.0).contains(n);
    value.as_u64().or_else(|| value.as_f64().filter(exact).map(|n| n as u64))
}

/// A value for an error message.
fn brief(value: &Value) -> String {
    match value {
        Value::Array(_) => "an array".into(),
        Value::Object(_) => "an object".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_checked_and_complaints_carry_the_path() {
        let value: Value = serde_json::from_str(
            r#"{"a": 3.0, "b": -1, "c": [1, 2], "d": 1e300, "e": null, "f": {"g": "x"}}"#,
        )
        .unwrap();
        let root = Element::new(&value, "nodes[7]".into());
        assert_eq!(root.integer("a").unwrap(), Some(3));
        assert_eq!(root.integer("e").unwrap(), None);
        assert_eq!(root.numbers::<2>("c").unwrap(), Some([1.0, 2.0]));
        assert_eq!(root.object("f").unwrap().unwrap().path, "nodes[7].f");
        let errors = [
            root.integer("b").unwrap_err(),
            root.index("a", 3, "meshes").unwrap_err(),
            root.numbers::<3>("c").unwrap_err(),
            root.float("d").unwrap_err(),
            root.string("a").unwrap_err(),
            root.boolean("a").unwrap_err(),
            root.array("f").unwrap_err(),
            root.object("a").map(|_| ()).unwrap_err(),
        ];
        for error in errors {
            assert!(error.place().element.starts_with("nodes[7]."), "{error}");
        }
    }
}
