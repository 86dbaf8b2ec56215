//! TOML tables read key by key, so that every complaint has its line.

use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, Place};
use crate::units::{Quantity, split_suffix};

/// The file that tables are taken from.
#[derive(Clone, Copy)]
pub(crate) struct Document<'t> {
    pub(crate) file: &'t Path,
    pub(crate) text: &'t str,
}

/// One table. Keys are asked for by name; [`Table::finish`] then refuses all others.
pub(crate) struct Table<'t, 'd> {
    document: Document<'t>,
    entries: &'d DeTable<'t>,
    span: Range<usize>,
    /// `"joint 3"`, for messages; empty at the top.
    name: String,
    known: Vec<String>,
}

type Value<'t, 'd> = &'d Spanned<DeValue<'t>>;

impl<'t> Document<'t> {
    /// Parses the text.
    pub(crate) fn parse(&self) -> Result<Spanned<DeTable<'t>>, Error> {
        DeTable::parse(self.text).map_err(|e| {
            let offset = e.span().map_or(0, |s| s.start);
            let message = e.message().lines().collect::<Vec<_>>().join(", ");
            self.place(offset).bad(
                format!("text that is not TOML ({message})"),
                "TOML",
                "correct the line",
            )
        })
    }

    fn place(&self, offset: usize) -> Place {
        Place::offset(self.file, self.text, offset)
    }
}

impl<'t, 'd> Table<'t, 'd> {
    /// The whole document.
    pub(crate) fn root(document: Document<'t>, root: &'d Spanned<DeTable<'t>>) -> Self {
        Self {
            document,
            entries: root.get_ref(),
            span: 0..0,
            name: String::new(),
            known: Vec::new(),
        }
    }

    /// Where the table begins, with its name.
    pub(crate) fn place(&self) -> Place {
        self.named(self.document.place(self.span.start), "")
    }

    /// Where `key` stands, in whichever unit; the table's own place if it is absent.
    pub(crate) fn place_of(&self, key: &str) -> Place {
        let entry = self.entries.keys().find(|k| {
            let name: &str = k.get_ref();
            name == key || split_suffix(name).0 == key
        });
        match entry {
            Some(k) => self.named(self.document.place(k.span().start), k.get_ref()),
            None => self.named(self.document.place(self.span.start), key),
        }
    }

    fn named(&self, place: Place, key: &str) -> Place {
        match (self.name.is_empty(), key.is_empty()) {
            (true, true) => place,
            (true, false) => place.column(key),
            (false, true) => place.column(&self.name),
            (false, false) => place.column(&format!("{}, {key}", self.name)),
        }
    }

    fn take(&mut self, key: &str) -> Option<Value<'t, 'd>> {
        self.known.push(key.to_owned());
        self.entries.get(key)
    }

