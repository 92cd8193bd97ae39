"""`esc.Run`: a run that is advanced in stages: inputs set from code, and calls that are refused."""

import enum
import fractions
import threading
import warnings

import numpy as np
import pytest
from conftest import SPRING
from spring import Spring

import escapement as esc


class Mode(enum.IntEnum):
    Off = 0
    On = 3


class Order(esc.Message):
    count = esc.Field(element="u64")
    offset = esc.Field("m", element="i64")
    gain = esc.Field()
    label = esc.Field(element="text[8]")
    levels = esc.Field(element="u8", shape=6)
    mode = esc.Field(element=Mode)
    armed = esc.Field(element=bool)


class Other(esc.Message):
    payload = esc.Field(shape=5)


class Sink(esc.Participant):
    order = esc.Input(Order)
    done = esc.Output(Order)

    def step(self, t, dt):
        for field in Order.fields:
            self.done[field] = self.order[field]


def sink():
    text = 'duration = "1 s"\ninputs = ["sink.order"]\n[participants.sink]\nrun = { exe = "/bin/true" }\nperiod = "100 ms"\n'
    return esc.Run(esc.Scenario("own.toml", text=text, participants={"sink": Sink}))


def test_fields_of_every_type_are_set_without_loss():
    with sink() as run:
        values = dict(count=2**53 + 1, offset=-(2**53) - 1, gain=0.5, label="höher", levels=[0, 1, 2, 3, 4, 255], mode="On", armed=True)
        run.set("sink.order", **values)
        run.run_to("0.3 s")
        assert run.newest("sink.done").message == Order(**values)
        run.set("sink.order", mode=Mode.On, count=7)
        run.run_to("0.5 s")
        assert run.newest("sink.done").message == Order(mode=3, count=7)


@pytest.mark.parametrize(
    "values, error, message",
    [
        (dict(levels=[[0, 1, 2], [3, 4, 5]]), esc.MessageError, r"`sink.order`: `levels` of `Order` has the shape \(6,\), and a value of the shape \(2, 3\)"),
        (dict(levels=[300] * 6), esc.MessageError, "whole numbers from 0 to 255"),
        (dict(mode="Onn"), esc.MessageError, "`sink.order`: `mode` of `Order` cannot be 'Onn': it is one of Off, On"),
        (dict(label="too long for it"), esc.MessageError, "room for 8"),
        (dict(count=-1), esc.MessageError, "`count` of `Order` cannot be -1"),
        (dict(cuont=1), esc.MessageError, "`sink.order`: `Order` has no field `cuont`; it has `count`, "),
        (dict(gain=float("nan")), esc.PortError, "NaN"),
        (dict(message=Other()), esc.MessageError, r"`sink.order` takes Order\(.*Other\(.* has other fields"),
    ],
)
def test_values_that_do_not_fit_a_port_are_refused(values, error, message):
    with sink() as run, pytest.raises(error, match=message):
        run.set("sink.order", **values)


def test_unknown_port_is_refused_with_existing_ports():
    with sink() as run, pytest.raises(esc.PortError, match="`sink` has no input `odrer`; it has `order`"):
        run.set("sink.odrer", count=1)


SPRINGS = {"left": Spring, "right": Spring}


@pytest.mark.parametrize("number", [0.25, np.float64(0.25), np.float32(0.25), np.array(0.25), fractions.Fraction(1, 4), "250 ms"])
def test_time_is_a_text_or_any_number_of_seconds(number):
    with esc.Run(SPRING, participants=SPRINGS) as run:
        run.run_to(number)
        assert run.now == 0.25
        run.run_to(np.int64(1))
        assert run.now == 1.0


def test_checkpoints_are_at_times_of_every_kind():
    short = {"duration": "1 s", "measures.apart.from": "0 s"}
    begun = esc.run(SPRING, participants=SPRINGS, set=short, checkpoint_at=[0.25, "0.5 s"], checkpoint_every=np.float64(0.6), out="begun")
    for at in (0.3, "0.3 s", np.float64(0.3)):
        resumed = esc.resume(begun, at=at, out="resumed", force=True)
        assert resumed.digest == begun.digest
    # One time alone, and an array of them.
    for at in (0.25, np.array([0.25, 0.5])):
        esc.run(SPRING, participants=SPRINGS, set=short, checkpoint_at=at, out="other", force=True)


