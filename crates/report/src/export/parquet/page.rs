//! Page headers and levels, which precede the values of a page.

use super::footer::Cell;
use super::thrift::Struct;
use crate::export::varint::varint;

/// For lists: repetition levels, 0 at the start of each list; and definition levels, which mark every element as present.
pub(super) fn levels(cell: Cell, rows: u64) -> Vec<u8> {
    let Cell::List(elements) = cell else {
        return Vec::new();
    };
    let run = |out: &mut Vec<u8>, count: u64, level: u8| {
        varint(out, count << 1);
        out.push(level);
    };
    let (mut begins, mut there) = (Vec::new(), Vec::new());
    for _ in 0..rows {
        run(&mut begins, 1, 0);
        run(&mut begins, elements as u64 - 1, 1);
    }
    run(&mut there, rows * elements as u64, 1);
    let mut levels = Vec::new();
    for part in [begins, there] {
        levels.extend((part.len() as u32).to_le_bytes());
        levels.extend(part);
    }
    levels
}

pub(super) fn page_header(bytes: usize, values: u64) -> Vec<u8> {
    const PLAIN: i32 = 0;
    const RUN_LENGTH: i32 = 3;
    let mut page = Struct::default();
    page.i32(1, 0).i32(2, bytes as i32).i32(3, bytes as i32);
    let mut data = Struct::default();
    data.i32(1, values as i32)
        .i32(2, PLAIN)
        .i32(3, RUN_LENGTH)
        .i32(4, RUN_LENGTH);
    page.structure(5, data);
    page.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list_levels_are_two_runs_per_row() {
        assert!(levels(Cell::One, 7).is_empty());
        // Two lists of 300: a start and 299 further elements each; 600 elements present.
        let begins = [2, 0, 0xd6, 0x04, 1, 2, 0, 0xd6, 0x04, 1];
        let there = [0xb0, 0x09, 1];
        let expected = [&[10, 0, 0, 0][..], &begins, &[3, 0, 0, 0], &there].concat();
        assert_eq!(levels(Cell::List(300), 2), expected);
    }
}
