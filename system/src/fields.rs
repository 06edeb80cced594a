//! Tables of TOML by the names of their fields. A structure of serde's own is also read from an array, by the order of
//! its fields, which no file of a user should depend on.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// A `T` that is read from a table alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Table<T>(pub T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Table<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Fields<T> {
            type Value = Table<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Table)
            }
        }

        deserializer.deserialize_map(Fields(PhantomData))
    }
}

/// A `T` that is read from a table alone, for `#[serde(deserialize_with)]`.
///
/// # Errors
/// What is not a table, or a table that is not a `T`.
pub fn table<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    Table::deserialize(deserializer).map(|Table(it)| it)
}

/// An `Option<T>` that is read from a table alone, for `#[serde(deserialize_with)]`.
///
/// # Errors
/// What is not a table, or a table that is not a `T`.
pub fn optional<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    table(deserializer).map(Some)
}

/// A map of `T`s that are read from tables alone, for `#[serde(deserialize_with)]`.
///
/// # Errors
/// What is not a table, or a table that is not a `T`.
pub fn map<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, T>, D::Error> {
    let map = BTreeMap::<String, Table<T>>::deserialize(deserializer)?;
    Ok(map
        .into_iter()
        .map(|(name, Table(it))| (name, it))
        .collect())
}
