"""What a participant's class may be: names, functions and states that are refused."""

import numpy as np
import pytest
from test_participants import ALONE, Flow, Level, Pump, refused

import escapement as esc


@pytest.mark.parametrize("name", ["save", "terminate", "log", "name", "period", "seed", "kind", "step", "is_seen"])
def test_port_or_parameter_does_not_hide_a_member(name):
    for made, what in [
        (esc.Output(Level), f"output `{name}` .* by name='{name}'"),
        (esc.Input(Flow), f"input `{name}` .* by name='{name}'"),
        (esc.Parameter("1"), f"parameter `{name}` .* by key='{name}'"),
    ]:
        with pytest.raises(esc.EscapementError, match=f"`Tank`: its {what}"):
            type("Tank", (esc.Participant,), {name: made})


def test_port_may_have_such_a_name(scenario):
    class Tank(esc.Participant):
        log_port = esc.Output(Level, name="log")

        def step(self, t, dt):
            self.log_port.height = t

    assert len(esc.run(scenario(ALONE), participants={"tank": Tank})["tank.log"]) == 10


def test_function_that_a_call_does_not_run_is_refused(scenario):
    class Waits(esc.Participant):
        level = esc.Output(Level)

        async def step(self, t, dt):
            self.level.height = 1.0

    class Yields(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            yield

    class Begins(Pump):
        async def initialise(self, t):
            yield

    assert "`step` of `Waits` is declared with `async`" in str(refused(scenario, Waits))
    assert "`step` of `Yields` has a `yield` in it" in str(refused(scenario, Yields))
    assert "`initialise` of `Begins` is declared with `async`" in str(refused(scenario, Begins))


@pytest.mark.parametrize(
    "state, type_name",
    [
        (5, "an int"), ([1, 2, 3], "a list"), (None, "NoneType"), ("abc", "a str"), (1.5, "a float"), (True, "a bool"),
        (np.array([None]), "a ndarray"), ((b"a",), "a tuple"),
    ],
)
def test_state_that_is_not_bytes_is_refused_with_its_type(scenario, state, type_name):
    class Keeps(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            pass

        def save(self):
            return state

    error = refused(scenario, Keeps, checkpoint_at="500 ms")
    assert "tank" in str(error) and f"`save` of `Keeps` returned {type_name}, not the state as bytes" in str(error.__cause__)


@pytest.mark.parametrize("state", [b"12345678", bytearray(b"12345678"), memoryview(b"12345678"), np.frombuffer(b"12345678", "<f8")])
def test_state_is_anything_like_bytes(scenario, state):
    got = []

    class Keeps(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            pass

        def save(self):
            return state

        def restore(self, state):
            got.append(state)

    with esc.Run(scenario(ALONE), participants={"tank": Keeps}) as run:
        run.restore(run.save())
    assert got == [b"12345678"]
