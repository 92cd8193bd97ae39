"""Messages: the data exchanged by participants, as classes over numpy memory."""

import enum
import operator
import re

import numpy as np
from numpy import ndarray

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
# The attributes of a message that are not fields.
_RESERVED = ("fields", "dtype", "descriptor", "array")
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


class _Content:
    """The memory of a text or bytes field: takes a `str` or `bytes`; for several elements a list of them."""

    __slots__ = ("array", "name", "field")

    def __init__(self, array, name, field):
        self.array, self.name, self.field = array, name, field

    def put(self, value):
        field = self.field
        if not field.shape:
            self.array[self.name] = self._element(value)
            return
        count = int(np.prod(field.shape))
        if isinstance(value, (str, bytes)) or len(value) != count:
            raise ValueError(f"it takes a list of {count}")
        elements = np.array([self._element(one) for one in value], _type_of(field.element))
        self.array[self.name] = elements.reshape(field.shape)

    def _element(self, value):
        """The element of numpy for a `str` or `bytes`: all of it, or an error."""
        element, room = self.field.element, self.field.room
        text = element.startswith("text")
        if not isinstance(value, str if text else (bytes, bytearray, memoryview)):
            raise TypeError(f"it is {element}, which takes {'a str' if text else 'bytes'}")
        content = value.encode() if text else bytes(value)
        if len(content) > room:
            raise ValueError(f"it has {len(content)} bytes, and there is room for {room}")
        if not text:
            return (len(content), np.frombuffer(content.ljust(room, b"\0"), np.uint8))
        if b"\0" in content:
            raise ValueError("there is a zero in it, which ends a text")
        return content


class _Member:
    """The memory of an enumeration with one element: takes a member, its name or its number."""

    __slots__ = ("view", "at", "values")

    def __init__(self, view, at, values):
        self.view, self.at, self.values = view, at, values

    def put(self, value):
        self.view[self.at] = _member(self.values, value)


class _Elements:
    """The memory of a field with several elements, into which an assigned value is copied."""

    __slots__ = ("view", "shape", "dtype", "values")

    def __init__(self, view, values):
        self.view, self.shape, self.dtype, self.values = view, view.shape, view.dtype, values

    def put(self, value):
        array = value if type(value) is ndarray else np.asarray(value)
        if array.shape != self.shape and array.shape:
            # The caller states both shapes.
            raise ValueError("it has another shape")
        if self.values is not None:
            array = _members(array, self.values)
        elif array.dtype is not self.dtype:
            if array is not value and array.dtype.kind == "f" and self.dtype.kind in "iu":
                # A list of integers and floats: as doubles the integers would lose bits.
                array = np.asarray(value, object)
            array = _exact(array, self.dtype)
        self.view[...] = array


def _members(array, values):
    """The numbers of the members in `array`: members, numbers or names."""
    numbers = [int(_member(values, one)) for one in array.reshape(-1).tolist()]
    return np.array(numbers, np.uint8).reshape(array.shape)


def _exact(array, dtype):
    """`array` for elements of `dtype`. Numpy would truncate or wrap what an integer cannot represent: that is an error."""
    kind = array.dtype.kind
    if kind in "iu":
        # The usual case, and the fast one.
        cast = array.astype(dtype)
        if 0 not in (cast == array).tobytes():
            return cast
    if kind not in "biufcO":
        raise TypeError("it takes numbers")
    if kind == "c":
        _refuse_where(array.imag != 0, array, "numbers without an imaginary part")
        return _exact(array.real, dtype)
    if dtype.kind not in "iu" or kind == "b":
        return array
    if array.dtype == np.float16:
        # It has no room for the limits.
        array = array.astype(float)
    limits = np.iinfo(dtype)
    takes = f"whole numbers from {limits.min} to {limits.max}"
    # As floats, one more than the maximum is exact and the maximum may not be.
    with np.errstate(invalid="ignore"):
        below = array < float(limits.max + 1) if kind == "f" else array <= limits.max
        inside = (array >= limits.min) & below
    _refuse_where(~inside, array, takes)
    if kind == "f":
        _refuse_where(array != np.floor(array), array, takes)
    if kind == "O":
        numbers = np.array([int(one) for one in array.reshape(-1)], dtype).reshape(array.shape)
        _refuse_where(numbers != array, array, takes)
        return numbers
    return array


def _refuse_where(wrong, array, takes):
    """An error that names the first element that is `wrong`."""
    if np.any(wrong):
        at = np.unravel_index(np.argmax(wrong), array.shape)
        place = f"its element {', '.join(str(index) for index in at)}" if at else "it"
        raise ValueError(f"it takes {takes}, and {place} is {array[at]}")


def _member(cls, value):
    """The member of an enumeration that `value` is: itself, its name or its number."""
    try:
        return cls[value] if isinstance(value, str) else cls(value)
    except (KeyError, ValueError):
        raise ValueError(f"it is one of {', '.join(member.name for member in cls)}") from None


