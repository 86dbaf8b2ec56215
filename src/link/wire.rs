//! postcard's wire format, as far as messages need it: small, and without a way to panic however
//! it is compiled.

use core::fmt;

use serde::Serialize;
use serde::ser::{self, Impossible, Serializer};

/// The message does not fit, or holds what none does: signed integers, maps, single characters.
#[derive(Debug)]
pub(super) struct Unwritable;

impl fmt::Display for Unwritable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no room, or no part of a message")
    }
}

impl core::error::Error for Unwritable {}

impl ser::Error for Unwritable {
    fn custom<M: fmt::Display>(_: M) -> Self {
        Self
    }
}

/// Where a message goes.
#[derive(Debug)]
pub(super) struct Writer<'b> {
    bytes: &'b mut [u8],
    length: usize,
}

type Written = Result<(), Unwritable>;

impl<'b> Writer<'b> {
    pub(super) fn new(bytes: &'b mut [u8]) -> Self {
        Self { bytes, length: 0 }
    }

    /// What was written.
    pub(super) fn written(self) -> &'b [u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    #[inline(never)]
    fn put(&mut self, bytes: &[u8]) -> Written {
        for &byte in bytes {
            *self.bytes.get_mut(self.length).ok_or(Unwritable)? = byte;
            self.length += 1;
        }
        Ok(())
    }

    /// Seven bits a byte, the lowest first; the highest bit of a byte says that more come.
    #[inline(never)]
    fn varint(&mut self, mut value: u64) -> Written {
        while value > 0x7F {
            self.put(&[value as u8 | 0x80])?;
            value >>= 7;
        }
        self.put(&[value as u8])
    }

    fn variant(&mut self, number: u32) -> Result<&mut Self, Unwritable> {
        self.varint(u64::from(number))?;
        Ok(self)
    }
}

/// What is written as it is, and what no message holds.
macro_rules! plain {
    ($($name:ident($value:ident: $type:ty) $bytes:expr;)+) => {
        $(fn $name(self, $value: $type) -> Written { self.put($bytes) })+
    };
}
macro_rules! integers {
    ($($name:ident $type:ty;)+) => {
        $(fn $name(self, value: $type) -> Written { self.varint(u64::from(value)) })+
    };
}
macro_rules! none {
    ($($name:ident $type:ty;)+) => {
        $(fn $name(self, _: $type) -> Written { Err(Unwritable) })+
    };
}

