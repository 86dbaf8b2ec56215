//! The body of a blob, read piece by piece: nothing of it is kept but what the caller keeps.

use core::fmt;

use serde::Deserialize;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, SeqAccess, VariantAccess,
    Visitor,
};
use serde::forward_to_deserialize_any;

use super::{BlobError, LARGEST};

/// A place in the body. Pieces are taken in the order of the layout, which is postcard's. Every
/// real number is looked at as it passes, so that no new field or effect can be forgotten.
#[derive(Debug)]
pub struct Body<'a> {
    rest: &'a [u8],
    /// Whether a number has passed that is not finite or larger than [`LARGEST`].
    unsound: bool,
    /// Whether the bytes did not follow the layout. It is looked at once a piece: what is read
    /// then is zeros, which saves a way out at every number.
    unreadable: bool,
}

/// The bytes do not follow the layout, or a type was asked for that no layout has.
#[derive(Debug)]
pub struct Unreadable;

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not what was expected")
    }
}

impl core::error::Error for Unreadable {}

impl Error for Unreadable {
    fn custom<M: fmt::Display>(_: M) -> Self {
        Self
    }
}

impl<'a> Body<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            unsound: false,
            unreadable: false,
        }
    }

    /// The next piece. Once in the program for each type, whoever takes it.
    #[inline(never)]
    pub(super) fn take<V: Deserialize<'a>>(&mut self) -> Result<V, BlobError> {
        match V::deserialize(&mut *self) {
            Ok(piece) if !self.unreadable => Ok(piece),
            _ => Err(BlobError::Body),
        }
    }

    /// A string of at most `room` bytes.
    pub(super) fn text(&mut self, room: usize) -> Result<&'a str, BlobError> {
        let text: &str = self.take()?;
        if text.len() > room {
            return Err(BlobError::Body);
        }
        Ok(text)
    }

    /// Length of the list whose items come next, at most `room`.
    pub(super) fn count(&mut self, room: usize) -> Result<usize, BlobError> {
        let count = self.length();
        if count > room || self.unreadable {
            return Err(BlobError::Body);
        }
        Ok(count)
    }

    /// Length of a list that has to have `expected` items.
    pub(super) fn exactly(&mut self, expected: usize) -> Result<(), BlobError> {
        let found = self.count(expected)?;
        if found != expected {
            return Err(BlobError::Joints { found, expected });
        }
        Ok(())
    }

    /// A list of as many items as there are places.
    pub(super) fn list<V: Deserialize<'a>>(&mut self, places: &mut [V]) -> Result<(), BlobError> {
        self.exactly(places.len())?;
        for place in places {
            *place = self.take()?;
        }
        Ok(())
    }

    /// Whether a number has passed that is none.
    pub(super) fn unsound(&self) -> bool {
        self.unsound
    }

    /// Bytes that are left over.
    pub(super) fn rest(&self) -> usize {
        self.rest.len()
    }

    /// Nothing more can be read.
    #[inline(never)]
    fn fail(&mut self) {
        self.rest = &[];
        self.unreadable = true;
    }

    /// An unsigned integer of `bits` bits: seven of them a byte, the lowest first, the highest
    /// bit of a byte says that more come.
    #[inline(never)]
    fn varint(&mut self, bits: u32) -> u32 {
        let (mut value, mut shift) = (0, 0);
        while shift < bits {
            let byte = self.byte();
            let part = u32::from(byte & 0x7F);
            let left = bits - shift;
            if left < 7 && part >> left != 0 {
                break;
            }
            value |= part << shift;
            if byte < 0x80 {
                return value;
            }
            shift += 7;
        }
        self.fail();
        0
    }

    #[inline(never)]
    fn byte(&mut self) -> u8 {
        match self.rest {
            [byte, rest @ ..] => {
                self.rest = rest;
                *byte
            }
            [] => {
                self.fail();
                0
            }
        }
    }

    fn length(&mut self) -> usize {
        usize::try_from(self.varint(32)).unwrap_or(usize::MAX)
    }

    #[inline(never)]
    fn number(&mut self) -> f64 {
        let Some((bytes, rest)) = self.rest.split_first_chunk() else {
            self.fail();
            return 0.0;
        };
        self.rest = rest;
        let number = f64::from_le_bytes(*bytes);
        // Magnitudes rank as their bits do; infinity and NaN come last.
        self.unsound |= number.abs().to_bits() > LARGEST.to_bits();
        number
    }

    /// Rounded once.
    #[inline(never)]
    fn rounded(&mut self) -> f32 {
        self.number() as f32
    }

    /// As many bytes as their length in front says.
    #[inline(never)]
    fn bytes(&mut self) -> &'a [u8] {
        let length = self.length();
        match self.rest.split_at_checked(length) {
            Some((bytes, rest)) => {
                self.rest = rest;
                bytes
            }
            None => {
                self.fail();
                &[]
            }
        }
    }
}

