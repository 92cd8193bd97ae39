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


def test_message_has_the_descriptor_of_the_wire():
    assert Pose.dtype.itemsize == 24 + 72 + 8 + 8
    assert [part["offset"] for part in Pose.descriptor["fields"]] == [0, 24, 96, 104]
    assert Pose.descriptor["fields"][0] == {
        "name": "p_NB_N", "element": "f64", "shape": [3], "unit": "m", "frame": "N", "offset": 0, "values": [],
    }
    assert esc.Message.of(Pose.descriptor).descriptor == Pose.descriptor


def test_values_are_written_in_place():
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


class Texts(esc.Message):
    count = esc.Field(element="u32")
    frame = esc.Field(element="bytes[6]")
    phase = esc.Field(element="text[8]")
    names = esc.Field(element="text[4]", shape=2)
    padding = esc.Field(element="u8", shape=2)


def test_texts_and_bytes_are_fields():
    assert Texts.dtype.itemsize == 32
    assert [part["element"] for part in Texts.descriptor["fields"]] == ["u32", {"bytes": 6}, {"text": 8}, {"text": 4}, "u8"]
    message = Texts(phase="Höhe", frame=b"\1\0\xff", names=["a", "bcd"])
    assert (message.phase, message.frame, message.names, message["phase"]) == ("Höhe", b"\1\0\xff", ("a", "bcd"), "Höhe")
    assert bytes(message)[4:8] == b"\3\0\0\0" and bytes(message)[14:22] == "Höhe".encode().ljust(8, b"\0")
    message.phase = ""
    assert bytes(message)[14:22] == bytes(8)
    assert esc.Message.of(Texts.descriptor).descriptor == Texts.descriptor
    assert pickle.loads(pickle.dumps(message)) == message
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
            setattr(message, key, value)
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
    "what, message",
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
def test_wrong_values_are_refused_with_field_and_value(what, message):
    with pytest.raises(esc.MessageError, match=message):
        what(Pose())


def test_misspelt_field_is_refused_with_existing_fields():
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


class Whole(esc.Message):
    u64 = esc.Field(element="u64", shape=2)
    i64 = esc.Field(element="i64", shape=2)
    i32 = esc.Field(element="i32", shape=2)
    real = esc.Field(shape=2)
    u8 = esc.Field(element="u8", shape=(2, 2))
    modes = esc.Field(element=Phase, shape=4)


@pytest.mark.parametrize(
    "field, value, message",
    [
        ("u8", [[0, 300], [1, 2]], "it takes whole numbers from 0 to 255, and its element 0, 1 is 300"),
        ("u8", [[0, 1], [-1, 2]], "its element 1, 0 is -1"),
        ("u8", 256, "and it is 256"),
        ("u8", np.full((2, 2), 256), "its element 0, 0 is 256"),
        ("i32", [1.7, 2.9], "whole numbers from -2147483648 to 2147483647, and its element 0 is 1.7"),
        ("i32", [1, float("nan")], "its element 1 is nan"),
        ("i32", np.array([1.0, np.nan]), "its element 1 is nan"),
        ("i32", np.array([1.0, np.inf], np.float16), "its element 1 is inf"),
        ("i32", [1, 2**31], "its element 1 is 2147483648"),
        ("i32", np.array([0, 2**31], np.float32), "its element 1 is 2147483648"),
        ("i32", [1, 1j], r"numbers without an imaginary part, and its element 1 is 1j"),
        ("i64", np.array([0.0, 2.0**63]), "its element 1 is 9.2"),
        ("i64", np.array([0, 2**63], np.uint64), "its element 1 is 9223372036854775808"),
        ("u64", np.array([0, -1]), "its element 1 is -1"),
        ("u64", [0, 2**64], "its element 1 is 18446744073709551616"),
        ("real", np.array([0, 1j]), "numbers without an imaginary part"),
        ("i32", ["1", "2"], "it takes numbers"),
        ("real", ["1", "2"], "it takes numbers"),
        ("i32", [None, 1], "cannot be"),
        ("modes", [0, 1, 4, 250], "it is one of Idle, Spray, Dry"),
        ("modes", np.array([0, 3, 4, 250], np.uint8), "it is one of Idle, Spray, Dry"),
        ("modes", ["Idle", "Rinse", "Dry", "Dry"], "it is one of Idle, Spray, Dry"),
    ],
)
def test_elements_that_numpy_would_change_are_refused(field, value, message):
    whole = Whole()
    with pytest.raises(esc.MessageError, match=f"`{field}` of `Whole` cannot be .*") as caught:
        setattr(whole, field, value)
    assert message in str(caught.value)
    assert not any(bytes(whole))


@pytest.mark.filterwarnings("error")
def test_elements_that_can_be_represented_are_accepted():
    whole = Whole()
    for field, value, kept in [
        ("u8", [[0, 255], [1.0, True]], [[0, 255], [1, 1]]),
        ("u8", np.float32(7), [[7, 7], [7, 7]]),
        ("i32", np.array([-(2.0**31), 2.0**31 - 1]), [-(2**31), 2**31 - 1]),
        ("i32", np.array([1 + 0j, -2]), [1, -2]),
        ("i32", np.array([3.0, -4.0], np.float16), [3, -4]),
        ("i64", [2**53 + 1, 1.0], [2**53 + 1, 1]),
        ("i64", np.array([-(2**63), 2**63 - 1]), [-(2**63), 2**63 - 1]),
        ("u64", [2**64 - 1, 0], [2**64 - 1, 0]),
        ("u64", np.array([2**53 + 1, 0], object), [2**53 + 1, 0]),
        ("real", np.array([1, 2], np.uint8), [1.0, 2.0]),
        ("modes", ["Dry", "Idle", "Spray", "Dry"], [250, 0, 4, 250]),
        ("modes", Phase.Spray, [4] * 4),
    ]:
        setattr(whole, field, value)
        assert getattr(whole, field).tolist() == kept


def test_invalid_layouts_are_refused():
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
