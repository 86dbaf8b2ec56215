//! Looks at every real number in anything that can be serialised, so that no new field or
//! effect can be forgotten.

use core::fmt;

use serde::ser::{self, Impossible, Serialize};

use super::{BlobError, LARGEST};

/// Refuses `value` if a real number in it is not finite or larger than [`LARGEST`], or if
/// something in it has no stored form.
#[inline(never)]
pub(super) fn check(value: &impl Serialize) -> Result<(), BlobError> {
    value.serialize(Look).map_err(|unsound| match unsound {
        Unsound::Number => BlobError::Number,
        Unsound::Form => BlobError::Body,
    })
}

/// A serialiser that writes nothing.
#[derive(Clone, Copy)]
struct Look;

/// What was found.
#[derive(Debug)]
enum Unsound {
    /// NaN, infinite or too large.
    Number,
    /// No stored form.
    Form,
}

impl fmt::Display for Unsound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not sound")
    }
}

impl core::error::Error for Unsound {}

impl ser::Error for Unsound {
    fn custom<M: fmt::Display>(_: M) -> Self {
        Self::Form
    }
}

macro_rules! accept {
    ($($name:ident: $type:ty),+ $(,)?) => {
        $(fn $name(self, _: $type) -> Result<(), Unsound> { Ok(()) })+
    };
}

impl ser::Serializer for Look {
    type Ok = ();
    type Error = Unsound;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeTupleVariant = Self;
    type SerializeMap = Impossible<(), Unsound>;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    accept! {
        serialize_bool: bool, serialize_char: char, serialize_str: &str,
        serialize_bytes: &[u8], serialize_unit_struct: &'static str,
        serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64,
    }

    fn serialize_f32(self, v: f32) -> Result<(), Unsound> {
        self.serialize_f64(f64::from(v))
    }

    fn serialize_f64(self, v: f64) -> Result<(), Unsound> {
        // NaN fails the comparison.
        if v.abs() <= LARGEST {
            Ok(())
        } else {
            Err(Unsound::Number)
        }
    }

    fn serialize_none(self) -> Result<(), Unsound> {
        Ok(())
    }

    fn serialize_unit(self) -> Result<(), Unsound> {
        Ok(())
    }

    fn serialize_some<V: Serialize + ?Sized>(self, value: &V) -> Result<(), Unsound> {
        value.serialize(self)
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
    ) -> Result<(), Unsound> {
        Ok(())
    }

    fn serialize_newtype_struct<V: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &V,
    ) -> Result<(), Unsound> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<V: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &V,
    ) -> Result<(), Unsound> {
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self::SerializeMap, Unsound> {
        // The layout has no maps.
        Err(Unsound::Form)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self, Unsound> {
        Ok(self)
    }

    fn collect_str<V: fmt::Display + ?Sized>(self, _: &V) -> Result<(), Unsound> {
        Ok(())
    }
}

macro_rules! look_into {
    ($($trait:ident :: $method:ident ( $($key:ty)? )),+ $(,)?) => {
        $(impl ser::$trait for Look {
            type Ok = ();
            type Error = Unsound;

            fn $method<V: Serialize + ?Sized>(
                &mut self,
                $(_: $key,)?
                value: &V,
            ) -> Result<(), Unsound> {
                value.serialize(*self)
            }

            fn end(self) -> Result<(), Unsound> {
                Ok(())
            }
        })+
    };
}

look_into! {
    SerializeSeq::serialize_element(),
    SerializeTuple::serialize_element(),
    SerializeTupleStruct::serialize_field(),
    SerializeTupleVariant::serialize_field(),
    SerializeStruct::serialize_field(&'static str),
    SerializeStructVariant::serialize_field(&'static str),
}
