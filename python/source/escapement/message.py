"""Messages: the data exchanged by participants, as classes over numpy memory."""

import enum
import operator
import re

import numpy as np

from .errors import MessageError

# The element types of payloads, with their numpy and `memoryview` names.
ELEMENTS = {
    "f64": ("<f8", "d"),
    "f32": ("<f4", "f"),
    "i64": ("<i8", "q"),
    "i32": ("<i4", "i"),
    "u64": ("<u8", "Q"),
    "u32": ("<u4", "I"),
    "u8": ("|u1", "B"),
    "i8": ("|i1", "b"),
    "i16": ("<i2", "h"),
    "u16": ("<u2", "H"),
    "bool": ("|b1", "?"),
    "enum": ("|u1", "B"),
}
# A text or bytes with their capacity: `text[64]`, `bytes[256]`.
_CONTENT = re.compile(r"(text|bytes)\[([1-9][0-9]{0,6})\]")
# The separator between the names of values in a text.
_SEPARATORS = "|,="


def _values(cls):
    """The values of an enumeration in the form used by descriptors."""
    values = [{"name": member.name, "value": int(member)} for member in cls]
    for one in values:
        if not 0 <= one["value"] <= 255 or any(mark in one["name"] for mark in _SEPARATORS):
            raise MessageError(f"`{cls.__name__}.{one['name']}` cannot be {one['value']}: an enumeration has names for bytes, 0 to 255")
    if all(one["value"] for one in values):
        raise MessageError(f"`{cls.__name__}` has no value 0, which an input shows before its first sample: name it")
    return values


class Field:
    """A field of a message: its unit, the frame of a vector, its shape (`()`, `3`, `(3, 3)`) and its element type: `"f64"`, …, `"i8"`,
    `"bool"` or `bool`, or a class of `enum.IntEnum` with a value 0, whose members are the values of one byte; `"text[64]"` is a `str` of at
    most 64 bytes of UTF-8, `"bytes[256]"` a `bytes` of at most 256."""

    __slots__ = ("unit", "frame", "shape", "element", "values", "room")

    def __init__(self, unit="1", frame="", shape=(), element="f64"):
        self.values, self.room = None, 0
        content = _CONTENT.fullmatch(element) if isinstance(element, str) else None
        if content:
            self.room = int(content[2])
        elif element is bool:
            element = "bool"
        elif isinstance(element, type) and issubclass(element, enum.IntEnum):
            _values(element)
            element, self.values = "enum", element
        elif element == "enum":
            raise MessageError("an enumeration is declared with its class: element=Mode, with class Mode(enum.IntEnum)")
        if (content or element in ("bool", "enum")) and str(unit) != "1":
            raise MessageError(f"a bool, an enumeration, a text and bytes have no unit, and {unit!r} was given")
        if not content and element not in ELEMENTS:
            raise MessageError(f"there is no element type {element!r}; there is {', '.join(ELEMENTS)}, text[ROOM], bytes[ROOM]")
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        if not all(isinstance(extent, int) and extent > 0 for extent in shape):
            raise MessageError(f"the shape {shape} has something else than positive whole numbers in it")
        self.unit, self.frame, self.shape, self.element = str(unit), str(frame), shape, element

    def __repr__(self):
        return f"Field({self.unit!r}, frame={self.frame!r}, shape={self.shape}, element={self.element!r})"

    def __eq__(self, other):
        return isinstance(other, Field) and all(
            getattr(self, part) == getattr(other, part) for part in Field.__slots__
        )

    __hash__ = None


def _type_of(element):
    """The numpy type of an element."""
    content = _CONTENT.fullmatch(element)
    if not content:
        return np.dtype(ELEMENTS[element][0])
    room = int(content[2])
    return np.dtype(f"S{room}") if content[1] == "text" else np.dtype([("length", "<u4"), ("data", "|u1", (room,))])


def _read(value):
    """The `str` or `bytes` of an element of numpy."""
    return value.decode() if isinstance(value, bytes) else value["data"][: int(value["length"])].tobytes()


def _written(message, name, field, value):
    """The element of numpy for a `str` or `bytes`: all of it, or an error."""
    text = field.element.startswith("text")
    if not isinstance(value, str if text else (bytes, bytearray, memoryview)):
        raise _refused(message, name, value, f"it is {field.element}, which takes {'a str' if text else 'bytes'}")
    content = value.encode() if text else bytes(value)
    if len(content) > field.room:
        raise _refused(message, name, value, f"it has {len(content)} bytes, and there is room for {field.room}")
    if not text:
        return (len(content), np.frombuffer(content.ljust(field.room, b"\0"), np.uint8))
    if b"\0" in content:
        raise _refused(message, name, value, "there is a zero in it, which ends a text")
    return content


