"""Participants in Python: their features, and mistakes that give one clear error with the participant's name."""

import gc
import sys

import numpy as np
import pytest

import escapement as esc


class Level(esc.Message):
    height = esc.Field("m")
    parts = esc.Field("m", shape=3)


class Flow(esc.Message):
    rate = esc.Field("1/s")


ALONE = """
duration = "1 s"
[participants.tank]
run = { exe = "/bin/true" }
period = "100 ms"
"""

FED = ALONE + """
[participants.pump]
run = { exe = "/bin/true" }
period = "50 ms"
[connections.flow]
from = "pump.flow"
to = "tank.flow"
"""


class Pump(esc.Participant):
    flow = esc.Output(Flow)

    def step(self, t, dt):
        self.flow.rate = t


def test_class_runs_and_has_a_tape(scenario):
    class Tank(esc.Participant):
        kind = "continuous"
        flow = esc.Input(Flow)
        level = esc.Output(Level)

        def __init__(self):
            self.height = 1.0

        def initialise(self, t):
            self.level.height = self.height

        def step(self, t, dt):
            self.height += dt * self.flow.rate
            self.level.height = self.height
            self.level.parts = self.height * np.arange(3)

    run = esc.run(scenario(FED), participants={"tank": Tank, "pump": Pump})
    level = run["tank.level"]
    assert len(level) == 11 and level.t[0] == 0.0 and level.t[-1] == 1.0
    assert level.height[0] == 1.0
    assert level.height[-1] == pytest.approx(1.0 + 0.1 * sum(at / 10 for at in range(10)))
    assert level.parts[-1].tolist() == [0.0, level.height[-1], 2 * level.height[-1]]
    assert run.verdict == "complete" and len(run.digest) == 64


def test_participant_knows_which_outputs_are_seen(scenario):
    seen = []

    class Tank(esc.Participant):
        kind = "continuous"
        flow = esc.Input(Flow)
        level = esc.Output(Level)
        detail = esc.Output(Level)

        def initialise(self, t):
            self.tell(t)

        def step(self, t, dt):
            self.tell(t + dt)

        def tell(self, t):
            seen.append([self.is_seen("level"), self.is_ever_seen("level"), self.is_seen("detail"), self.is_ever_seen("detail")])
            self.level.height = t if self.is_seen("level") else float("nan")
            self.detail.height = t if self.is_seen("detail") else float("nan")

    record = '[record]\ntank = { level = { every = "500 ms" }, detail = false }\n'
    run = esc.run(scenario(FED + record), participants={"tank": Tank, "pump": Pump}, in_process=True)
    assert run["tank.level"].height.tolist() == [0.0, 0.5, 1.0] and "tank.detail" not in list(run)
    assert seen == [[k % 5 == 0, True, False, False] for k in range(11)]
    seen.clear()
    esc.run(scenario(FED), participants={"tank": Tank, "pump": Pump}, in_process=True)
    assert seen == [[True] * 4] * 11
    # Called directly, every output is seen.
    assert Tank().is_seen("detail")
    with pytest.raises(AttributeError, match="'flow' is no output of `Tank`; there are level, detail"):
        Tank().is_seen("flow")


def refused(scenario, cls, text=ALONE, **how):
    with pytest.raises(esc.EscapementError) as caught:
        esc.run(scenario(text), participants={"tank": cls}, **how)
    return caught.value