def _property(name, view, at, field):
    """The property that reads a field. `Message.__setattr__` writes it."""
    if field.room:
        return property(_content(name, field))
    if field.shape:
        # A numpy view that is created once.
        return property(operator.attrgetter(view))
    return property(_named(view, at, field.values) if field.values else _scalar(view, at))


def _content(name, field):
    """Reads a text or bytes field: a `str` or `bytes`; for several elements a tuple of them."""

    def get(message):
        value = message.array[name]
        return tuple(_read(one) for one in value.reshape(-1)) if field.shape else _read(value[()])

    return get


def _named(view, at, cls):
    """Reads an enumeration: a member of its class."""
    members = {int(member): member for member in cls}

    def get(message):
        return members[getattr(message, view)[at]]

    return get


def _scalar(view, at):
    """Reads a field with one element: a Python number."""
    # On the hot path of every step, so the constants are bound into it.
    made = {}
    exec(f"def get(message):\n    return message.{view}[{at}]", made)
    return made["get"]


def _refused(message, name, value, error):
    kind = type(message).__name__
    if message._bytes_view.readonly:
        return MessageError(f"`{name}` of `{kind}` belongs to an input, which is read only: write to an output")
    shape, given = message.fields[name].shape, _shape_of(value)
    if given and given != shape and not message.fields[name].room:
        return MessageError(f"`{name}` of `{kind}` has the shape {shape}, and a value of the shape {given} was given")
    return MessageError(f"`{name}` of `{kind}` cannot be {value!r}: {error}")


def _shape_of(value):
    """The shape of a value; `()` for one that has none, such as lists of different lengths."""
    try:
        return np.shape(value)
    except (TypeError, ValueError):
        return ()


def _can_be_attribute(name):
    return name.isidentifier() and name not in _RESERVED and not name.startswith("_")


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
    _places = ()

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
        taken = [key for key in own if not _can_be_attribute(key)]
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
            if _can_be_attribute(key):
                setattr(made, key, _property(key, view, at, field))
        return made

    def __init__(self, **values):
        self._open(False)
        for key, value in values.items():
            if key not in self.fields:
                raise MessageError(self._no_field(key))
            self[key] = value

    def _open(self, read_only):
        """Allocates the memory, and creates each view of it once. Views of an input are read-only."""
        size = self.dtype.itemsize
        # Casts need whole elements of every type.
        memory = np.zeros(-(-size // 8) * 8, np.uint8)
        #: The whole payload as a structured array without dimensions.
        array = memory[:size].view(self.dtype)[0:1].reshape(())
        view = memoryview(memory)
        if read_only:
            array.flags.writeable = False
            view = view.toreadonly()
        views, items = {}, {}
        for name, key, at, field in self._places:
            if field.room:
                items[key] = (_Content(array, key, field), None)
            elif field.shape:
                views[name] = array[key]
                items[key] = (_Elements(array[key], field.values), None)
            else:
                if name not in views:
                    views[name] = view.cast(ELEMENTS[field.element][1])
                items[key] = (_Member(views[name], at, field.values), None) if field.values else (views[name], at)
        # Where an assigned value goes: for a number the memory and the index, otherwise what puts it there. Of every field, and of those
        # that are attributes.
        attributes = {key: place for key, place in items.items() if _can_be_attribute(key)}
        own = {"_memory": memory, "array": array, "_bytes_view": view, "_items": items, "_attributes": attributes}
        # Not by way of `__dict__`, which would make every later access to them slower.
        for key, value in {**own, **views}.items():
            object.__setattr__(self, key, value)

    def __setattr__(self, name, value):
        # On the hot path of every step: for a number, one look-up and one write into the memory.
        try:
            place, at = self._attributes[name]
        except KeyError:
            self._put_other(name, value)
            return
        try:
            if at is None:
                place.put(value)
            else:
                place[at] = value
        except (TypeError, ValueError, OverflowError) as error:
            raise _refused(self, name, value, error) from None

    def _put_other(self, name, value):
        """Writes an attribute that a subclass defines; anything else is a mistake, such as a misspelt field."""
        if not hasattr(getattr(type(self), name, None), "__set__") or name in self.fields:
            raise AttributeError(self._no_field(name)) from None
        object.__setattr__(self, name, value)

    def _no_field(self, name):
        return f"`{type(self).__name__}` has no field `{name}`; it has {', '.join(f'`{one}`' for one in self.fields)}"

    def __getitem__(self, key):
        if key not in self.fields:
            raise KeyError(key)
        value, field = self.array[key], self.fields[key]
        if field.room:
            return _content(key, field)(self)
        if field.shape:
            return value
        return field.values(value.item()) if field.values else value.item()

    def __setitem__(self, key, value):
        place, at = self._items[key]
        try:
            if at is None:
                place.put(value)
            else:
                place[at] = value
        except (TypeError, ValueError, OverflowError) as error:
            raise _refused(self, key, value, error) from None

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
