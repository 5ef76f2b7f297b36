//! The JSON of a file as a tree of few bytes: texts stay in the file, and lists have no room to grow.
//!
//! A value takes a third of the memory of one of `serde_json`, and an object has no table of its keys. Only what a model
//! carries unread becomes a value of `serde_json`.

use std::{borrow::Cow, fmt, mem};

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

/// Value of a JSON text.
#[derive(Debug)]
pub(super) enum Json<'a> {
    Null,
    Flag(bool),
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    /// Text, which is copied only if it has escapes.
    Text(Cow<'a, str>),
    List(Box<[Json<'a>]>),
    Object(Fields<'a>),
}

/// Fields of an object in the order of the file, each key once.
#[derive(Debug)]
pub(super) struct Fields<'a>(Box<[Field<'a>]>);

type Field<'a> = (Cow<'a, str>, Json<'a>);

/// Numbers of fields up to which keys are compared one by one.
const FEW_FIELDS: usize = 16;

impl<'a> Json<'a> {
    /// Fields of an object; `None` for other values.
    pub(super) fn as_object(&self) -> Option<&Fields<'a>> {
        match self {
            Self::Object(fields) => Some(fields),
            _ => None,
        }
    }

    /// Values of a list; `None` for other values.
    pub(super) fn as_list(&self) -> Option<&[Self]> {
        match self {
            Self::List(list) => Some(list),
            _ => None,
        }
    }

    /// Value of a field; `None` for a value that is no object, too.
    pub(super) fn get(&self, key: &str) -> Option<&Self> {
        self.as_object().and_then(|fields| fields.get(key))
    }

    pub(super) fn as_str(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    pub(super) fn as_u64(&self) -> Option<u64> {
        match self {
            Self::Unsigned(number) => Some(*number),
            _ => None,
        }
    }

    pub(super) fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Unsigned(number) => Some(*number as f64),
            Self::Signed(number) => Some(*number as f64),
            Self::Float(number) => Some(*number),
            _ => None,
        }
    }

    /// Copy as a value of `serde_json`; the parser's limit on depth keeps the recursion shallow.
    pub(super) fn to_value(&self) -> Value {
        match self {
            Self::Null => Value::Null,
            Self::Flag(flag) => Value::from(*flag),
            Self::Unsigned(number) => Value::from(*number),
            Self::Signed(number) => Value::from(*number),
            Self::Float(number) => Value::from(*number),
            Self::Text(text) => Value::from(&**text),
            Self::List(list) => Value::Array(list.iter().map(Json::to_value).collect()),
            Self::Object(fields) => {
                Value::Object(fields.iter().map(|(key, value)| (key.to_owned(), value.to_value())).collect())
            }
        }
    }
}

impl<'a> Fields<'a> {
    /// Value of a field. Costs a comparison with each key before it.
    pub(super) fn get(&self, key: &str) -> Option<&Json<'a>> {
        self.0.iter().find(|(own, _)| own == key).map(|(_, value)| value)
    }

    pub(super) fn contains_key(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Json<'a>)> {
        self.0.iter().map(|(key, value)| (&**key, value))
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Fields of which the last with a key counts, at the place of the first.
    fn new(mut fields: Vec<Field<'a>>) -> Self {
        let is_new = |(at, field): (usize, &Field)| fields[..at].iter().all(|other| other.0 != field.0);
        let is_plain = fields.len() <= FEW_FIELDS && fields.iter().enumerate().all(is_new);
        if !is_plain {
            let mut order: Vec<usize> = (0..fields.len()).collect();
            order.sort_by(|a, b| fields[*a].0.cmp(&fields[*b].0));
            let repeats = |pair: &[usize]| (fields[pair[0]].0 == fields[pair[1]].0).then_some((pair[0], pair[1]));
            let repeats: Vec<(usize, usize)> = order.windows(2).filter_map(repeats).collect();
            let mut is_kept = vec![true; fields.len()];
            // Values move towards the first field with their key, those of the last fields at first.
            for (before, after) in repeats.into_iter().rev() {
                let value = mem::replace(&mut fields[after].1, Json::Null);
                fields[before].1 = value;
                is_kept[after] = false;
            }
            let mut kept = is_kept.into_iter();
            fields.retain(|_| kept.next().unwrap_or(true));
        }
        Self(fields.into_boxed_slice())
    }
}

impl<'de> Deserialize<'de> for Json<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Json<'de>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("any valid JSON value")
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok(Json::Null)
    }

    fn visit_bool<E>(self, flag: bool) -> Result<Self::Value, E> {
        Ok(Json::Flag(flag))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Self::Value, E> {
        Ok(Json::Unsigned(number))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
        Ok(u64::try_from(number).map_or(Json::Signed(number), Json::Unsigned))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
        Ok(Json::Float(number))
    }

    fn visit_borrowed_str<E>(self, text: &'de str) -> Result<Self::Value, E> {
        Ok(Json::Text(Cow::Borrowed(text)))
    }

    fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
        Ok(Json::Text(Cow::Owned(text.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self::Value, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Json::List(list.into_boxed_slice()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
        let mut fields = Vec::new();
        while let Some((Key(key), value)) = entries.next_entry()? {
            fields.push((key, value));
        }
        Ok(Json::Object(Fields::new(fields)))
    }
}

/// Key of a field, in the file where it has no escapes.
struct Key<'a>(Cow<'a, str>);

impl<'de> Deserialize<'de> for Key<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(KeyVisitor)
    }
}

struct KeyVisitor;

impl<'de> Visitor<'de> for KeyVisitor {
    type Value = Key<'de>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a string key")
    }

    fn visit_borrowed_str<E>(self, text: &'de str) -> Result<Self::Value, E> {
        Ok(Key(Cow::Borrowed(text)))
    }

    fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
        Ok(Key(Cow::Owned(text.to_owned())))
    }
}
