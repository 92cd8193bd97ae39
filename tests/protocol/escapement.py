"""A participant of an Escapement run in Python: docs/protocol.md, word for word, over iceoryx2's own bindings.

Meant to be read beside the protocol, and slow: a few thousand activations a second. It polls, so it never sleeps in the run, and it
neither saves states nor moves to another place.
"""

import ctypes
import os
import struct
import sys
import tomllib

import iceoryx2 as iox2

PROTOCOL = 7
SAMPLED, CONTINUOUS = 0, 1
EVENT_STREAM = 2**64 - 1
LINE = 64
ELEMENTS = "dfqiQIBbhH?"  # struct's letters for the elements f64, f32, i64, i32, u64, u32, u8, i8, i16, u16, bool
ENUM = len(ELEMENTS)  # an enumeration: a byte, with the names of its values
U64 = 2**64 - 1


class Line(ctypes.Structure):
    """What the memory of links and records is counted in."""

    _fields_ = [("words", ctypes.c_uint64 * 8)]

    @staticmethod
    def type_name():
        return "EscapementLine"


class Row(ctypes.Structure):
    """What a participant does."""

    _fields_ = [(name, ctypes.c_uint64) for name in ("next", "activity", "first", "second")]

    @staticmethod
    def type_name():
        return "EscapementStatus"


# The wire: section 2.


class Refused(Exception):
    """What this program cannot do."""


