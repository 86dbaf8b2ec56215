//! The body of a blob, read piece by piece: nothing of it is kept but what the caller keeps.

use core::fmt;

use serde::Deserialize;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, SeqAccess, VariantAccess,
    Visitor,
};
use serde::forward_to_deserialize_any;

use super::{BlobError, LARGEST};
use crate::Scalar;
use crate::effects::Effect;

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

    /// The next effect, with what it fixes in the links.
    #[inline(never)]
    pub(super) fn effect<T: Scalar + Deserialize<'a>>(
        &mut self,
    ) -> Result<Effect<'a, T>, BlobError> {
        let mut effect: Effect<'a, T> = self.take()?;
        self.fill(effect.fixed_mut());
        Ok(effect)
    }

    /// What a controller does not look at.
    pub(super) fn described(&mut self) -> Result<&'a [u8], BlobError> {
        let bytes = self.bytes();
        if self.unreadable {
            return Err(BlobError::Body);
        }
        Ok(bytes)
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
    pub(super) fn fail(&mut self) {
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
    pub(super) fn byte(&mut self) -> u8 {
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
    pub(super) fn number(&mut self) -> f64 {
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
    pub(super) fn rounded(&mut self) -> f32 {
        rounded(self.number())
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

/// The nearest `f32` to a number up to [`LARGEST`], to even from halfway; 0 below its normal
/// numbers. What `as` does in a library's function of a controller, in few instructions.
#[inline]
fn rounded(number: f64) -> f32 {
    let bits = number.to_bits();
    let (high, low) = ((bits >> 32) as u32, bits as u32);
    let exponent = (high >> 20) & 0x7FF;
    // 1 and the next 30 bits; whatever follows can only say which side of halfway it is.
    let leading = 1 << 31 | (high & 0xF_FFFF) << 11 | low >> 21 | u32::from(low << 11 != 0);
    let mantissa = leading as f32 * (1.0 / 2_147_483_648.0);
    let power = f32::from_bits(exponent.wrapping_sub(1023 - 127) << 23);
    let size = if exponent <= 1023 - 127 {
        0.0
    } else {
        mantissa * power
    };
    f32::from_bits(size.to_bits() | (high & 1 << 31))
}

#[cfg(test)]
mod tests {
    use super::{LARGEST, rounded};

    #[test]
    fn numbers_are_rounded_as_the_language_does() {
        let mut state = 1_u64;
        let mut tried = 0;
        while tried < 1_000_000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            // Exponents from the smallest normal `f32` to the largest number there may be.
            let exponent = 1023 - 126 + (state >> 33) % 156;
            let noise = state.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            // Every other one close to halfway between two, or on it.
            let mantissa = match tried % 4 {
                0 => noise >> 12 & !0x1FFF_FFFF | 0x1000_0000,
                1 => noise >> 12 & !0x1FFF_FFFF | (0x0FFF_FFFF + (noise & 2)),
                _ => noise >> 12,
            };
            let number = f64::from_bits(noise & 1 << 63 | exponent << 52 | mantissa);
            assert!(number.abs() < 2.0 * LARGEST);
            let (found, wanted) = (rounded(number), number as f32);
            assert_eq!(found.to_bits(), wanted.to_bits(), "{number:e}");
            tried += 1;
        }
        assert_eq!(rounded(-0.0).to_bits(), (-0.0_f32).to_bits());
        assert_eq!(rounded(1e-300).to_bits(), 0);
        assert_eq!(rounded(LARGEST).to_bits(), (LARGEST as f32).to_bits());
    }
}