def _content(name, field):
    """The property of a text or bytes field: a `str` or `bytes`; for several elements a tuple of them."""

    def get(message):
        value = message.array[name]
        return tuple(_read(one) for one in value.reshape(-1)) if field.shape else _read(value[()])

    def put(message, value):
        if field.shape:
            count = int(np.prod(field.shape))
            if isinstance(value, (str, bytes)) or len(value) != count:
                raise _refused(message, name, value, f"it takes a list of {count}")
            value = np.array([_written(message, name, field, one) for one in value], _type_of(field.element)).reshape(field.shape)
        else:
            value = _written(message, name, field, value)
        try:
            message.array[name] = value
        except ValueError as error:
            raise _refused(message, name, value, error) from None

    return property(get, put)


def _member(cls, name, value):
    """The member of an enumeration that `value` is: itself, its name or its number."""
    try:
        return cls[value] if isinstance(value, str) else cls(value)
    except (KeyError, ValueError):
        known = ", ".join(member.name for member in cls)
        raise MessageError(f"`{name}` cannot be {value!r}: it is one of {known}") from None


def _named(name, view, at, cls):
    """The property of an enumeration: a member of its class. It can also be set by name."""
    members = {int(member): member for member in cls}

    def get(message):
        return members[getattr(message, view)[at]]

    def put(message, value):
        try:
            getattr(message, view)[at] = _member(cls, name, value)
        except TypeError as error:
            raise _refused(message, name, value, error) from None

    return property(get, put)


def _property(name, view, at, field):
    if field.room:
        return _content(name, field)
    if field.shape:
        return _array(name, view, field.shape)
    return _named(name, view, at, field.values) if field.values else _scalar(name, view, at)


def _scalar(name, view, at):
    """The property of a field with one element: a Python number, read from and written to the memory."""

    # Both are on the hot path of every step, so their constants are bound into them.
    made = {}
    exec(f"def get(message):\n    return message.{view}[{at}]\ndef fill(message, value):\n    message.{view}[{at}] = value", made)
    fill = made["fill"]

    def put(message, value):
        try:
            fill(message, value)
        except (TypeError, ValueError) as error:
            raise _refused(message, name, value, error) from None

    return property(made["get"], put)


def _array(name, view, shape):
    """The property of a field with several elements: a numpy view that is created once. An assigned value is copied into it."""

    def put(message, value):
        if type(value) is not np.ndarray:
            value = np.asarray(value)
        if value.shape != shape and value.shape:
            raise MessageError(
                f"`{name}` of `{type(message).__name__}` has the shape {shape}, and a value of the shape {value.shape} was given"
            )
        try:
            getattr(message, view)[...] = value
        except (TypeError, ValueError) as error:
            raise _refused(message, name, value, error) from None

    return property(operator.attrgetter(view), put)


def _refused(message, name, value, error):
    kind = type(message).__name__
    if message._bytes_view.readonly:
        return MessageError(f"`{name}` of `{kind}` belongs to an input, which is read only: write to an output")
    return MessageError(f"`{name}` of `{kind}` cannot be {value!r}: {error}")


