//! The footer: schema, page offsets, metadata.

use lockstep::port::Element;

use super::thrift::Struct;

/// A column chunk in the file.
pub(super) struct Chunk {
    pub(super) offset: u64,
    /// Total size of header and values, bytes.
    pub(super) size: u64,
}

/// The footer's description of a column.
pub(super) struct Leaf<'a> {
    pub(super) name: &'a str,
    /// Parquet's number of the physical type.
    pub(super) physical: i32,
    /// Parquet's number of the converted type, where the physical one says too little.
    pub(super) converted: Option<i32>,
    pub(super) cell: Cell,
}

/// The cell type of a column.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// One value.
    One,
    /// An optional value.
    Optional,
    /// Fixed-length bytes; the length.
    Bytes(usize),
    /// A fixed-length list; the number of values.
    List(usize),
}

impl Leaf<'_> {
    /// A column of a stream, or the stamp.
    pub(super) fn of(name: &str, element: Element, elements: usize) -> Leaf<'_> {
        const FIXED_LENGTH_BYTES: i32 = 7;
        let (physical, converted) = types(element);
        let (physical, converted, cell) = match (element, elements) {
            (_, 1) => (physical, converted, Cell::One),
            // As integers, bytes would take four times the space.
            (one, _) if one.size() == 1 && one.room().is_none() => (FIXED_LENGTH_BYTES, None, Cell::Bytes(elements)),
            _ => (physical, converted, Cell::List(elements)),
        };
        Leaf {
            name,
            physical,
            converted,
            cell,
        }
    }

    /// The number of values in a row.
    pub(super) fn values(&self) -> u64 {
        match self.cell {
            Cell::List(elements) => elements as u64,
            _ => 1,
        }
    }

    /// The path of the values, from the root of the schema.
    pub(super) fn path(&self) -> Vec<&str> {
        match self.cell {
            Cell::List(_) => vec![self.name, "list", "element"],
            _ => vec![self.name],
        }
    }

    /// The entries of the schema.
    pub(super) fn schema(&self) -> Vec<Struct> {
        const REQUIRED: i32 = 0;
        const OPTIONAL: i32 = 1;
        const REPEATED: i32 = 2;
        const LIST: i32 = 3;
        let mut entries = Vec::new();
        let name = if let Cell::List(_) = self.cell {
            let (mut outer, mut inner) = (Struct::default(), Struct::default());
            outer.i32(3, REQUIRED).text(4, self.name).i32(5, 1).i32(6, LIST);
            inner.i32(3, REPEATED).text(4, "list").i32(5, 1);
            entries.extend([outer, inner]);
            "element"
        } else {
            self.name
        };
        let mut described = Struct::default();
        described.i32(1, self.physical);
        if let Cell::Bytes(length) = self.cell {
            described.i32(2, length as i32);
        }
        let optional = self.cell == Cell::Optional;
        described
            .i32(3, if optional { OPTIONAL } else { REQUIRED })
            .text(4, name);
        if let Some(converted) = self.converted {
            described.i32(6, converted);
        }
        entries.push(described);
        entries
    }
}

/// Parquet's number of truth values.
pub(super) const BOOLEAN: i32 = 0;

/// Parquet's number of a physical type, and of the converted type where the physical one says too little.
fn types(element: Element) -> (i32, Option<i32>) {
    match element {
        Element::I32 => (1, None),
        Element::U32 => (1, Some(13)),
        Element::U8 => (1, Some(11)),
        Element::I64 => (2, None),
        Element::U64 => (2, Some(14)),
        Element::I16 => (1, Some(16)),
        Element::U16 => (1, Some(12)),
        Element::I8 => (1, Some(15)),
        Element::F32 => (4, None),
        Element::F64 => (5, None),
        Element::Bool => (BOOLEAN, None),
        // Enumerations are stored as texts: their names.
        Element::Enum | Element::Text(_) => (6, Some(0)),
        Element::Bytes(_) => (6, None),
    }
}

/// The footer: schema, page offsets, metadata.
pub(super) fn describe(
    name: &str,
    leaves: &[Leaf<'_>],
    groups: &[(u64, Vec<Chunk>)],
    metadata: &[(&str, String)],
) -> Vec<u8> {
    let mut schema = vec![{
        let mut root = Struct::default();
        root.text(4, name).i32(5, leaves.len() as i32);
        root
    }];
    schema.extend(leaves.iter().flat_map(Leaf::schema));
    let row_groups = groups.iter().map(|(rows, chunks)| {
        let placed = chunks.iter().zip(leaves).map(|(chunk, leaf)| {
            let mut meta = Struct::default();
            meta.i32(1, leaf.physical)
                .i32_list(2, &[0, 3])
                .text_list(3, &leaf.path())
                .i32(4, 0)
                .i64(5, (*rows * leaf.values()) as i64)
                .i64(6, chunk.size as i64)
                .i64(7, chunk.size as i64)
                .i64(9, chunk.offset as i64);
            let mut placed = Struct::default();
            placed.i64(2, chunk.offset as i64).structure(3, meta);
            placed
        });
        let mut group = Struct::default();
        group.structures(1, placed.collect());
        group
            .i64(2, chunks.iter().map(|c| c.size as i64).sum())
            .i64(3, *rows as i64);
        group
    });
    let metadata = metadata.iter().map(|(key, value)| {
        let mut entry = Struct::default();
        entry.text(1, key).text(2, value);
        entry
    });
    let mut file = Struct::default();
    file.i32(1, 2);
    file.structures(2, schema);
    file.i64(3, groups.iter().map(|(rows, _)| *rows as i64).sum());
    file.structures(4, row_groups.collect());
    file.structures(5, metadata.collect());
    file.text(6, concat!("escapement ", env!("CARGO_PKG_VERSION")));
    file.end()
}