impl Serializer for &mut Writer<'_> {
    type Ok = ();
    type Error = Unwritable;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeTupleVariant = Self;
    type SerializeMap = Impossible<(), Unwritable>;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    plain! {
        serialize_bool(value: bool) &[u8::from(value)];
        serialize_u8(value: u8) &[value];
        serialize_f32(value: f32) &value.to_le_bytes();
        serialize_f64(value: f64) &value.to_le_bytes();
    }
    integers! { serialize_u16 u16; serialize_u32 u32; serialize_u64 u64; }
    none! {
        serialize_i8 i8; serialize_i16 i16; serialize_i32 i32; serialize_i64 i64;
        serialize_char char;
    }

    fn serialize_str(self, value: &str) -> Written {
        self.serialize_bytes(value.as_bytes())
    }

    fn serialize_bytes(self, value: &[u8]) -> Written {
        self.serialize_seq(Some(value.len()))?.put(value)
    }

    fn serialize_none(self) -> Written {
        self.put(&[0])
    }

    fn serialize_some<V: Serialize + ?Sized>(self, value: &V) -> Written {
        self.put(&[1])?;
        value.serialize(self)
    }

    fn serialize_unit(self) -> Written {
        Ok(())
    }

    fn serialize_unit_struct(self, _: &'static str) -> Written {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, number: u32, _: &'static str) -> Written {
        self.variant(number).map(|_| ())
    }

    fn serialize_newtype_struct<V: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &V,
    ) -> Written {
        value.serialize(self)
    }

    fn serialize_newtype_variant<V: Serialize + ?Sized>(
        self,
        _: &'static str,
        number: u32,
        _: &'static str,
        value: &V,
    ) -> Written {
        value.serialize(self.variant(number)?)
    }

    fn serialize_seq(self, length: Option<usize>) -> Result<Self, Unwritable> {
        let length = length.and_then(|length| u64::try_from(length).ok());
        self.varint(length.ok_or(Unwritable)?)?;
        Ok(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Self, Unwritable> {
        Ok(self)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Self, Unwritable> {
        Ok(self)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        number: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self, Unwritable> {
        self.variant(number)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self::SerializeMap, Unwritable> {
        Err(Unwritable)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, Unwritable> {
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        number: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self, Unwritable> {
        self.variant(number)
    }

    fn collect_str<V: fmt::Display + ?Sized>(self, _: &V) -> Written {
        Err(Unwritable)
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

/// Items one after the other, with their names or without.
macro_rules! items {
    ($($trait:ident $name:ident($($label:ty)?);)+) => {
        $(impl ser::$trait for &mut Writer<'_> {
            type Ok = ();
            type Error = Unwritable;

            fn $name<V: Serialize + ?Sized>(&mut self, $(_: $label,)? value: &V) -> Written {
                value.serialize(&mut **self)
            }

            fn end(self) -> Written {
                Ok(())
            }
        })+
    };
}

items! {
    SerializeSeq serialize_element();
    SerializeTuple serialize_element();
    SerializeTupleStruct serialize_field();
    SerializeTupleVariant serialize_field();
    SerializeStruct serialize_field(&'static str);
    SerializeStructVariant serialize_field(&'static str);
}

#[cfg(test)]
mod tests {
    use super::super::message::{
        Active, Answer, Ask, Fault, Identity, Refusal, Reply, Report, Request, Stage,
    };
    use super::super::tally::{Last, Tally};
    use super::Writer;
    use crate::params::BlobError;
    use serde::Serialize;

    fn agrees_with_postcard(message: &impl Serialize) {
        let (mut expected, mut written) = ([0; 300], [0; 300]);
        let expected = postcard::to_slice(message, &mut expected).unwrap();
        let mut writer = Writer::new(&mut written);
        message.serialize(&mut writer).unwrap();
        assert_eq!(writer.written(), expected);
        let mut short = [0; 300];
        let mut writer = Writer::new(&mut short[..expected.len() - 1]);
        assert!(message.serialize(&mut writer).is_err());
    }

    #[test]
    fn writes_what_postcard_writes() {
        let active = Active {
            length: 128,
            crc: u32::MAX,
            sequence: 16_384,
        };
        let tally = Tally {
            statuses: [0, 127, 128, 300, 70_000, u32::MAX, 1, 2, 3, 4],
            last: Last {
                error: Some([1e-7, -0.0]),
                clamped: 0x8081,
                ..Last::default()
            },
            ..Tally::default()
        };
        let identity = Identity {
            protocol: 255,
            layout: 300,
            joints: 12,
            room: 1 << 21,
            robot: "R\u{f6}chling 7",
            firmware: "",
            active: Some(active),
        };
        let stage = Stage::Receiving {
            received: 5,
            length: 200,
        };
        let report = |stage, active| Report {
            active,
            stage,
            tally,
        };
        let joints = BlobError::Joints {
            found: usize::MAX,
            expected: 0,
        };
        let refusals = [
            Refusal::Broken,
            Refusal::Layout { expected: 300 },
            Refusal::Blob(BlobError::Magic),
            Refusal::Blob(joints),
            Refusal::Blob(BlobError::Axis { joint: 200 }),
            Refusal::Storage(Fault::Interrupted),
        ];
        let replies = [
            Reply::Identity(identity),
            Reply::Accepted { received: 1 << 28 },
            Reply::Committed(active),
            Reply::Status(report(stage, None)),
            Reply::Status(report(Stage::Saving, Some(active))),
        ];
        for reply in replies
            .into_iter()
            .chain(refusals.into_iter().map(Reply::Refused))
        {
            let number = 40_000;
            agrees_with_postcard(&Answer { number, reply });
        }
        let bytes = &[0, 1, 0x80, 255][..];
        let chunk = Ask::Chunk {
            transfer: 9,
            offset: 1000,
            bytes,
        };
        agrees_with_postcard(&Request {
            number: 1,
            ask: chunk,
        });
    }
}
