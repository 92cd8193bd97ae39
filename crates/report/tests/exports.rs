//! Exports of streams with names and shapes that other tools handle badly. `tests/exports` opens the same kinds of files with
//! the tools' own packages.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::Rational;
use report::export::{self, Compression};
use tape::{MemoryTape, Sink, StreamSpec};

/// A folder that goes with the test.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Scratch {
        let path = std::env::temp_dir().join(format!("exports-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }

    fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn files(folder: &Scratch) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(&folder.0).unwrap().map(Result::unwrap);
    let named = entries.map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        (name, fs::read(entry.path()).unwrap())
    });
    named.collect()
}

/// A stream `a.port` at 100 Hz of fields of the given names, types, shapes and units.
fn spec(port: &str, fields: &[(&str, Element, &[u32], &str)]) -> StreamSpec {
    let mut size = 0;
    let placed = fields.iter().map(|(name, element, shape, unit)| {
        let field = Field {
            name: (*name).to_owned(),
            element: *element,
            shape: shape.to_vec(),
            unit: (*unit).to_owned(),
            frame: String::new(),
            offset: size,
            values: Vec::new(),
        };
        size += (field.len() * element.size()) as u32;
        field
    });
    let fields = placed.collect();
    let descriptor = Descriptor {
        name: "Message".into(),
        size,
        fields,
    };
    StreamSpec::new("a", port, descriptor, Rational::ZERO, Rational::from_millis(10))
}

/// A tape of these streams with so many samples of each; bytes count up through the payloads.
fn tape(specs: Vec<StreamSpec>, samples: u64) -> MemoryTape {
    let mut tape = MemoryTape::new(specs.clone()).unwrap();
    for (stream, spec) in specs.iter().enumerate() {
        for index in 0..samples {
            let payload: Vec<u8> = (0..spec.descriptor.size)
                .map(|at| (u64::from(at) + index) as u8)
                .collect();
            tape.sample(stream, index, index as f64 / 100.0, &payload).unwrap();
        }
    }
    tape
}

fn header(files: &BTreeMap<String, Vec<u8>>, name: &str) -> String {
    let text = String::from_utf8(files[name].clone()).unwrap();
    text.lines().next().unwrap().to_owned()
}

#[test]
fn field_named_like_stamp_gets_separate_column() {
    let scalar = |name| (name, Element::F64, &[][..], "s");
    let taken = spec("taken", &[scalar("t"), scalar("t_2"), scalar("T")]);
    let pair = ("q", Element::F64, &[2][..], "rad");
    let spelled = spec(
        "spelled",
        &[("q[1]", Element::F64, &[], "rad"), pair, ("t", Element::F64, &[], "K")],
    );
    let (tape, folder) = (tape(vec![taken, spelled], 2), Scratch::new("stamp"));
    export::csv(&tape, &folder.0).unwrap();
    let files = files(&folder);
    assert_eq!(header(&files, "a.taken.csv"), "t [s],t_3 [s],t_2 [s],T [s]");
    assert_eq!(
        header(&files, "a.spelled.csv"),
        "t [s],q[1] [rad],q[0] [rad],q[1]_2 [rad],t [K]"
    );
}

#[test]
fn exports_omit_padding() {
    let filled = spec(
        "filled",
        &[
            ("x", Element::F64, &[], "m"),
            ("padding_2", Element::F32, &[], "1"),
            ("n", Element::U8, &[], "1"),
            ("padding", Element::U8, &[3], "1"),
        ],
    );
    let (tape, folder) = (tape(vec![filled], 2), Scratch::new("padding"));
    export::csv(&tape, &folder.0).unwrap();
    export::parquet(&tape, &folder.0, &[]).unwrap();
    export::mat(&tape, &folder.join("run.mat"), &[]).unwrap();
    export::mcap(&tape, &folder.join("run.mcap"), None, &[], Compression::None).unwrap();
    let files = files(&folder);
    assert_eq!(header(&files, "a.filled.csv"), "t [s],x [m],padding_2 [1],n [1]");
    // `padding_2` is a number with a meaning. Every format has its name, and no other name begins like it.
    for (name, bytes) in &files {
        let places = bytes.windows(7).enumerate().filter(|(_, part)| *part == b"padding");
        let named: Vec<usize> = places.map(|(at, _)| at).collect();
        assert!(!named.is_empty(), "{name}");
        for at in named {
            assert_eq!(&bytes[at + 7..at + 9], b"_2", "{name} at byte {at}");
        }
    }
    let variables = &files["run.mat"][128..];
    let stream = fields(elements(variables)[1].1);
    let named: Vec<&str> = stream.iter().map(|(name, _)| &**name).collect();
    assert_eq!(named, ["t", "x", "padding_2", "n", "info", "stream"]);
    // The byte before the padding, of both samples.
    assert_eq!(stream[3].1[3].1[..2], [12, 13]);
}