@pytest.mark.parametrize(
    "options, message",
    [
        (dict(checkpoint_every="often"), "checkpoint_every: `often` is not a time: write a number and a unit, .*, or a number of seconds"),
        (dict(checkpoint_at=["1 s", None]), "checkpoint_at=None is no time"),
        (dict(checkpoint_every=True), "checkpoint_every=True is no time"),
        (dict(checkpoint_every=float("nan")), "checkpoint_every: `nan s` is not a time"),
        (dict(patience="soon"), "patience='soon' is no time: .*\"30 s\", or a number of seconds"),
        (dict(pace="fast"), "pace='fast' is no number: give simulated seconds per second"),
        (dict(out=5), "out=5 is no path"),
        (dict(record="tape"), 'record="tape": write "folder"'),
    ],
)
def test_option_that_cannot_be_read_is_refused_with_its_name(options, message):
    with pytest.raises(esc.OptionError, match=message):
        esc.run(SPRING, participants=SPRINGS, in_process=False, **options)


def test_times_that_cannot_be_read_are_refused():
    with esc.Run(SPRING, participants=SPRINGS) as run:
        with pytest.raises(esc.OptionError, match="run_to: `soon` is not a time"):
            run.run_to("soon")
        with pytest.raises(esc.OptionError, match=r"run_to=\[1\] is no time"):
            run.run_to([1])


def test_run_that_is_resumed_is_not_replaced(tmp_path):
    begun = esc.run(SPRING, participants=SPRINGS, set={"duration": "2 s"}, checkpoint_at="1 s", out="runs/begun")
    (tmp_path / "link").symlink_to(begun.folder)
    for out in (begun.folder, "runs", tmp_path / "link"):
        with pytest.raises(esc.OptionError, match="it has the run that is resumed, which force=True would take away; name another folder"):
            esc.resume(begun, out=out, force=True)
    assert esc.open(begun.folder).digest == begun.digest
    assert esc.resume(begun, out="runs/begun2", force=True).digest == begun.digest


def test_patience_has_an_effect_in_processes_only():
    short = {"duration": "0.1 s", "measures.apart.from": "0 s"}
    with pytest.warns(esc.ScenarioWarning, match="patience=5 has no effect on a run in one process") as caught:
        esc.run(SPRING, participants=SPRINGS, set=short, patience=5, record="digest")
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        esc.run(SPRING, participants=SPRINGS, set=short, patience="5 s", in_process=False)


CALLS = {
    "now": lambda run: run.now,
    "is_over": lambda run: run.is_over,
    "run_to": lambda run: run.run_to(1),
    "step": lambda run: run.step(),
    "run_to_step": lambda run: run.run_to_step("left"),
    "newest": lambda run: run.newest("left.motion"),
    "read_input": lambda run: run.read_input("left.neighbour"),
    "set": lambda run: run.set("left.neighbour", position=1.0),
    "set_output": lambda run: run.set_output("left.motion", position=1.0),
    "log": lambda run: run.log("left"),
    "save": lambda run: run.save(),
    "restore": lambda run: run.restore(None),
    "end": lambda run: run.end(),
}


@pytest.mark.parametrize("call", CALLS)
def test_run_that_has_ended_takes_no_call(call):
    with esc.Run(SPRING, participants=SPRINGS) as run:
        run.run_to("0.1 s")
        run.end()
        with pytest.raises(esc.RunError, match="the run has ended: start another one"):
            CALLS[call](run)


@pytest.mark.parametrize("call", CALLS)
def test_run_takes_no_call_from_another_thread(call):
    raised = []

    def other(run):
        try:
            CALLS[call](run)
        except BaseException as error:
            raised.append(error)

    with esc.Run(SPRING, participants=SPRINGS) as run:
        thread = threading.Thread(target=other, args=(run,))
        thread.start()
        thread.join()
        run.run_to("0.1 s")
    (error,) = raised
    assert isinstance(error, esc.RunError) and "belongs to the thread that started it" in str(error)


@pytest.mark.parametrize("call", CALLS)
def test_run_takes_no_call_from_a_step(call):
    class Calls(Spring):
        def step(self, t, dt):
            CALLS[call](run)

    with esc.Run(SPRING, participants={**SPRINGS, "left": Calls}) as run:
        with pytest.raises(esc.RunError, match="`left`.*a call of this run goes on.*call it between its steps") as caught:
            run.run_to("0.1 s")
        assert isinstance(caught.value.__cause__, esc.RunError)


def test_state_that_is_none_is_refused():
    with esc.Run(SPRING, participants=SPRINGS) as run:
        with pytest.raises(esc.RunError, match="b'abc' is no state of a run: give what `save` returned"):
            run.restore(b"abc")
