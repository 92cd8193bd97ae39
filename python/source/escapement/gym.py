"""A scenario as an environment of gymnasium: an agent replaces a participant."""

import math
from collections.abc import Mapping

import gymnasium
import numpy as np

from . import _native
from .errors import EscapementError, RunError
from .message import Message
from .participant import Input, Output, Parameter, Participant
from .runs import Run
from .scenarios import Scenario


class Env(gymnasium.Env):
    """The scenario with an agent that replaces the participant `agent`.

    An observation holds the values of the participant's inputs at an activation, an action those of its outputs, each as a flat array of
    doubles in the order of ports and fields. **An action takes effect at the same activation from whose inputs it was chosen**, as with the
    participant itself: for a sampled participant at that instant, for a continuous one a period later. So an agent that implements the
    participant's law produces the tape of the run with the participant, byte for byte. If the participant can run in this process, it is
    still created but never stepped: a continuous one writes its first sample.

    `reward(observation, action, t)` returns a number. Or `reward` names figures of the scenario with weights: `{"overshoot": -1.0}`. The reward
    of a step is then the increase of their weighted sum, so the rewards of an episode add up to the sum of the whole run; a figure that has no
    value yet counts as zero. With `reward_at="end"` the last step yields the whole reward.

    `terminated(observation, t)` returns whether the episode is over. It is truncated at the scenario's end: the last observation is the one
    before. The failure of a participant or the violation of a guard terminates it, with the reason in `info["failure"]`. Bounds of
    the spaces are those of the guards, and of `ranges`: `{"push.force": (-20.0, 20.0)}`, by port and field of the participant; others are
    infinite.

    `reset()` restores a checkpoint in memory, or starts a new run if a participant cannot be saved; `reset(seed=…)` starts a run with
    another seed of the scenario. A run belongs to the thread that calls `reset`: another thread needs an environment of its own.
    """

    metadata = {"render_modes": []}

    def __init__(self, scenario, agent, *, reward, reward_at="step", terminated=None, ranges=None, set=None, participants=None, faults=()):
        if not isinstance(scenario, Scenario):
            scenario = Scenario(scenario, set=set, participants=participants, faults=faults)
        elif set or participants or faults:
            raise EscapementError("`set`, `participants` and `faults` belong to a scenario that is read here: give them to Scenario(…)")
        checked = scenario.check()
        known = checked["participants"]
        if agent not in known:
            raise EscapementError(f"there is no participant `{agent}`; there is {', '.join(f'`{name}`' for name in known)}")
        self.agent, self._terminated = agent, terminated
        self._interface = known[agent]
        table = scenario.to_dict()
        self._parameters = list(table["participants"][agent].get("parameters", {}))
        bounds = _bounds(table, agent, known, ranges or {})
        observed, acted = _layout(self._interface["inputs"]), _layout(self._interface["outputs"])
        if not acted:
            raise EscapementError(f"`{agent}` has no output: an agent acts by its outputs")
        self.observation_space = _space(observed, bounds)
        self.action_space = _space(acted, bounds)
        # Observation and action: the native module writes and reads these arrays.
        self.observation, self.action = np.zeros(self.observation_space.shape), np.zeros(self.action_space.shape)
        self._reward = reward if callable(reward) else _Figures(reward, reward_at, checked["figures"])
        if callable(reward) and reward_at != "step":
            raise EscapementError(f"reward_at={reward_at!r} goes with figures: a function is asked at every step")
        places = scenario._participants
        if not scenario._native.runs_here():
            places = {**places, agent: _class_of(self._interface, self._parameters)}
        self._scenario = Scenario(
            scenario.file, set=scenario._sets, participants=places, faults=scenario._faults, text=scenario._text
        )
        (period, offset) = self._scenario._native.timing(agent)
        # Instants as integer multiples of a common fraction of a second.
        self._parts = math.lcm(period[1], offset[1])
        self._period, self._offset = (part[0] * (self._parts // part[1]) for part in (period, offset))
        self._run = self._start = self._native = self._advance = None
        self._run_seed = self._scenario.seed
        self._steps = 0

    def reset(self, *, seed=None, options=None):
        """Returns to the start of the run; with a seed, to the start of a run with that seed."""
        super().reset(seed=seed)
        if (seed is not None and seed != self._run_seed) or self._start is None:
            self.close()
            if seed is not None:
                self._scenario.set("seed", int(seed))
                self._run_seed = seed
            self._run = Run(self._scenario, in_process=True, record="memory")
            self._native = self._run._native
            self._advance = _native.Agent(self._native, self.agent, self.observation, self.action).advance
            try:
                self._start = self._run.save()
            except RunError:
                # Without a checkpoint every episode is a new run.
                self._start = None
        else:
            self._run.restore(self._start)
        self.action[:] = 0.0
        self._steps = 0
        if isinstance(self._reward, _Figures):
            self._reward.begin()
        t = self._advance(self._native, False)
        if t is None:
            self.close()
            raise EscapementError(f"`{self.agent}` has no activation before the end of the scenario")
        return self.observation.copy(), {"t": t}

    def step(self, action):
        """Applies an action, and advances the run to the next activation."""
        if self._run is None:
            raise EscapementError("the environment has no run, or its run has failed: reset it")
        self._run.check_thread()
        self.action[:] = action
        self._steps += 1
        try:
            t = self._advance(self._native, True)
        except RunError as error:
            return self._failed(error)
        truncated = t is None
        if truncated:
            t = (self._offset + self._steps * self._period) / self._parts
        observation = self.observation.copy()
        over = self._terminated is not None and bool(self._terminated(observation, t))
        return observation, self._value(observation, t, over or truncated), over, truncated, {"t": t}

    def _value(self, observation, t, last):
        if isinstance(self._reward, _Figures):
            return self._reward.after(self._native, last)
        return float(self._reward(observation, self.action, t))

    def _failed(self, error):
        if self._run._interrupt.is_requested():
            raise KeyboardInterrupt from None
        t = (self._offset + self._steps * self._period) / self._parts
        observation = self.observation.copy()
        value = self._value(observation, t, True)
        self.close()
        return observation, value, True, False, {"t": t, "failure": str(error)}

    def outcome(self):
        """Ends the run of this episode at its present time, and returns its figures and the digest of its tape. `reset` starts another run."""
        if self._run is None:
            raise EscapementError("the environment has no run, or its run has failed: reset it")
        self._run.check_thread()
        run, self._run = self._run, None
        self.close()
        return run.end()

    def close(self):
        """Ends the run."""
        if self._run is not None:
            self._run.check_thread()
            self._native.close()
        self._run = self._start = self._native = self._advance = None


class _Figures:
    """A reward computed from figures."""

    def __init__(self, weights, at, known):
        if not isinstance(weights, Mapping) or not weights:
            raise EscapementError("reward: give a function, or figures with weights such as {\"overshoot\": -1.0}")
        for name in weights:
            if name not in known:
                there = ", ".join(f"`{one}`" for one in known) or "none: declare measures"
                raise EscapementError(f"reward: the scenario has no figure `{name}`; there is {there}")
        if at not in ("step", "end"):
            raise EscapementError(f'reward_at={at!r}: write "step" or "end"')
        self._names, self._weights = list(weights), [float(weight) for weight in weights.values()]
        self._at_end = at == "end"
        self.begin()

    def begin(self):
        self._before = 0.0

    def after(self, run, last):
        if self._at_end and not last:
            return 0.0
        values = zip(self._weights, run.figures(self._names))
        now = math.fsum(weight * value for weight, value in values if value is not None)
        added, self._before = now - self._before, now
        return added


class Policy:
    """`Policy.of(env, function)`: the participant that acts as an agent in `env` whose actions are `function(observation)`."""

    @staticmethod
    def of(env, function):
        """The class; pass it to `run` as the participant's replacement."""
        first = _first_sample(env) if env._interface["kind"] == "continuous" else None

        class PolicyParticipant(_class_of(env._interface, env._parameters)):
            def __init__(self):
                self.observation = np.empty(env.observation_space.shape)

            def initialise(self, t):
                if first is not None:
                    self._act(first)

            def step(self, t, dt):
                self._act(np.asarray(function(self._observe(self.observation).copy()), dtype=float))

        return PolicyParticipant


def _first_sample(env):
    """The outputs of a continuous participant before its first activation, as a flat array."""
    values = []
    with Run(env._scenario, in_process=True, record="memory") as run:
        for port in env._interface["outputs"]:
            sample = run.newest(f"{env.agent}.{port}").message
            values += [np.asarray(sample[part], dtype=float).reshape(-1) for part in sample.fields]
    return np.concatenate(values)


def _layout(ports):
    """Port, field and number of elements of each part of a flat array."""
    return [
        (port, part["name"], int(np.prod(part["shape"], dtype=int)))
        for port, descriptor in ports.items()
        for part in descriptor["fields"]
    ]


def _space(layout, bounds):
    low = [np.full(count, bounds.get((port, field), (-np.inf, np.inf))[0]) for port, field, count in layout]
    high = [np.full(count, bounds.get((port, field), (-np.inf, np.inf))[1]) for port, field, count in layout]
    empty = [np.zeros(0)]
    return gymnasium.spaces.Box(np.concatenate(low or empty), np.concatenate(high or empty), dtype=np.float64)


def _bounds(table, agent, known, ranges):
    """The bounds of the agent's fields: from guards on its outputs, from guards on the outputs that its inputs read, and from `ranges`."""
    reads = {}
    for connection in table.get("connections", {}).values():
        to = connection["to"]
        for port in [to] if isinstance(to, str) else to:
            name, _, own = port.partition(".")
            if name == agent:
                reads.setdefault(connection["from"], []).append(own)
    bounds = {}
    for guard in table.get("guards", {}).values():
        field, limits = guard.get("field", ""), guard.get("range")
        name, _, output = guard["output"].partition(".")
        parts = {part["name"]: part for part in known[name]["outputs"][output]["fields"]}
        if limits is None or field not in parts:
            continue
        low_high = tuple(_native.convert(limits, parts[field]["unit"]) if isinstance(limits, str) else map(float, limits))
        own = [output] if name == agent else reads.get(guard["output"], [])
        bounds.update({(port, field): low_high for port in own})
    ports = {**known[agent]["inputs"], **known[agent]["outputs"]}
    for key, low_high in ranges.items():
        port, _, field = key.partition(".")
        if port not in ports or field not in [part["name"] for part in ports[port]["fields"]]:
            fields = [f"`{one}.{part['name']}`" for one, descriptor in ports.items() for part in descriptor["fields"]]
            raise EscapementError(f"ranges: `{agent}` has no `{key}`; it has {', '.join(fields)}")
        bounds[port, field] = low_high
    return bounds


def _class_of(interface, parameters):
    """A participant class with the ports and parameters of another participant."""
    space = {}
    for at, (name, descriptor) in enumerate(interface["inputs"].items()):
        space[f"in_{at}"] = Input(Message.of(descriptor), required=False, name=name)
    for at, (name, descriptor) in enumerate(interface["outputs"].items()):
        space[f"out_{at}"] = Output(Message.of(descriptor), name=name)
    for at, key in enumerate(parameters):
        space[f"parameter_{at}"] = Parameter(key=key, default=None)
    inputs = [(f"in_{at}", _layout({name: descriptor})) for at, (name, descriptor) in enumerate(interface["inputs"].items())]
    outputs = [(f"out_{at}", _layout({name: descriptor})) for at, (name, descriptor) in enumerate(interface["outputs"].items())]

    def fields_of(self, ports):
        """The memory of each field, with its position in a flat array."""
        made, start = [], 0
        for attribute, layout in ports:
            for _, field, count in layout:
                view = getattr(self, attribute)._memory_of(field)
                made.append((view.reshape(-1), slice(start, start + count)))
                start += count
        return made

    def observe(self, flat):
        if "_esc_input_fields" not in self.__dict__:
            self.__dict__["_esc_input_fields"] = fields_of(self, inputs)
        for view, place in self.__dict__["_esc_input_fields"]:
            flat[place] = view
        return flat

    def act(self, flat):
        if "_esc_output_fields" not in self.__dict__:
            self.__dict__["_esc_output_fields"] = fields_of(self, outputs)
        for view, place in self.__dict__["_esc_output_fields"]:
            view[...] = flat[place]

    space.update(kind=interface["kind"], _observe=observe, _act=act, step=lambda self, t, dt: None)
    return type("AgentParticipant", (Participant,), space)