#[test]
fn picture_has_tape_size_in_every_export() {
    let picture = || ("rgb", Element::U8, &[48, 64, 3][..], "1");
    let camera = spec("camera", &[("exposure", Element::F64, &[], "s"), picture()]);
    let depth = spec("depth", &[("z", Element::F32, &[30, 40], "m")]);
    let bytes = (camera.stride() + depth.stride()) * 100;
    let (tape, folder) = (tape(vec![camera, depth], 100), Scratch::new("picture"));
    export::csv(&tape, &folder.0).unwrap();
    export::parquet(&tape, &folder.0, &[]).unwrap();
    export::mcap(&tape, &folder.join("run.mcap"), None, &[], Compression::None).unwrap();
    let files = files(&folder);
    for kind in [&["csv", "npy"][..], &["parquet"], &["mcap"]] {
        let mine = files
            .iter()
            .filter(|(name, _)| kind.iter().any(|end| name.ends_with(end)));
        let size: usize = mine.map(|(_, content)| content.len()).sum();
        assert!(
            size > bytes && size < bytes + bytes / 50,
            "{kind:?}: {size} bytes of a tape of {bytes}"
        );
    }
    assert_eq!(header(&files, "a.camera.csv"), "t [s],exposure [s]");
    assert_eq!(header(&files, "a.depth.csv"), "t [s]");
    let array = &files["a.camera.rgb.npy"];
    assert!(array.starts_with(b"\x93NUMPY\x01\x00"));
    let head = String::from_utf8_lossy(&array[10..128]);
    assert!(
        head.contains("{'descr': '|u1', 'fortran_order': False, 'shape': (100, 48, 64, 3), }") && head.ends_with('\n'),
        "{head}"
    );
    let first: Vec<u8> = (8..8 + 48 * 64 * 3).map(|at| at as u8).collect();
    assert_eq!(array[128..128 + first.len()], first);
    assert_eq!(array.len(), 128 + 100 * 48 * 64 * 3);
}

#[test]
fn arrays_with_equal_folded_names_are_separate_files() {
    let wide = |name| (name, Element::U8, &[300][..], "1");
    let fields = [wide("A b"), wide("a_b"), wide("a.b"), wide("a_b_2"), wide("../up")];
    let (tape, folder) = (tape(vec![spec("x", &fields)], 1), Scratch::new("fold"));
    export::csv(&tape, &folder.0).unwrap();
    let files = files(&folder);
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let expected = [
        "a.x.A_b.npy",
        "a.x.___up.npy",
        "a.x.a_b_2.npy",
        "a.x.a_b_3.npy",
        "a.x.a_b_4.npy",
        "a.x.csv",
    ];
    assert_eq!(names, expected);
}

#[test]
fn stream_without_samples_gives_table_without_rows() {
    let fields = [("x", Element::F64, &[][..], "m"), ("wide", Element::U32, &[500], "1")];
    let (tape, folder) = (tape(vec![spec("never", &fields)], 0), Scratch::new("empty"));
    export::csv(&tape, &folder.0).unwrap();
    export::parquet(&tape, &folder.0, &[]).unwrap();
    export::mcap(&tape, &folder.join("run.mcap"), None, &[], Compression::None).unwrap();
    let files = files(&folder);
    assert_eq!(files["a.never.csv"], b"t [s],x [m]\n");
    assert!(String::from_utf8_lossy(&files["a.never.wide.npy"]).contains("(0, 500)"));
    assert!(files["a.never.parquet"].ends_with(b"PAR1") && files["run.mcap"].ends_with(b"MCAP0\r\n"));
}

