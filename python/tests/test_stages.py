"""`esc.Run`: a run that is advanced in stages: inputs set from code, and calls that are refused."""

import enum

import pytest

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
    "values, error, said",
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
def test_values_that_do_not_fit_a_port_are_refused(values, error, said):
    with sink() as run, pytest.raises(error, match=said):
        run.set("sink.order", **values)


def test_port_that_does_not_exist_is_refused_with_those_there_are():
    with sink() as run, pytest.raises(esc.PortError, match="`sink` has no input `odrer`; it has `order`"):
        run.set("sink.odrer", count=1)