    /// Whether the key is there, known or not.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// A text.
    pub(crate) fn text(&mut self, key: &str) -> Result<Option<&'d str>, Error> {
        let Some(value) = self.take(key) else {
            return Ok(None);
        };
        match value.get_ref().as_str() {
            Some(text) => Ok(Some(text)),
            None => Err(self.wrong(key, value, "a text in quotes")),
        }
    }

    /// True or false; false where it is absent.
    pub(crate) fn flag(&mut self, key: &str) -> Result<bool, Error> {
        let Some(value) = self.take(key) else {
            return Ok(false);
        };
        match value.get_ref() {
            DeValue::Boolean(it) => Ok(*it),
            _ => Err(self.wrong(key, value, "true or false")),
        }
    }

    /// A table inside this one.
    pub(crate) fn table(&mut self, key: &str) -> Result<Option<Table<'t, 'd>>, Error> {
        let Some(value) = self.take(key) else {
            return Ok(None);
        };
        let name = if self.name.is_empty() {
            key.to_owned()
        } else {
            format!("{}, {key}", self.name)
        };
        match value.get_ref().as_table() {
            Some(_) => Ok(self.inner(value, name)),
            None => Err(self.wrong(key, value, &format!("a table, [{key}]"))),
        }
    }

    /// An array of tables; each is named by `key` and its number.
    pub(crate) fn tables(&mut self, key: &str) -> Result<Vec<Table<'t, 'd>>, Error> {
        let Some(value) = self.take(key) else {
            return Ok(Vec::new());
        };
        let expected = format!("tables, each headed by [[{key}]]");
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.wrong(key, value, &expected));
        };
        let mut tables = Vec::new();
        for (k, item) in array.iter().enumerate() {
            match self.inner(item, format!("{key} {}", k + 1)) {
                Some(table) => tables.push(table),
                None => return Err(self.wrong(key, item, &expected)),
            }
        }
        Ok(tables)
    }

    fn inner(&self, value: Value<'t, 'd>, name: String) -> Option<Table<'t, 'd>> {
        value.get_ref().as_table().map(|entries| Table {
            document: self.document,
            entries,
            span: value.span(),
            name,
            known: Vec::new(),
        })
    }

    /// The key in whichever unit it is written, with the factor to SI.
    fn quantity(
        &mut self,
        key: &str,
        quantity: Quantity,
    ) -> Result<Option<(String, Value<'t, 'd>, f64)>, Error> {
        let mut found: Option<(String, Value<'t, 'd>, f64)> = None;
        let suffixed = quantity
            .suffixes()
            .map(|s| (format!("{key}{}", s.text), s.factor));
        for (name, factor) in std::iter::once((key.to_owned(), 1.0)).chain(suffixed) {
            let Some(value) = self.take(&name) else {
                continue;
            };
            if let Some((other, ..)) = found {
                return Err(self.place_of(&name).bad(
                    format!("{name} beside {other}"),
                    "one of them",
                    "delete one: they are the same quantity in two units",
                ));
            }
            found = Some((name, value, factor));
        }
        Ok(found)
    }

    /// A finite number, in SI.
    pub(crate) fn number(&mut self, key: &str, quantity: Quantity) -> Result<Option<f64>, Error> {
        let Some((name, value, factor)) = self.quantity(key, quantity)? else {
            return Ok(None);
        };
        match number(value.get_ref()) {
            Some(x) => Ok(Some(x * factor)),
            None => Err(self.wrong(&name, value, "a finite number")),
        }
    }

    /// An array of `N` finite numbers, in SI.
    pub(crate) fn numbers<const N: usize>(
        &mut self,
        key: &str,
        quantity: Quantity,
    ) -> Result<Option<[f64; N]>, Error> {
        let Some((name, value, factor)) = self.quantity(key, quantity)? else {
            return Ok(None);
        };
        match numbers::<N>(value.get_ref()) {
            Some(x) => Ok(Some(x.map(|x| x * factor))),
            None => Err(self.wrong(&name, value, &format!("{N} finite numbers in brackets"))),
        }
    }

    /// An array of arrays of `N` finite numbers, in SI.
    pub(crate) fn lists<const N: usize>(
        &mut self,
        key: &str,
        quantity: Quantity,
    ) -> Result<Vec<[f64; N]>, Error> {
        let Some((name, value, factor)) = self.quantity(key, quantity)? else {
            return Ok(Vec::new());
        };
        let expected = format!("a list of lists of {N} finite numbers");
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.wrong(&name, value, &expected));
        };
        let mut lists = Vec::new();
        for item in array.iter() {
            match numbers::<N>(item.get_ref()) {
                Some(x) => lists.push(x.map(|x| x * factor)),
                None => return Err(self.wrong(&name, item, &expected)),
            }
        }
        Ok(lists)
    }

    fn wrong(&self, key: &str, value: Value<'t, 'd>, expected: &str) -> Error {
        let span = value.span();
        let text = self.document.text.get(span.clone()).unwrap_or("");
        let line = text.lines().next().unwrap_or("");
        let mut found: String = line.chars().take(40).collect();
        if found.len() < text.len() {
            found.push_str(" ...");
        }
        self.named(self.document.place(span.start), key)
            .bad(found, expected, "correct the value")
    }

    /// Refuses keys that nobody asked for.
    pub(crate) fn finish(self) -> Result<(), Error> {
        for key in self.entries.keys() {
            let name: &str = key.get_ref();
            if !self.known.iter().any(|k| k == name) {
                let place = self.named(self.document.place(key.span().start), "");
                return Err(place.bad(
                    format!("the unknown key {name}"),
                    format!("one of {}", self.known.join(", ")),
                    "correct its spelling or delete it",
                ));
            }
        }
        Ok(())
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    let x = match value {
        DeValue::Float(x) => x.as_str().parse::<f64>().ok()?,
        DeValue::Integer(x) => i64::from_str_radix(x.as_str(), x.radix()).ok()? as f64,
        _ => return None,
    };
    x.is_finite().then_some(x)
}

fn numbers<const N: usize>(value: &DeValue<'_>) -> Option<[f64; N]> {
    let array = value.as_array()?;
    let all: Option<Vec<f64>> = array.iter().map(|item| number(item.get_ref())).collect();
    all?.try_into().ok()
}