#[test]
fn protobuf_messages_state_json_names_of_fields() {
    let scalar = |name| (name, Element::F64, &[][..], "1");
    let fields = [
        scalar("q_1"),
        scalar("q1"),
        scalar("a b"),
        scalar("a_b"),
        scalar("AB"),
        scalar("1st"),
    ];
    let (tape, folder) = (tape(vec![spec("motor", &fields)], 1), Scratch::new("json"));
    export::mcap(&tape, &folder.join("run.mcap"), None, &[], Compression::None).unwrap();
    let file = fs::read(folder.join("run.mcap")).unwrap();
    let has = |part: &[u8]| file.windows(part.len()).any(|window| window == part);
    assert!(has(b"\x62\x06proto2"), "proto3 forbids fields of one name in JSON");
    for name in ["q_1", "q1", "a_b", "a_b_2", "AB", "_1st"] {
        // Tag and length of `name`, and of `json_name`.
        for tag in [0x0a, 0x52] {
            assert!(has(&[&[tag, name.len() as u8], name.as_bytes()].concat()), "{name}");
        }
    }
    assert!(
        has(b"\x0b\x00\x00\x00field.a_b_2\x03\x00\x00\x00a b"),
        "the channel has the field's own name"
    );
}

#[test]
fn failed_export_leaves_no_file() {
    let fields = [("x", Element::F64, &[][..], "m"), ("wide", Element::U8, &[500], "1")];
    let (tape, folder) = (tape(vec![spec("x", &fields)], 1), Scratch::new("failed"));
    // The array's name is taken by a folder, so that the array cannot get it; the table before it is complete.
    fs::create_dir(folder.join("a.x.wide.npy")).unwrap();
    let error = export::csv(&tape, &folder.0).unwrap_err().to_string();
    assert!(error.contains("a.x.wide.npy: cannot name the file"), "{error}");
    let left = fs::read_dir(&folder.0).unwrap().map(|entry| entry.unwrap().file_name());
    let mut left: Vec<_> = left.collect();
    left.sort();
    assert_eq!(left, ["a.x.csv", "a.x.wide.npy"]);
}

/// Elements of a MAT file: their types and contents.
type Elements<'a> = Vec<(u32, &'a [u8])>;

/// The elements in `bytes`.
fn elements(mut bytes: &[u8]) -> Elements<'_> {
    let mut all = Vec::new();
    let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    while !bytes.is_empty() {
        let (kind, length) = (word(bytes, 0), word(bytes, 4) as usize);
        if kind >> 16 > 0 {
            // The short form: type and length in one word, with what they are of behind it.
            all.push((kind & 0xffff, &bytes[4..4 + (kind >> 16) as usize]));
            bytes = &bytes[8..];
            continue;
        }
        all.push((kind, &bytes[8..8 + length]));
        bytes = &bytes[8 + length.next_multiple_of(8)..];
    }
    all
}

/// The fields of the struct in the element `matrix`: names and elements.
fn fields(matrix: &[u8]) -> Vec<(String, Elements<'_>)> {
    let parts = elements(matrix);
    let room = u32::from_le_bytes(parts[3].1.try_into().unwrap()) as usize;
    let names = parts[4].1.chunks(room);
    let names = names.map(|name| String::from_utf8(name.split(|byte| *byte == 0).next().unwrap().to_vec()).unwrap());
    names
        .zip(parts[5..].iter().map(|(_, matrix)| elements(matrix)))
        .collect()
}

