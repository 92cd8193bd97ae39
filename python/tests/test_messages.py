"""Messages: layout, values, and rejected input."""

import enum
import pickle

import numpy as np
import pytest

import escapement as esc


class Pose(esc.Message):
    p_NB_N = esc.Field("m", frame="N", shape=3)
    R_NB = esc.Field("1", shape=(3, 3))
    count = esc.Field("1", element="u64")
    small = esc.Field("1", element="f32", shape=2)


def test_message_describes_itself_as_the_wire_wants_it():
    assert Pose.dtype.itemsize == 24 + 72 + 8 + 8
    assert [part["offset"] for part in Pose.descriptor["fields"]] == [0, 24, 96, 104]
    assert Pose.descriptor["fields"][0] == {
        "name": "p_NB_N", "element": "f64", "shape": [3], "unit": "m", "frame": "N", "offset": 0, "values": [],
    }
    assert esc.Message.of(Pose.descriptor).descriptor == Pose.descriptor


def test_values_are_written_into_memory_that_stays():
    pose = Pose(p_NB_N=[1, 2, 3], count=7)
    view = pose.p_NB_N
    pose.p_NB_N = (4.0, 5.0, 6.0)
    pose.p_NB_N[1] = 50.0
    assert view is pose.p_NB_N and list(view) == [4.0, 50.0, 6.0]
    pose.R_NB = np.eye(3)
    assert pose.array["R_NB"][2, 2] == 1.0 and pose.count == 7 and pose["count"] == 7
    pose.small = 0.5
    assert pose.small.tolist() == [0.5, 0.5]
    assert np.frombuffer(bytes(pose), Pose.dtype)[0] == pose.array
    again = pickle.loads(pickle.dumps(pose))
    assert again == pose and again is not pose


class Said(esc.Message):
    count = esc.Field(element="u32")
    frame = esc.Field(element="bytes[6]")
    phase = esc.Field(element="text[8]")
    names = esc.Field(element="text[4]", shape=2)
    padding = esc.Field(element="u8", shape=2)


def test_texts_and_bytes_are_fields():
    assert Said.dtype.itemsize == 32
    assert [part["element"] for part in Said.descriptor["fields"]] == ["u32", {"bytes": 6}, {"text": 8}, {"text": 4}, "u8"]
    said = Said(phase="Höhe", frame=b"\1\0\xff", names=["a", "bcd"])
    assert (said.phase, said.frame, said.names, said["phase"]) == ("Höhe", b"\1\0\xff", ("a", "bcd"), "Höhe")
    assert bytes(said)[4:8] == b"\3\0\0\0" and bytes(said)[14:22] == "Höhe".encode().ljust(8, b"\0")
    said.phase = ""
    assert bytes(said)[14:22] == bytes(8)
    assert esc.Message.of(Said.descriptor).descriptor == Said.descriptor
    assert pickle.loads(pickle.dumps(said)) == said
    for key, value, words in [
        ("phase", "too long for it", "15 bytes, and there is room for 8"),
        ("phase", "a\0b", "zero"),
        ("phase", b"a", "takes a str"),
        ("frame", bytes(7), "7 bytes, and there is room for 6"),
        ("frame", "a", "takes bytes"),
        ("names", ["a"], "a list of 2"),
        ("names", ["a", "bcdef"], "5 bytes"),
    ]:
        with pytest.raises(esc.MessageError, match=words):
            setattr(said, key, value)
    with pytest.raises(esc.MessageError, match="no unit"):
        esc.Field("m", element="text[3]")
    with pytest.raises(esc.MessageError, match="no element type"):
        esc.Field(element="text[0]")


class Phase(enum.IntEnum):
    Idle = 0
    Spray = 4
    Dry = 250


class Report(esc.Message):
    level = esc.Field("m", element="u16")
    drift = esc.Field("1", element="i16")
    trim = esc.Field("1", element="i8", shape=2)
    phase = esc.Field(element=Phase)
    recent = esc.Field(element=Phase, shape=3)
    armed = esc.Field(element=bool)
    doors = esc.Field(element="bool", shape=3)


