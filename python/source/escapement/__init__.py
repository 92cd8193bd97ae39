"""Lockstep co-simulation from Python: participants, runs, and tapes as numpy arrays.

    import escapement as esc

    class Motion(esc.Message):
        position = esc.Field("m", frame="N")
        velocity = esc.Field("m/s", frame="N")

    class Push(esc.Message):
        force = esc.Field("N", frame="N")

    class Pid(esc.Participant):
        measured = esc.Input(Motion)
        push = esc.Output(Push)

        def step(self, t, dt):
            self.push.force = -40.0 * self.measured.position - 8.0 * self.measured.velocity

    run = esc.run("scenario.toml", set={"connections.measured.delay": "10 ms"}, participants={"controller": Pid})
    run["plant.motion"].position
"""

from ._native import version as _version
from .errors import (
    EscapementError,
    MessageError,
    Mistake,
    OptionError,
    ParameterError,
    PortError,
    ProgramError,
    RunError,
    ScenarioError,
    ScenarioWarning,
    TapeError,
)
from .message import Field, Message
from .participant import Input, Output, Parameter, Participant
from .runs import Outcome, Run, Sample, resume, run
from .scenarios import Scenario
from .sweeps import sweep
from .tape import Page, RunFolder, Stream
from .tape import open_run as open

__version__ = _version()

__all__ = [
    "EscapementError", "Field", "Input", "Message", "MessageError", "Mistake", "OptionError", "Outcome", "Output", "Page", "Parameter",
    "ParameterError", "Participant", "PortError", "ProgramError", "Run", "RunError", "RunFolder", "Sample", "Scenario", "ScenarioError", "ScenarioWarning",
    "Stream", "TapeError", "open", "resume", "run", "sweep",
]