#[test]
fn mat_file_has_column_major_struct_per_stream() {
    use Element::{F64, I32, U8};
    let folder = Scratch::new("mat");
    let path = folder.join("run.mat");
    let long = "x".repeat(70);
    let odd = [
        ("t", F64, &[][..], "s"),
        ("end", F64, &[], "m"),
        ("9 °", F64, &[], "m"),
        (&long, F64, &[], "m"),
        (&(long.clone() + "y"), F64, &[], ""),
    ];
    let specs = vec![
        spec("values", &[("m", I32, &[2, 3], "m"), ("wide", U8, &[4, 100], "1")]),
        spec("odd-names", &odd),
        spec("odd_names", &[("x", F64, &[], "m")]),
    ];
    let tape = tape(specs, 5);
    export::mat(&tape, &path, &[("title", "Ä title 🛰".into())]).unwrap();
    let bytes = fs::read(&path).unwrap();
    assert!(bytes.starts_with(b"MATLAB 5.0 MAT-file") && &bytes[124..128] == b"\0\x01IM");
    let variables = elements(&bytes[128..]);
    let names: Vec<&[u8]> = variables.iter().map(|(_, matrix)| elements(matrix)[2].1).collect();
    assert_eq!(
        names,
        [&b"escapement"[..], b"a_values", b"a_odd_names", b"a_odd_names_2"]
    );
    let text = &fields(variables[0].1)[0].1;
    let units: Vec<u16> = text[3]
        .1
        .chunks(2)
        .map(|unit| u16::from_le_bytes(unit.try_into().unwrap()))
        .collect();
    assert_eq!(String::from_utf16(&units).unwrap(), "Ä title \u{fffd}");
    let values = fields(variables[1].1);
    let named: Vec<&str> = values.iter().map(|(name, _)| &**name).collect();
    assert_eq!(named, ["t", "m", "wide", "info", "stream"]);
    let extents = |parts: &[(u32, &[u8])]| -> Vec<u8> { parts[1].1.iter().copied().step_by(4).collect() };
    assert_eq!(extents(&values[1].1), [5, 2, 3]);
    // 400 goes beyond a byte.
    assert_eq!(values[2].1[1].1.len(), 12);
    let payload = |at: usize, sample: usize| (at + sample) as u8;
    // Element (i, j) of sample k is at k + 5 (i + 2 j), and 4 bytes each.
    for (k, i, j) in (0..5).flat_map(|k| (0..2).flat_map(move |i| (0..3).map(move |j| (k, i, j)))) {
        let at = 4 * (k + 5 * (i + 2 * j));
        assert_eq!(values[1].1[3].1[at], payload(4 * (3 * i + j), k), "{k} {i} {j}");
    }
    // And element (i, j) of a wide one at i + 4 j + 400 k.
    for (k, i, j) in (0..5).flat_map(|k| (0..4).flat_map(move |i| (0..100).map(move |j| (k, i, j)))) {
        assert_eq!(
            values[2].1[3].1[i + 4 * j + 400 * k],
            payload(24 + 100 * i + j, k),
            "{k} {i} {j}"
        );
    }
    let odd: Vec<String> = fields(variables[2].1).into_iter().map(|(name, _)| name).collect();
    let cut = |room: usize| "x".repeat(room);
    assert_eq!(
        odd,
        [
            "t",
            "t_2",
            "xend",
            "x9__",
            &cut(63),
            &(cut(61) + "_2"),
            "info",
            "stream"
        ]
    );
}

#[test]
fn stream_too_large_for_mat_file_is_refused() {
    /// A tape whose samples are never read.
    struct Long(Vec<StreamSpec>);
    impl tape::Source for Long {
        fn streams(&self) -> &[StreamSpec] {
            &self.0
        }
        fn count(&self, _: usize) -> u64 {
            300_000_000
        }
        fn read(&self, _: usize, _: u64, _: &mut [u8]) -> Result<(), tape::ReadError> {
            unreachable!("it is refused before")
        }
    }
    let folder = Scratch::new("mat-large");
    let long = Long(vec![spec("x", &[("x", Element::F64, &[], "m")])]);
    let refused = export::mat(&long, &folder.join("run.mat"), &[])
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("`a.x`") && refused.contains("48000") && refused.contains("--until"),
        "{refused}"
    );
    assert!(files(&folder).is_empty());
}