class Reader:
    """Takes a message apart, from the front."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, letter):
        (value,) = struct.unpack_from("<" + letter, self.data, self.at)
        self.at += struct.calcsize("<" + letter)
        return value

    def bytes(self):
        size = self.take("Q")
        self.at += size
        return self.data[self.at - size : self.at]

    def text(self):
        return self.bytes().decode()

    def list(self, item):
        return [item() for _ in range(self.take("Q"))]

    def option(self, item):
        return item() if self.take("B") else None

    def wide(self):
        low, high = self.take("Q"), self.take("q")
        return (high << 64) + low

    def sample_time(self):
        return self.take("q"), self.take("q")

    def delivery(self):
        producer = self.sample_time()
        base, spread, scale = self.wide(), self.wide(), self.wide()
        drop_below, hold, key = self.take("Q"), self.take("I"), self.take("Q")
        if hold == 2:
            raise Refused("a connection interpolates, which this program does not do: write hold = \"last\"")
        link_fault = lambda: (self.take("q"), self.take("q"), self.wide(), self.take("Q"), self.take("Q"))
        return DeliveryRule(producer, base, spread, scale, drop_below, hold, key, self.list(link_fault))

    def signal_faults(self):
        if self.take("Q"):
            raise Refused("signal faults are not for this program: name another participant")

    def descriptor(self):
        name, size = self.text(), self.take("I")
        value = lambda: (self.text(), self.take("B"))
        extents = lambda: self.list(lambda: self.take("I"))
        field = lambda: (self.text(), self.take("I"), extents(), self.text(), self.text(), self.take("I"), self.list(value))
        return name, size, self.list(field)

    def input_link(self):
        port, link, source, delivery = self.take("I"), self.take("I"), self.text(), self.delivery()
        initial = self.bytes() if self.take("I") == 0 else None
        capacity, has_faults = self.take("I"), self.take("B")
        if has_faults:
            raise Refused("signal faults are not for this program: name another participant")
        if self.take("B"):
            raise Refused(f"the connection from {source} converts fields, which this program does not do: connect whole ports")
        return {"port": port, "link": link, "from": source, "delivery": delivery, "initial": initial, "capacity": capacity}

    def output(self):
        stream = self.take("I")
        # Which samples are observed: this program computes and sends all of them.
        _every, _first, _end = self.take("Q"), self.take("Q"), self.take("Q")
        consumers = self.list(self.consumer)
        self.signal_faults()
        return stream, consumers

    def consumer(self):
        link, to, _number = self.take("I"), self.text(), self.take("I")
        delivery, sample_time = self.delivery(), self.sample_time()
        first, capacity, end = self.take("B") == 1, self.take("I"), self.take("q")
        return Consumer(link, to, delivery, sample_time, first, capacity, end)

    def assignment(self):
        name, tick, sample_time, activations = self.text(), self.text(), self.sample_time(), self.take("Q")
        self.take("I")  # the interface is the one that was described
        self.list(lambda: (self.text(), self.descriptor(), self.take("B")))
        self.list(lambda: (self.text(), self.descriptor()))
        inputs = self.list(self.input_link)
        outputs = self.list(self.output)
        if self.take("Q"):
            raise Refused("signal faults are not for this program: name another participant")
        return name, tick, sample_time, activations, inputs, outputs


def text(value):
    data = value.encode()
    return struct.pack("<Q", len(data)) + data


def items(encoded):
    encoded = list(encoded)
    return struct.pack("<Q", len(encoded)) + b"".join(encoded)


class Message:
    """The layout of a port: rows of name, element (a letter of ELEMENTS, or the names of an enumeration by their values), extents,
    unit, frame."""

    def __init__(self, name, *fields):
        self.name, self.fields = name, fields
        self.format, self.described, self.allowed = "<", [], []
        for field, letter, extents, unit, frame in fields:
            values = letter if isinstance(letter, dict) else {}
            letter = "B" if values else letter
            count = 1
            for extent in extents:
                count *= extent
            offset, self.format = struct.calcsize(self.format), f"{self.format}{count}{letter}"
            shape = items(struct.pack("<I", extent) for extent in extents)
            code = struct.pack("<I", ENUM if values else ELEMENTS.index(letter))
            named = items(text(name) + struct.pack("<B", value) for value, name in values.items())
            self.described.append(text(field) + code + shape + text(unit) + text(frame) + struct.pack("<I", offset) + named)
            if values or letter == "?":
                self.allowed.append((range(offset, offset + count), values or (0, 1)))
        self.size = struct.calcsize(self.format)

    def encode(self):
        return text(self.name) + struct.pack("<I", self.size) + items(self.described)

    def valid(self, payload):
        """Whether all numbers are finite, and bytes with a meaning have one of theirs."""
        values = struct.unpack(self.format, payload)
        named = all(payload[at] in allowed for places, allowed in self.allowed for at in places)
        return named and all(value - value == 0 for value in values)


# Which sample an activation reads: section 3.


def mix(z):
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & U64
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & U64
    return z ^ (z >> 31)


class DeliveryRule:
    def __init__(self, producer, base, spread, scale, drop_below, hold, key, link_faults):
        self.producer, self.base, self.spread, self.scale = producer, base, spread, scale
        self.drop_below, self.hold, self.key, self.link_faults = drop_below, hold, key, link_faults

    def draw(self, i, key=None):
        return mix(((self.key if key is None else key) + 0x9E3779B97F4A7C15 * (i + 1)) & U64) >> 32

    def active_link_faults(self, k):
        return [d for d in self.link_faults if d[0] <= self.instant(k) < d[1]]

    def instant(self, k):
        return self.producer[0] + k * self.producer[1]

    def dropped(self, k):
        lost = self.drop_below > 0 and self.draw(2 * k + 1) < self.drop_below
        return lost or any(self.draw(k, key) < below for _, _, _, below, key in self.active_link_faults(k))

    def visible(self, k, t):
        late = self.base + self.spread * (self.draw(2 * k) if self.spread else 0) + sum(d[2] for d in self.active_link_faults(k))
        return self.instant(k) - (-late // self.scale) <= t

    def sample_to_read(self, t):
        """The index, -1 for the initial value, None for nothing."""
        k = (t + self.base // -self.scale - self.producer[0]) // self.producer[1]
        while k >= 0 and not (self.visible(k, t) and (self.hold == 1 or not self.dropped(k))):
            k -= 1
        if k < 0:
            return None
        return -1 if self.dropped(k) else k


class Consumer:
    """A reader of an output: determines whether it will ever read a sample."""

    def __init__(self, link, to, delivery, sample_time, first, capacity, end):
        self.link, self.to, self.delivery, self.first, self.capacity = link, to, delivery, first, capacity
        (self.t, self.period), self.end, self.due = sample_time, end, -1

    def is_read(self, index):
        while self.due < index and self.t < self.end:
            read = self.delivery.sample_to_read(self.t)
            self.t += self.period
            if read is None:
                read = 0 if self.first else -1
            self.due = max(self.due, read)
        return self.due == index


# The run: sections 1, 4, 5 and 6.


def slot_size(payload):
    return (24 + payload + LINE - 1) // LINE * LINE


class Memory:
    """Memory that one process writes and another reads, in lines; every line with a multiple of `cleared` begins with 0 at first."""

    def __init__(self, services, lines, cleared):
        samples, board = services
        builder = samples.publisher_builder().initial_max_slice_len(lines).max_loaned_samples(1)
        self.publisher = builder.backpressure_strategy(iox2.BackpressureStrategy.DiscardData).create()
        self.counted = board.reader_builder().create().entry(ctypes.c_uint64(0), ctypes.c_uint64)
        self.lines, self.cleared, self.base = lines, cleared, None

    def hand_over(self):
        """Hands the memory over, once; returns whether a process has received it."""
        if self.base is None:
            sample = self.publisher.loan_slice_uninit(self.lines)
            base = sample.payload_ptr
            for line in range(0, self.lines, self.cleared):
                ctypes.c_uint64.from_address(base + LINE * line).value = 0
            if sample.assume_init().send() > 0:
                self.base = base
        return self.base is not None

    def taken(self):
        return self.counted.get().decode_as(ctypes.c_uint64).value

    def announce(self, at, value):
        ctypes.c_uint64.from_address(self.base + at).value = value

    def write(self, at, data):
        ctypes.memmove(self.base + at, data, len(data))


class Sender:
    """The sending end of a link."""

    def __init__(self, services, capacity, size):
        self.slot, self.capacity, self.sent = slot_size(size), capacity, 0
        self.memory = Memory(services, capacity * self.slot // LINE, self.slot // LINE)

    def send(self, index, stamp, payload):
        """False when there is no room now."""
        if not self.memory.hand_over() or self.sent - self.memory.taken() == self.capacity:
            return False
        at = self.sent % self.capacity * self.slot
        self.memory.write(at + 8, struct.pack("<Qq", index, stamp) + payload)
        self.sent += 1
        self.memory.announce(at, self.sent)
        return True


class Receiver:
    """The receiving end of a link."""

    def __init__(self, services, capacity, size):
        samples, board = services
        self.subscriber = samples.subscriber_builder().buffer_size(1).create()
        self.counted = board.writer_builder().create().entry(ctypes.c_uint64(0), ctypes.c_uint64)
        self.slot, self.capacity, self.size, self.taken, self.sample = slot_size(size), capacity, size, 0, None

    def receive(self):
        """Index, stamp and payload of the next sample, if it is there."""
        self.sample = self.sample or self.subscriber.receive()
        if self.sample is None:
            return None
        base = self.sample.payload().as_ptr() + self.taken % self.capacity * self.slot
        if ctypes.c_uint64.from_address(base).value != self.taken + 1:
            return None
        index, stamp = struct.unpack("<Qq", ctypes.string_at(base + 8, 16))
        payload = ctypes.string_at(base + 24, self.size)
        self.taken += 1
        self.counted.update_with_copy(ctypes.c_uint64(self.taken))
        return index, stamp, payload


class Record:
    """The connection to the recorder."""

    def __init__(self, services, room):
        self.size = room
        lines = 1 + self.size // LINE
        self.memory = Memory(services, lines, lines)
        if not self.memory.hand_over():
            raise ValueError("the recorder does not take the record")
        self.written = 0

    def append(self, entries, wait):
        """Entries of stream, index, stamp and payload: all of one activation, committed together."""
        data = b""
        for stream, index, stamp, payload in entries:
            data += struct.pack("<QQQq", stream, len(payload), index, stamp) + payload + bytes(-len(payload) % 8)
        while self.written + len(data) - 8 * self.memory.taken() > self.size:
            wait()
        at = self.written % self.size
        before = self.size - at
        self.memory.write(LINE + at, data[:before])
        self.memory.write(LINE, data[before:])
        self.written += len(data)
        self.memory.announce(0, self.written // 8)


class Session:
    """A participant in a run. `make(setup)` makes the model: an object with `kind`, `inputs` (name, Message, required), `outputs`
    (name, Message), `initialise(t, outputs)` and `step(t, period, inputs, outputs)`. Payloads are tuples of numbers."""

    def __init__(self, make, program):
        self.make, self.program = make, program
        prefix, _, folder = os.environ["ESCAPEMENT_RUN"].partition("@")
        self.name = os.environ["ESCAPEMENT_PARTICIPANT"]
        iox2.set_log_level(iox2.LogLevel.Fatal)
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(prefix)
        config.global_cfg.root_path = iox2.Path.new(folder)
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        node = iox2.NodeBuilder.new().config(config).name(iox2.NodeName.new(self.name))
        self.node = node.signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        writer = self.blackboard(f"status/{self.name}").writer_builder().create()
        self.row = writer.entry(ctypes.c_uint64(1), Row)
        self.listener = self.service(f"wake/{self.name}").event().open().listener_builder().create()
        control = self.service(f"control/{self.name}").request_response(iox2.Slice[ctypes.c_uint8], iox2.Slice[ctypes.c_uint8])
        server = control.open().server_builder().initial_max_slice_len(65536)
        self.server = server.allocation_strategy(iox2.AllocationStrategy.PowerOfTwo).create()
        self.model = self.record = None
        self.terminating = False

    def service(self, name):
        return self.node.service_builder(iox2.ServiceName.new(name))

    def blackboard(self, name):
        return self.service(name).blackboard_opener(ctypes.c_uint64).open()

    def serve(self):
        """Answers one request, if there is one."""
        request = self.server.receive()
        if request is None:
            return
        payload = request.payload()
        reply = self.answer(Reader(ctypes.string_at(payload.as_ptr(), payload.len())))
        response = request.loan_slice_uninit(len(reply))
        ctypes.memmove(response.payload_ptr, reply, len(reply))
        response.assume_init().send()

    def answer(self, request):
        variant = request.take("I")
        if variant == 0:
            return struct.pack("<II", 0, PROTOCOL) + text(self.program)
        if variant == 1:
            name, parameters, seed = request.text(), tomllib.loads(request.text()), request.take("Q")
            try:
                self.model = self.make({"name": name, "parameters": parameters, "seed": seed})
            except KeyError as error:
                return struct.pack("<I", 4) + text(str(error.args[0])) + text("is missing")
            self.period = request.take("d")
            inputs = (text(name) + message.encode() + bytes([required]) for name, message, required in self.model.inputs)
            outputs = (text(name) + message.encode() for name, message in self.model.outputs)
            return struct.pack("<II", 1, self.model.kind) + items(inputs) + items(outputs)
        if variant == 2:
            try:
                assignment = request.assignment()
            except Refused as error:
                return struct.pack("<I", 4) + text("") + text(str(error))
            cores, _waiting = request.list(lambda: request.take("I")), (request.take("I"), request.take("I"))
            room = request.take("I")
            if request.take("B"):
                return struct.pack("<I", 4) + text("") + text("it cannot resume a run")
            if cores:
                os.sched_setaffinity(0, cores)
            self.connect(room, *assignment)
            return struct.pack("<I", 2)
        if variant == 3:
            return struct.pack("<IB", 3, 0)
        if variant == 5:
            self.terminating = True
            return struct.pack("<I", 2)
        return struct.pack("<I", 4) + text("") + text("it cannot relocate")

    def connect(self, room, name, tick, sample_time, activations, inputs, outputs):
        number, unit = tick.split()
        numerator, _, denominator = number.partition("/")
        self.tick = int(numerator), int(denominator or 1) * {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
        (self.offset, self.step_ticks), self.activations = sample_time, activations
        clock = self.blackboard("clock").reader_builder().create()
        self.horizon = clock.entry(ctypes.c_uint64(0), ctypes.c_int64)
        self.command = clock.entry(ctypes.c_uint64(1), ctypes.c_uint64)
        self.inputs, self.outputs, self.others = inputs, outputs, {}
        for link in inputs:
            link["message"] = self.model.inputs[link["port"]][1]
            link["receiver"] = Receiver(self.ring(f"link/{link['link']}"), link["capacity"], link["message"].size)
            link["received"] = -1
            self.open_status_of(link["from"])
        for (_, consumers), (_, message) in zip(outputs, self.model.outputs):
            for to in consumers:
                to.sender = Sender(self.ring(f"link/{to.link}"), to.capacity, message.size)
                self.open_status_of(to.to)
        self.record = Record(self.ring(f"record/{name}"), room)
        self.payloads = [bytes(message.size) for _, message, _ in self.model.inputs]
        self.values = [(0,) * len(struct.unpack(m.format, bytes(m.size))) for _, m in self.model.outputs]
        self.next, self.initialised, self.paused_at, self.paused = 0, False, -(2**63), False

    def ring(self, name):
        samples = self.service(name).publish_subscribe(iox2.Slice[Line])
        return samples.payload_alignment(iox2.Alignment.new(LINE)).open(), self.blackboard(name)

    def open_status_of(self, port):
        other = port.split(".")[0]
        if other != self.name and other not in self.others:
            wait_reason = self.blackboard(f"status/{other}").reader_builder().create().entry(ctypes.c_uint64(0), ctypes.c_uint64)
            self.others[other] = wait_reason, self.service(f"wake/{other}").event().open().notifier_builder().create()

    def wake(self):
        for wait_reason, notifier in self.others.values():
            if wait_reason.get().decode_as(ctypes.c_uint64).value:
                notifier.notify()

    def current_command(self):
        return self.command.get().decode_as(ctypes.c_uint64).value

    def set_status(self, activity, first=0, second=0):
        self.row.update_with_copy(Row(self.next, activity, first, second))

    def wait(self, activity, first=0, second=0):
        """Yields to other processes. Exits when the run is over."""
        self.set_status(activity, first, second)
        self.wake()
        os.sched_yield()
        if self.current_command() == 1:
            sys.exit(0)

    def instant(self, k):
        return self.offset + k * self.step_ticks

    def seconds(self, ticks):
        return ticks * self.tick[0] / self.tick[1]  # integers: one correct rounding

    def fetch(self, number, link):
        """Copies the sample of link `number` that this activation reads into the payload of its input."""
        port, message = link["port"], link["message"]
        read = link["delivery"].sample_to_read(self.instant(self.next))
        if read is None and link["initial"] is None:
            read = 0
        if read is None or read < 0:
            self.payloads[port] = link["initial"] or bytes(message.size)
            return
        while link["received"] < read:
            sample = link["receiver"].receive()
            if sample is None:
                self.wait(2, number, read)
                continue
            index, stamp, payload = sample
            if not link["received"] < index <= read or stamp != link["delivery"].instant(index):
                raise ValueError(f"`{link['from']}` sent sample #{index} stamped {stamp} where #{read} is due")
            self.payloads[port], link["received"] = payload, index
            if not message.valid(payload):
                raise ValueError(f"`{link['from']}` sent sample #{index} with a value that its type does not have")

    def publish(self, index):
        stamp, entries = self.instant(index), []
        for (stream, _), (name, message), values in zip(self.outputs, self.model.outputs, self.values):
            payload = struct.pack(message.format, *values)
            if not message.valid(payload):
                raise ValueError(f"its output `{name}` has a value that its type does not have")
            entries.append((stream, index, stamp, payload))
        self.record.append(entries, lambda: self.wait(4))
        for output, ((_, consumers), (_, _, _, payload)) in enumerate(zip(self.outputs, entries)):
            for position, to in enumerate(consumers):
                while to.is_read(index) and not to.sender.send(index, stamp, payload):
                    self.wait(3, output, position)
        self.wake()

    def event(self, payload):
        self.record.append([(EVENT_STREAM, 0, 0, payload)], lambda: self.wait(4))

    def advance(self, horizon):
        self.set_status(1)
        if not self.initialised:
            self.initialised = True
            self.model.initialise(self.seconds(self.offset), self.values)
            if self.model.kind == CONTINUOUS and self.activations > 0:
                self.publish(0)
        while self.next < self.activations and self.instant(self.next) < horizon and self.current_command() == 0:
            for number, link in enumerate(self.inputs):
                self.fetch(number, link)
            inputs = [struct.unpack(m.format, payload) for (_, m, _), payload in zip(self.model.inputs, self.payloads)]
            self.model.step(self.seconds(self.instant(self.next)), self.seconds(self.step_ticks), inputs, self.values)
            self.publish(self.next + (1 if self.model.kind == CONTINUOUS else 0))
            self.next += 1
            self.set_status(1)
        if self.next >= self.activations:
            self.set_status(6)
            self.event(struct.pack("<IQQ", 0, 0, len(self.inputs)) + bytes(8 * (len(self.inputs) + 4)))
        elif self.instant(self.next) >= horizon:
            self.set_status(5)
            self.event(struct.pack("<IqQ", 1, horizon, self.next))
        else:
            return
        self.paused_at = horizon

    def run(self):
        while not self.terminating:
            self.serve()
            if self.record is None:
                os.sched_yield()
                continue
            command, horizon = self.current_command(), self.horizon.get().decode_as(ctypes.c_int64).value
            if command == 1:
                return
            if command == 2 and not self.paused:
                self.paused = True
                self.set_status(5)
                self.event(struct.pack("<IQ", 3, self.next))
            if self.paused or horizon in (-(2**63), self.paused_at):
                self.listener.timed_wait(iox2.Duration.from_millis(20))
                continue
            try:
                self.advance(horizon)
            except Exception as error:
                t = str(self.seconds(self.instant(self.next)))
                self.event(struct.pack("<IQ", 2, self.next) + text(t) + text(f"{error}"[:6000]))
                raise


def run(make, program):
    """The `main` of a participant's program."""
    Session(make, program).run()
