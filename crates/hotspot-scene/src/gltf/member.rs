//! Members of JSON objects that the crate does not read: typed, with the path in every complaint.

use serde_json::Value;

use crate::error::{REEXPORT, Result, invalid};

/// The member at a path such as `extensions.KHR_materials_sheen.sheenColorFactor`.
pub(crate) fn at<'v>(value: &'v Value, key: &str) -> Option<&'v Value> {
    key.split('.').try_fold(value, |value, key| value.get(key))
}

/// A list of numbers. `path` is that of `value`.
pub(crate) fn numbers<const N: usize>(value: &Value, path: &str, key: &str) -> Result<Option<[f64; N]>> {
    let Some(member) = at(value, key) else { return Ok(None) };
    let numbers: Option<Vec<f64>> =
        member.as_array().and_then(|items| items.iter().map(Value::as_f64).collect());
    match numbers.and_then(|numbers| numbers.try_into().ok()) {
        Some(numbers) => Ok(Some(numbers)),
        None => Err(invalid(format!("{path}.{key}"), format!("this is not a list of {N} numbers"), REEXPORT)),
    }
}

/// A number.
pub(crate) fn number(value: &Value, path: &str, key: &str) -> Result<Option<f64>> {
    let Some(member) = at(value, key) else { return Ok(None) };
    match member.as_f64() {
        Some(number) => Ok(Some(number)),
        None => Err(invalid(format!("{path}.{key}"), "this is not a number", REEXPORT)),
    }
}

/// An index below `count`, which is how many `things` there are.
pub(crate) fn index(
    value: &Value,
    path: &str,
    key: &str,
    count: usize,
    things: &str,
) -> Result<Option<usize>> {
    let Some(member) = at(value, key) else { return Ok(None) };
    let wrong = |problem: String| invalid(format!("{path}.{key}"), problem, REEXPORT);
    let stated = member.as_u64().ok_or_else(|| wrong("this is not an index".into()))?;
    match usize::try_from(stated) {
        Ok(index) if index < count => Ok(Some(index)),
        _ => Err(wrong(format!("index {stated} is out of range, the file has {count} {things}"))),
    }
}