class Message:
    """The base of messages. A subclass lists its fields in their order:

        class Motion(esc.Message):
            position = esc.Field("m", frame="N", shape=3)
            speed = esc.Field("m/s")

    `Motion()` is a message of zeros, `Motion(speed=2.0)` one with a value. A field of one element reads as a number, a field with a shape
    as a numpy view of the message's memory. Class attributes: `fields`, `dtype` (the payload as a numpy type), `descriptor`.
    """

    fields = {}
    dtype = np.dtype([])
    descriptor = {"name": "Message", "size": 0, "fields": []}
    _views = ()

    def __init_subclass__(cls, name=None, **others):
        super().__init_subclass__(**others)
        if "_esc_described" in vars(cls):
            return
        own = {key: value for key, value in vars(cls).items() if isinstance(value, Field)}
        if not own:
            if not cls.fields:
                raise MessageError(f"`{cls.__name__}` has no fields: write such as position = esc.Field(\"m\")")
            return
        if cls.fields:
            raise MessageError(f"`{cls.__name__}`: a message cannot add fields to another one")
        cls._lay_out(name or cls.__name__, own)

    @classmethod
    def _lay_out(cls, name, own):
        taken = [key for key in own if key in ("fields", "dtype", "descriptor", "array") or key.startswith("_")]
        if taken:
            raise MessageError(f"`{cls.__name__}`: a field cannot be called `{taken[0]}`; make the message with `Message.of`")
        cls._describe(name, [(key, field) for key, field in own.items()])
        for view, key, at, field in cls._places:
            setattr(cls, key, _property(key, view, at, field))

    @classmethod
    def _describe(cls, name, own):
        """Sets the layout: plain old data in C order without padding."""
        offset, described, places = 0, [], []
        largest = max(1 if field.room else _type_of(field.element).itemsize for _, field in own)
        for number, (key, field) in enumerate(own):
            letter = "" if field.room else ELEMENTS[field.element][1]
            size = _type_of(field.element).itemsize
            if not field.room and offset % size:
                raise MessageError(
                    f"`{name}`: `{key}` would start at byte {offset}, which is no multiple of its element's {size}: put larger elements first"
                )
            described.append(
                {
                    "name": key,
                    "element": {field.element.split("[")[0]: field.room} if field.room else field.element,
                    "shape": list(field.shape),
                    "unit": field.unit,
                    "frame": field.frame,
                    "offset": offset,
                    "values": _values(field.values) if field.values else [],
                }
            )
            view = f"_field_{number}" if field.shape or field.room else f"_scalars_{'truth' if letter == '?' else letter}"
            places.append((view, key, offset // size, field))
            offset += size * int(np.prod(field.shape, dtype=int))
        if offset % largest:
            raise MessageError(f"`{name}` has {offset} bytes, which is no multiple of {largest}: add a field of padding at the end")
        cls.fields = dict(own)
        cls.descriptor = {"name": name, "size": offset, "fields": described}
        cls.dtype = dtype_of(cls.descriptor)
        cls._places = places

    @classmethod
    def of(cls, descriptor):
        """The message class for `descriptor`, as returned by `Scenario.check`. Fields whose names are not Python identifiers are read
        with `message["name"]`."""
        made = type(str(descriptor["name"]), (Message,), {"_esc_described": True})
        own = [
            (part["name"], Field(part["unit"], part.get("frame", ""), tuple(part["shape"]), element_of(part)))
            for part in descriptor["fields"]
        ]
        made._describe(descriptor["name"], own)
        for view, key, at, field in made._places:
            if key.isidentifier() and key not in ("fields", "dtype", "descriptor", "array") and not key.startswith("_"):
                setattr(made, key, _property(key, view, at, field))
        return made

    def __init__(self, **values):
        self._open(False)
        for key, value in values.items():
            if key not in self.fields:
                known = ", ".join(f"`{name}`" for name in self.fields)
                raise MessageError(f"`{type(self).__name__}` has no field `{key}`; it has {known}")
            self[key] = value

    def _open(self, read_only):
        """Allocates the memory, and creates each view of it once. Views of an input are read-only."""
        size = self.dtype.itemsize
        # Casts need whole elements of every type.
        self._memory = np.zeros(-(-size // 8) * 8, np.uint8)
        array = self._memory[:size].view(self.dtype)[0:1].reshape(())
        view = memoryview(self._memory)
        if read_only:
            array.flags.writeable = False
            view = view.toreadonly()
        #: The whole payload as a structured array without dimensions.
        self.array = array
        self._bytes_view = view
        for name, key, _, field in self._places:
            if field.room:
                continue
            if field.shape:
                setattr(self, name, array[key])
            elif not hasattr(self, name):
                setattr(self, name, view.cast(ELEMENTS[field.element][1]))

    def __getitem__(self, key):
        if key not in self.fields:
            raise KeyError(key)
        value, field = self.array[key], self.fields[key]
        if field.room:
            return _content(key, field).fget(self)
        if field.shape:
            return value
        return field.values(value.item()) if field.values else value.item()

    def __setitem__(self, key, value):
        for view, name, at, field in self._places:
            if name == key:
                _property(key, view, at, field).fset(self, value)
                return
        raise KeyError(key)

    def _memory_of(self, key):
        """The memory of a field as an array, also for a field of one element."""
        return self.array.reshape(1)[key][0:1] if not self.fields[key].shape else self.array[key]

    def _set_bytes(self, payload):
        self._memory[: len(payload)] = np.frombuffer(payload, np.uint8)

    def __bytes__(self):
        return self._memory[: self.dtype.itemsize].tobytes()

    def __repr__(self):
        values = ", ".join(f"{key}={self[key]!r}" for key in self.fields)
        return f"{type(self).__name__}({values})"

    def __eq__(self, other):
        return isinstance(other, Message) and self.descriptor == other.descriptor and bytes(self) == bytes(other)

    __hash__ = None

    def __reduce__(self):
        return _again, (type(self), bytes(self))


def _again(cls, payload):
    message = cls()
    message._set_bytes(payload)
    return message


def element_of(part):
    """The `Field` element of a described field: its type, or a class with the values of an enumeration."""
    if isinstance(part["element"], dict):
        return "".join(f"{kind}[{room}]" for kind, room in part["element"].items())
    if part["element"] != "enum":
        return part["element"]
    return enum.IntEnum(part["name"], [(one["name"], one["value"]) for one in part["values"]])


def dtype_of(descriptor):
    """The numpy type of a payload."""
    parts = descriptor["fields"]

    def one(part):
        element = part["element"]
        return _type_of(element if isinstance(element, str) else element_of(part))

    return np.dtype([(part["name"], one(part), tuple(part["shape"])) for part in parts])
