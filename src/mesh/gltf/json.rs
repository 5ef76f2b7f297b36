//! Access to fields of JSON objects with errors that name the place.

use std::mem::size_of;

use serde_json::Value;

use super::{
    GltfError,
    budget::Budget,
    tree::{Fields, Json},
};

/// A JSON object and the pointer to it.
#[derive(Clone)]
pub(super) struct JsonObject<'a> {
    pub(super) map: &'a Fields<'a>,
    pub(super) place: String,
}

impl<'a> JsonObject<'a> {
    pub(super) fn new(value: &'a Json<'a>, place: String) -> Result<Self, GltfError> {
        match value.as_object() {
            Some(map) => Ok(Self { map, place }),
            None => Err(GltfError::at(place, "must be an object")),
        }
    }

    /// The pointer to a field.
    pub(super) fn sub(&self, key: &str) -> String {
        format!("{}/{}", self.place, key.replace('~', "~0").replace('/', "~1"))
    }

    /// An error at a field.
    pub(super) fn fail(&self, key: &str, what: impl Into<String>) -> GltfError {
        GltfError::at(self.sub(key), what)
    }

    /// Turns an absent field into an error.
    pub(super) fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, GltfError> {
        value.ok_or_else(|| GltfError::at(&*self.place, format!("\"{key}\" is missing")))
    }

    /// A nested object.
    pub(super) fn object(&self, key: &str) -> Result<Option<JsonObject<'a>>, GltfError> {
        self.map.get(key).map(|value| JsonObject::new(value, self.sub(key))).transpose()
    }

    /// An array's elements; none if absent.
    pub(super) fn array(&self, key: &str) -> Result<&'a [Json<'a>], GltfError> {
        match self.map.get(key) {
            None => Ok(&[]),
            Some(Json::List(list)) => Ok(list),
            Some(_) => Err(self.fail(key, "must be an array")),
        }
    }

    /// An array's elements, which must be objects.
    pub(super) fn objects(
        &self,
        key: &'a str,
    ) -> Result<impl Iterator<Item = Result<JsonObject<'a>, GltfError>> + use<'a>, GltfError> {
        let place = self.sub(key);
        let list = self.array(key)?;
        Ok(list.iter().enumerate().map(move |(i, value)| JsonObject::new(value, format!("{place}/{i}"))))
    }

    /// A whole number that is not negative; `3.0` counts as one.
    pub(super) fn uint(&self, key: &str) -> Result<Option<usize>, GltfError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(value) => match whole(value) {
                Some(number) => Ok(Some(number)),
                None => Err(self.fail(key, "must be a whole number of at least zero")),
            },
        }
    }

    /// The index of one of `len` objects; `of` names their kind in errors.
    pub(super) fn index(&self, key: &str, len: usize, of: &str) -> Result<Option<usize>, GltfError> {
        match self.uint(key)? {
            Some(index) if index >= len => Err(self.fail(key, out_of_range(index, len, of))),
            index => Ok(index),
        }
    }

    /// A list of indices, each of one of `len` objects.
    pub(super) fn indices(&self, key: &str, len: usize, of: &str) -> Result<Vec<usize>, GltfError> {
        let list = self.array(key)?;
        let mut indices = Vec::with_capacity(list.len());
        for (i, value) in list.iter().enumerate() {
            match whole(value) {
                Some(index) if index < len => indices.push(index),
                Some(index) => {
                    return Err(GltfError::at(format!("{}/{i}", self.sub(key)), out_of_range(index, len, of)));
                }
                None => return Err(GltfError::at(format!("{}/{i}", self.sub(key)), "must be an index")),
            }
        }
        Ok(indices)
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, GltfError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(Json::Text(text)) => Ok(Some(text)),
            Some(_) => Err(self.fail(key, "must be a string")),
        }
    }

    /// The `name`; empty if absent or not a string, since nothing depends on it.
    pub(super) fn name(&self) -> &'a str {
        self.map.get("name").and_then(Json::as_str).unwrap_or_default()
    }

    pub(super) fn flag(&self, key: &str) -> Result<bool, GltfError> {
        match self.map.get(key) {
            None => Ok(false),
            Some(Json::Flag(flag)) => Ok(*flag),
            Some(_) => Err(self.fail(key, "must be true or false")),
        }
    }

    /// A list of finite numbers, as `f64`.
    pub(super) fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>, GltfError> {
        if !self.map.contains_key(key) {
            return Ok(None);
        }
        let list = self.array(key)?;
        let mut numbers = Vec::with_capacity(list.len());
        for (i, value) in list.iter().enumerate() {
            match value.as_f64() {
                // A number beyond the range of `f32` counts as infinite.
                Some(number) if (number as f32).is_finite() => numbers.push(number),
                _ => return Err(GltfError::at(format!("{}/{i}", self.sub(key)), "must be a finite number")),
            }
        }
        Ok(Some(numbers))
    }

    /// Exactly `N` finite numbers.
    pub(super) fn vector<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, GltfError> {
        match self.numbers(key)? {
            None => Ok(None),
            Some(numbers) => match <[f64; N]>::try_from(numbers) {
                Ok(vector) => Ok(Some(vector)),
                Err(numbers) => Err(self.fail(key, format!("must have {N} numbers, has {}", numbers.len()))),
            },
        }
    }
}

/// A whole number within range, also when it is written as a float.
pub(super) fn whole(value: &Json) -> Option<usize> {
    match value.as_u64() {
        Some(number) => usize::try_from(number).ok(),
        None => whole_float(value.as_f64()?),
    }
}

/// A float as a whole number within range.
pub(super) fn whole_float(number: f64) -> Option<usize> {
    // 2^53: up to here every whole number is exact.
    (number.fract() == 0.0 && (0.0..=9_007_199_254_740_992.0).contains(&number)).then_some(number as usize)
}

fn out_of_range(index: usize, len: usize, of: &str) -> String {
    format!("refers to {of} {index}, but there are {len}")
}

/// A copy of a value that is carried unread, within the budget: many objects may refer to the same value.
pub(super) fn copy(value: &Json, budget: &Budget, place: &str) -> Result<Value, GltfError> {
    budget.take(1, tree_bytes(value), place)?;
    Ok(value.to_value())
}

/// Memory of a copy of a value in bytes; the parser's limit on depth keeps the recursion shallow.
fn tree_bytes(value: &Json) -> usize {
    const ENTRY: usize = 64;
    let inside = match value {
        Json::Text(text) => text.len(),
        Json::List(list) => list.iter().map(tree_bytes).sum(),
        Json::Object(map) => map.iter().map(|(key, value)| key.len() + ENTRY + tree_bytes(value)).sum(),
        _ => 0,
    };
    size_of::<Value>() + inside
}