def test_class_without_step_is_refused_with_file_and_line(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

    error = refused(scenario, Tank)
    assert isinstance(error, esc.ScenarioError)
    assert "participant `tank`: `Tank` has no step: define step(self, t, dt)" in str(error)
    assert error.file.endswith("own.toml") and error.key == "participants.tank.run" and error.reason in str(error)


def test_class_that_is_no_participant_is_refused(scenario):
    with pytest.raises(esc.EscapementError, match="`tank`.*is no participant"):
        esc.run(scenario(ALONE), participants={"tank": dict})
    with pytest.raises(esc.EscapementError, match="`tank`.*neither a class nor"):
        esc.run(scenario(ALONE), participants={"tank": 3})
    with pytest.raises(esc.ScenarioError, match="there is no `tonk`"):
        esc.run(scenario(ALONE), participants={"tonk": Pump})


def test_array_of_the_wrong_shape_fails_with_name_instant_and_line(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            if t > 0.25:
                self.level.parts = np.zeros(4)

    error = refused(scenario, Tank)
    assert isinstance(error, esc.RunError) and error.participant == "tank"
    assert "`tank`: failed at t = 0.3 s" in str(error) and "`parts` of `Level` has the shape (3,)" in str(error)
    assert "test_participants.py:" in str(error)
    assert isinstance(error.__cause__, esc.MessageError)
    # The tape has the samples before the failure, and the log has the traceback.
    assert len(error.run["tank.level"]) == 3
    assert "Traceback" in error.run.log("tank") and "np.zeros(4)" in error.run.log("tank")


def test_misspelt_field_fails_with_name_instant_and_line(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            self.level.hieght = t

    error = refused(scenario, Tank)
    assert "`tank`: failed at t = 0 s" in str(error) and "`Level` has no field `hieght`; it has `height`, `parts`" in str(error)
    assert "test_participants.py:" in str(error) and isinstance(error.__cause__, AttributeError)


def test_exception_is_reported_with_its_message_and_notes(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            error = ValueError("the tank is \udc80 empty")
            error.add_note("fill it")
            error.add_note("or stop")
            raise error

    error = refused(scenario, Tank)
    text, log = str(error), error.run.log("tank")
    assert "ValueError: the tank is \\udc80 empty (" in text and "in step); fill it; or stop" in text
    assert "the tank is \\udc80 empty" in log and "or stop" in log


def test_log_line_that_is_not_unicode_is_escaped(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            if t == 0.0:
                self.log("the name \udc80 of a file")

    log = esc.run(scenario(ALONE), participants={"tank": Tank}, in_process=True).log("tank")
    assert log == "tank at t = 0 s: the name \\udc80 of a file\n"


def test_value_that_is_not_finite_is_named(scenario):
    class Tank(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            self.level.height = float("nan")

    assert "height" in str(refused(scenario, Tank)) and "NaN" in str(refused(scenario, Tank))


def test_input_is_read_only_and_a_port_stays(scenario):
    class Writes(esc.Participant):
        flow = esc.Input(Flow, required=False)
        level = esc.Output(Level)

        def step(self, t, dt):
            self.flow.rate = 1.0

    assert "belongs to an input, which is read only" in str(refused(scenario, Writes))

    class Replaces(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            self.level = 1.0

    assert "`level` is an output of `Replaces`: write to its fields" in str(refused(scenario, Replaces))


def test_message_unlike_the_peers_is_refused_with_the_difference(scenario):
    class Other(esc.Message):
        rate = esc.Field("1/min")

    class Tank(esc.Participant):
        flow = esc.Input(Other)
        level = esc.Output(Level)

        def step(self, t, dt):
            pass

    with pytest.raises(esc.ScenarioError) as caught:
        esc.run(scenario(FED), participants={"tank": Tank, "pump": Pump})
    assert "1/min" in str(caught.value) and "1/s" in str(caught.value) and "tank" in str(caught.value)
    assert caught.value.line == 10


PARAMETERS = ALONE + 'parameters = { mass = "500 g", at = "[1, 2, 3] cm", name = "x" }\n'


class Weighs(esc.Participant):
    level = esc.Output(Level)
    mass = esc.Parameter("kg")
    at = esc.Parameter("m", count=3)
    label = esc.Parameter(key="name")
    spare = esc.Parameter("1", default=2.0)

    def step(self, t, dt):
        self.level.height = self.mass * self.spare
        self.level.parts = self.at


def test_parameters_have_their_units(scenario):
    run = esc.run(scenario(PARAMETERS), participants={"tank": Weighs})
    assert run["tank.level"].height[0] == 1.0
    assert run["tank.level"].parts[0].tolist() == [0.01, 0.02, 0.03]


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("mass", "3 m", "participants.tank.parameters.mass"),
        ("mas", 3, "knows no such parameter; there is `at`"),
        ("at", "[1, 2] m", "3 numbers in brackets"),
    ],
)
def test_parameters_are_refused_with_their_key(scenario, key, value, message):
    with pytest.raises(esc.ScenarioError, match=message) as caught:
        esc.run(scenario(PARAMETERS), participants={"tank": Weighs}, set={f"participants.tank.parameters.{key}": value})
    assert caught.value.key == f"participants.tank.parameters.{key}"


def test_own_refusal_names_the_key(scenario):
    class Picky(Weighs):
        def __init__(self):
            raise esc.ParameterError("mass", "too heavy")

    with pytest.raises(esc.ScenarioError) as caught:
        esc.run(scenario(PARAMETERS), participants={"tank": Picky})
    assert (caught.value.line, caught.value.key, caught.value.reason) == (6, "participants.tank.parameters.mass", "too heavy")


def test_interpreter_that_is_missing_is_named(scenario):
    text = ALONE.replace("/bin/true", "python9")
    with pytest.raises(esc.ScenarioError, match="there is no program `python9` in PATH") as caught:
        esc.run(scenario(text))
    assert caught.value.line == 4


def test_file_or_class_that_is_missing_is_named(scenario, tmp_path):
    (tmp_path / "empty.py").write_text("import escapement as esc\nclass Real(esc.Participant):\n    def step(self, t, dt): pass\n")
    for name, message in [("gone.py:Tank", "there is no file"), ("empty.py:Tank", "no class `Tank`; its participants are `Real`"), ("empty", "names no class")]:
        for here in (True, False):
            with pytest.raises(esc.EscapementError, match=message) as caught:
                esc.run(scenario(ALONE), participants={"tank": name}, in_process=here, out=tmp_path / "out", force=True)
            assert "tank" in str(caught.value)


def test_interpreter_without_the_package_is_named(scenario, tmp_path):
    text = ALONE.replace('{ exe = "/bin/true" }', f'{{ exe = "{sys.executable}", args = ["-S", "-m", "escapement.host", "x.py:X"] }}')
    with pytest.raises(esc.EscapementError, match="No module named") as caught:
        esc.run(scenario(text))
    assert "`tank`" in str(caught.value)


def test_state_that_cannot_be_saved_is_named(scenario):
    class Holds(esc.Participant):
        level = esc.Output(Level)

        def __init__(self):
            self.handle = (number for number in range(3))

        def step(self, t, dt):
            pass

    error = refused(scenario, Holds, checkpoint_at="500 ms")
    assert "tank" in str(error) and "its `save` failed" in str(error) and "its attribute `handle` cannot be pickled" in str(error)


def test_random_samples_depend_on_seed_and_name_alone(scenario):
    class Draws(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            self.level.height = self.uniform("noise", round(t / dt))
            self.level.parts = self.normal("noise", round(t / dt))

    one = esc.run(scenario(ALONE), participants={"tank": Draws})
    two = esc.run(scenario(ALONE), participants={"tank": Draws})
    other = esc.run(scenario(ALONE), participants={"tank": Draws}, set={"seed": 2})
    assert one.digest == two.digest != other.digest
    assert 0.0 <= one["tank.level"].height.min() and one["tank.level"].height.max() < 1.0


def test_arrays_are_allocated_once(scenario):
    made = []

    class Steady(esc.Participant):
        flow = esc.Input(Flow)
        level = esc.Output(Level)

        def step(self, t, dt):
            made.append((id(self.level.parts), self.level.parts.__array_interface__["data"][0], id(self.flow)))
            self.level.parts += self.flow.rate

    esc.run(scenario(FED), participants={"tank": Steady, "pump": Pump})
    assert len(set(made)) == 1 and len(made) == 10


def test_terminate_is_called(scenario):
    ended = []

    class Ends(esc.Participant):
        level = esc.Output(Level)

        def step(self, t, dt):
            pass

        def terminate(self):
            ended.append(self.name)

    esc.run(scenario(ALONE), participants={"tank": Ends})
    assert ended == ["tank"]
    # A participant that is only queried for its ports is not part of a run.
    esc.Scenario(scenario(ALONE), participants={"tank": Ends}).check()
    gc.collect()
    assert ended == ["tank"]


DIARY = '''
import escapement as esc


class Page(esc.Message):
    number = esc.Field("1", element="u64")


class Diary(esc.Participant):
    page = esc.Output(Page)
    fails_at = esc.Parameter(default=None, key="fails-at")

    def __init__(self):
        self.number = 0

    def initialise(self, t):
        self.log("begins")

    def step(self, t, dt):
        self.number += 1
        self.page.number = self.number
        if self.number == 3:
            self.log(f"is at page {self.number}")
        if self.number - 1 == self.fails_at:
            raise RuntimeError("has no more pages")

    def terminate(self):
        self.log(f"ends, {self.termination}, at page {self.number}")
'''

# As in tests/tests/participant_logs.rs, which covers the other languages.
DIARIES = """
duration = "50 ms"
[participants.first]
run = { exe = "python3", args = ["-m", "escapement.host", "diary.py:Diary"] }
period = "10 ms"
[participants.second]
run = { exe = "python3", args = ["-m", "escapement.host", "diary.py:Diary"] }
period = "20 ms"
"""
BEGINS = "first at t = 0 s: begins\nfirst at t = 0.02 s: is at page 3\n"


@pytest.mark.parametrize("here", [True, False])
def test_log_and_termination_equal_those_of_other_languages(scenario, tmp_path, here):
    (tmp_path / "diary.py").write_text(DIARY)
    path = scenario(DIARIES.replace("python3", sys.executable))
    run = esc.run(path, in_process=here, out=tmp_path / "run")
    assert run.log("first") == BEGINS + "first at t = 0.05 s: ends, finished, at page 5\n"
    fault = f'at=30ms,substitute=first,state=keep,run={{ exe = "{sys.executable}", args = ["-m", "escapement.host", "diary.py:Diary"] }}'
    run = esc.run(path, in_process=here, out=tmp_path / "replaced", faults=[fault])
    logs = run.log("first") + ("" if here else run.log("first.1"))
    newcomer = "first at t = 0.03 s: begins\nfirst at t = 0.05 s: ends, finished, at page 5\n"
    assert logs == BEGINS + "first at t = 0.03 s: ends, replaced, at page 3\n" + newcomer
    with pytest.raises(esc.RunError) as raised:
        esc.run(path, in_process=here, out=tmp_path / "failed", set={"participants.second.parameters.fails-at": 1})
    own = [line for line in raised.value.run.log("second").splitlines() if line.startswith("second at t = ")]
    assert own == ["second at t = 0 s: begins", "second at t = 0.02 s: ends, stopped, at page 2"]
    first = raised.value.run.log("first")
    # In a separate process it may not have started by then; `terminate` is then not called.
    assert first.count("ends, ") == first.count("begins") <= 1 and (not here or "ends, stopped" in first)


def test_outcome_without_a_folder_contains_the_log(scenario, tmp_path):
    (tmp_path / "diary.py").write_text(DIARY)
    path = scenario(DIARIES)
    outcome = esc.run(path, in_process=True, record="digest")
    assert outcome.log("first") == BEGINS + "first at t = 0.05 s: ends, finished, at page 5\n"
    with esc.Run(path, in_process=True) as run:
        run.run_to("30 ms")
        assert run.log("first") == BEGINS
        with pytest.raises(esc.RunError, match="there is no such participant; there is `first`, `second`"):
            run.log("nobody")