/// Unsigned integers by their bits.
macro_rules! integers {
    ($($name:ident $visit:ident $type:ty),+) => {
        $(fn $name<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
            let value = self.varint(<$type>::BITS);
            visitor.$visit(<$type>::try_from(value).unwrap_or_default())
        })+
    };
}

/// What is made of items without a length in front.
macro_rules! items {
    ($($name:ident($($argument:ty),*; $count:ident $type:ty)),+ $(,)?) => {
        $(fn $name<V: Visitor<'a>>(
            self,
            $(_: $argument,)*
            $count: $type,
            visitor: V,
        ) -> Result<V::Value, Unreadable> {
            visitor.visit_seq(Items { body: self, left: $count })
        })+
    };
}

impl<'a> Deserializer<'a> for &mut Body<'a> {
    type Error = Unreadable;

    integers!(deserialize_u16 visit_u16 u16, deserialize_u32 visit_u32 u32);
    items! {
        deserialize_tuple(; count usize),
        deserialize_tuple_struct(&'static str; count usize),
    }

    fn deserialize_struct<V: Visitor<'a>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unreadable> {
        self.deserialize_tuple(fields.len(), visitor)
    }

    fn deserialize_seq<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        let count = self.length();
        self.deserialize_tuple(count, visitor)
    }

    fn deserialize_u8<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        visitor.visit_u8(self.byte())
    }

    fn deserialize_f64<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        visitor.visit_f64(self.number())
    }

    /// Stored as any real number, rounded once.
    fn deserialize_f32<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        visitor.visit_f32(self.rounded())
    }

    fn deserialize_str<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        let text = core::str::from_utf8(self.bytes()).map_err(|_| Unreadable)?;
        visitor.visit_borrowed_str(text)
    }

    fn deserialize_string<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        self.deserialize_str(visitor)
    }

    fn deserialize_bytes<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        visitor.visit_borrowed_bytes(self.bytes())
    }

    fn deserialize_option<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Unreadable> {
        match self.byte() {
            0 => visitor.visit_none(),
            1 => visitor.visit_some(self),
            _ => Err(Unreadable),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'a>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Unreadable> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'a>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unreadable> {
        visitor.visit_enum(self)
    }

    fn deserialize_any<V: Visitor<'a>>(self, _: V) -> Result<V::Value, Unreadable> {
        Err(Unreadable)
    }

    forward_to_deserialize_any! {
        <V: Visitor<'a>>
        bool i8 i16 i32 i64 u64 char byte_buf unit unit_struct map identifier ignored_any
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

/// Items of a list, one after the other.
struct Items<'b, 'a> {
    body: &'b mut Body<'a>,
    left: usize,
}

impl<'a> SeqAccess<'a> for Items<'_, 'a> {
    type Error = Unreadable;

    fn next_element_seed<S: DeserializeSeed<'a>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Unreadable> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        seed.deserialize(&mut *self.body).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.left)
    }
}

impl<'a> EnumAccess<'a> for &mut Body<'a> {
    type Error = Unreadable;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'a>>(self, seed: S) -> Result<(S::Value, Self), Unreadable> {
        let number: u32 = self.varint(32);
        let variant = seed.deserialize(number.into_deserializer())?;
        Ok((variant, self))
    }
}

impl<'a> VariantAccess<'a> for &mut Body<'a> {
    type Error = Unreadable;

    fn unit_variant(self) -> Result<(), Unreadable> {
        Ok(())
    }

    fn newtype_variant_seed<S: DeserializeSeed<'a>>(self, seed: S) -> Result<S::Value, Unreadable> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'a>>(
        self,
        count: usize,
        visitor: V,
    ) -> Result<V::Value, Unreadable> {
        self.deserialize_tuple(count, visitor)
    }

    fn struct_variant<V: Visitor<'a>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unreadable> {
        self.deserialize_tuple(fields.len(), visitor)
    }
}
