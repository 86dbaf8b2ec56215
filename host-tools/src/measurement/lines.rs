//! Which line of a file a record stands in.

/// Finds the line that each record begins in: `csv` counts from the comments before it.
pub(super) struct Lines<'t> {
    bytes: &'t [u8],
    at: usize,
    line: usize,
}

impl<'t> Lines<'t> {
    /// Of a table, at its first line.
    pub(super) fn of(text: &'t str) -> Self {
        Self {
            bytes: text.as_bytes(),
            at: 0,
            line: 1,
        }
    }

    /// The line of the record that `csv` has at byte `offset`.
    pub(super) fn of_record_at(&mut self, offset: u64) -> usize {
        let offset = usize::try_from(offset).unwrap_or(usize::MAX);
        let mut in_comment = false;
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' => {
                    self.line += 1;
                    in_comment = false;
                }
                b'\r' => {}
                _ if self.at < offset || in_comment => {}
                b'#' => in_comment = true,
                _ => break,
            }
            self.at += 1;
        }
        self.line
    }
}