def test_named_values_truth_values_and_small_numbers_are_fields():
    assert Report.dtype.itemsize == 14
    phase = Report.descriptor["fields"][3]
    assert phase["values"] == [{"name": "Idle", "value": 0}, {"name": "Spray", "value": 4}, {"name": "Dry", "value": 250}]
    report = Report(level=65535, drift=-300, trim=[-128, 127], phase=Phase.Dry, armed=True, doors=[True, False, True])
    assert report.phase is Phase.Dry and report["phase"] is Phase.Dry and report.armed is True
    report.phase = "Spray"
    report.recent = [Phase.Dry, Phase.Idle, Phase.Spray]
    assert report.phase is Phase.Spray and report.recent.tolist() == [250, 0, 4]
    assert report.doors.dtype == bool and report.trim.tolist() == [-128, 127] and report.drift == -300
    other = esc.Message.of(Report.descriptor)
    assert other.descriptor == Report.descriptor
    again = other(phase="Dry")
    assert again.phase.name == "Dry" and again.phase == 250 and pickle.loads(pickle.dumps(report)) == report
    for value in (3, "Rinse"):
        with pytest.raises(esc.MessageError, match="`phase` of `Report` cannot be .*: it is one of Idle, Spray, Dry"):
            report.phase = value
    with pytest.raises(esc.MessageError, match="no value 0"):
        esc.Field(element=enum.IntEnum("Bad", [("one", 1)]))
    with pytest.raises(esc.MessageError, match="no unit"):
        esc.Field("m", element=bool)


@pytest.mark.parametrize(
    "what, said",
    [
        (lambda pose: setattr(pose, "p_NB_N", [1, 2]), r"`p_NB_N` of `Pose` has the shape \(3,\), and a value of the shape \(2,\)"),
        (lambda pose: setattr(pose, "p_NB_N", "here"), "`p_NB_N` of `Pose` cannot be"),
        (lambda pose: setattr(pose, "count", -1), "`count` of `Pose` cannot be -1"),
        (lambda pose: setattr(pose, "count", 0.5), "`count` of `Pose` cannot be 0.5"),
        (lambda pose: setattr(pose, "count", 10**400), "`count` of `Pose` cannot be 1000"),
        (lambda pose: setattr(pose, "count", [1, 2]), r"`count` of `Pose` has the shape \(\), and a value of the shape \(2,\)"),
        (lambda pose: Pose(speed=1), "has no field `speed`; it has `p_NB_N`"),
    ],
)
def test_wrong_values_are_refused_with_field_and_value(what, said):
    with pytest.raises(esc.MessageError, match=said):
        what(Pose())


def test_misspelt_field_is_refused_with_the_fields_there_are():
    fields = "`p_NB_N`, `R_NB`, `count`, `small`"
    for wrong in ("cuont", "_count", "array", "fields"):
        with pytest.raises(AttributeError, match=f"`Pose` has no field `{wrong}`; it has {fields}"):
            setattr(Pose(), wrong, 1)

    class Shown(Pose):
        """A message may have properties of its own."""

        @property
        def half(self):
            return self.count / 2

        @half.setter
        def half(self, value):
            self.count = 2 * value

    shown = Shown()
    shown.half = 3
    assert (shown.count, shown.half) == (6, 3.0)


def test_layouts_that_cannot_be_are_refused():
    with pytest.raises(esc.MessageError, match="put larger elements first"):
        type("Bad", (esc.Message,), {"a": esc.Field(element="u8"), "b": esc.Field()})
    with pytest.raises(esc.MessageError, match="padding"):
        type("Bad", (esc.Message,), {"a": esc.Field(), "b": esc.Field(element="u8")})
    with pytest.raises(esc.MessageError, match="no fields"):
        type("Bad", (esc.Message,), {})
    with pytest.raises(esc.MessageError, match="element type 'f16'"):
        esc.Field(element="f16")
    with pytest.raises(esc.MessageError, match="positive"):
        esc.Field(shape=(3, 0))
