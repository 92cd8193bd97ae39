"""A scenario as an environment of gymnasium: an agent takes a participant's place."""

import math

import gymnasium
import numpy as np

from . import _native
from .errors import EscapementError, RunError
from .message import Message
from .participant import Input, Output, Parameter, Participant
from .runs import Run
from .scenarios import Scenario


class Env(gymnasium.Env):
    """The scenario with `agent` in the place of a participant.

    An observation is what the participant's inputs show at an activation, an action what its outputs give, each as a flat array of
    doubles in the order of ports and fields. **An action is given out at the activation after the one whose inputs it was chosen
    from**: one period of the participant lies between seeing and acting, as in a controller that takes its period to compute. `Policy`
    makes of a function the participant that acts in the same way, so that a run of it has the tape of the episode.

    `reward(observation, action, t)` gives a number, `terminated(observation, t)` says whether the episode is over. It is truncated at the
    scenario's end. A participant that fails, or a guard that is violated, terminates it with the reason in `info["failure"]`. Bounds of
    the spaces are those of the guards, and of `ranges`: `{"push.force": (-20.0, 20.0)}`, by port and field of the participant; others are
    infinite.

    `reset()` goes back to a checkpoint in memory; `reset(seed=…)` begins a run with another seed of the scenario.
    """

    metadata = {"render_modes": []}

    def __init__(self, scenario, agent, *, reward, terminated=None, ranges=None, set=None, participants=None, faults=()):
        if not isinstance(scenario, Scenario):
            scenario = Scenario(scenario, set=set, participants=participants, faults=faults)
        elif set or participants or faults:
            raise EscapementError("`set`, `participants` and `faults` belong to a scenario that is read here: give them to Scenario(…)")
        known = scenario.check()["participants"]
        if agent not in known:
            raise EscapementError(f"there is no participant `{agent}`; there is {', '.join(f'`{name}`' for name in known)}")
        self.agent, self._reward, self._terminated = agent, reward, terminated
        self._seat = known[agent]
        if self._seat["kind"] != "sampled":
            raise EscapementError(f"`{agent}` is continuous: an agent takes the place of a sampled participant")
        table = scenario.to_dict()
        self._parameters = list(table["participants"][agent].get("parameters", {}))
        bounds = _bounds(table, agent, known, ranges or {})
        self._seen, self._given = _layout(self._seat["inputs"]), _layout(self._seat["outputs"])
        if not self._given:
            raise EscapementError(f"`{agent}` has no output: an agent acts by its outputs")
        self.observation_space = _space(self._seen, bounds)
        self.action_space = _space(self._given, bounds)
        self._scenario = Scenario(
            scenario.file,
            set=scenario._sets,
            participants={**scenario._participants, agent: _seat_of(self, self._seat, self._parameters)},
            faults=scenario._faults,
            text=scenario._text,
        )
        (period, offset) = self._scenario._native.timing(agent)
        # Instants as whole numbers of a common part of a second.
        self._parts = math.lcm(period[1], offset[1])
        self._period, self._offset = (part[0] * (self._parts // part[1]) for part in (period, offset))
        self._run = self._start = None
        self._run_seed = self._scenario.seed
        self._steps = 0

    def _behind(self, step):
        """Just behind activation `step`, before any other instant: the plan rounds up to its own tick."""
        return f"{2 * (self._offset + step * self._period) + 1}/{2 * self._parts} s"

    def _t(self):
        return (self._offset + self._steps * self._period) / self._parts

    def reset(self, *, seed=None, options=None):
        """Back to the beginning; with a seed, the beginning of a run with that seed."""
        super().reset(seed=seed)
        if seed is not None and seed != self._run_seed or self._run is None:
            self.close()
            if seed is not None:
                self._scenario.set("seed", int(seed))
                self._run_seed = seed
            self.action = np.zeros(self.action_space.shape)
            self._run = Run(self._scenario, in_process=True, record="memory")
            self._run._native.run_to(self._behind(0))
            self._start = self._run.save()
        else:
            self.action = np.zeros(self.action_space.shape)
            self._run.restore(self._start)
        self._steps = 0
        return self._first(), {"t": self._t()}

    def _first(self):
        # What the first activation saw: going back brings the participant's state back, not what its ports showed.
        if not hasattr(self, "_first_seen") or self._first_of is not self._start:
            self._first_seen, self._first_of = self.seen.copy(), self._start
        self.seen[:] = self._first_seen
        return self._first_seen.copy()

    def step(self, action):
        """Acts, and lets everybody on to the next activation."""
        if self._run is None:
            raise EscapementError("the environment is not begun, or its run has failed: reset it")
        self.action[:] = action
        self._steps += 1
        info = {"t": self._t()}
        failed = truncated = False
        try:
            if info["t"] >= self._scenario.duration:
                truncated = True
            else:
                self._run._native.run_to(self._behind(self._steps))
        except RunError as error:
            failed, info["failure"] = True, str(error)
            self.close()
        seen = self.seen.copy()
        over = failed or bool(self._terminated and self._terminated(seen, info["t"]))
        return seen, float(self._reward(seen, self.action, info["t"])), over, truncated, info

    def close(self):
        """Ends the run."""
        if self._run is not None:
            self._run._native.close()
            self._run = self._start = None


class Policy:
    """`Policy.of(env, function)`: a participant that acts as an agent in `env` does whose actions are `function(observation)`."""

    @staticmethod
    def of(env, function):
        """The class; give it as the participant's place in `run`."""

        class Acts(_class_of(env._seat, env._parameters)):
            def __init__(self):
                self.action = np.zeros(env.action_space.shape)

            def step(self, t, dt):
                self._give(self.action)
                self.action = np.asarray(function(self._see(np.empty(env.observation_space.shape))), dtype=float)

        return Acts


def _layout(ports):
    """Port, field, number of elements of everything that a flat array holds."""
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
    """The bounds of the agent's fields: of guards over its outputs, of those over the outputs that its inputs read, and as given."""
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


def _class_of(seat, parameters):
    """A participant with the ports and parameters of another one."""
    space = {}
    for at, (name, descriptor) in enumerate(seat["inputs"].items()):
        space[f"in_{at}"] = Input(Message.of(descriptor), required=False, name=name)
    for at, (name, descriptor) in enumerate(seat["outputs"].items()):
        space[f"out_{at}"] = Output(Message.of(descriptor), name=name)
    for at, key in enumerate(parameters):
        space[f"parameter_{at}"] = Parameter(key=key, default=None)
    inputs = [(f"in_{at}", _layout({name: descriptor})) for at, (name, descriptor) in enumerate(seat["inputs"].items())]
    outputs = [(f"out_{at}", _layout({name: descriptor})) for at, (name, descriptor) in enumerate(seat["outputs"].items())]

    def pieces(self, ports):
        """The memory of each field, with its place in a flat array."""
        made, start = [], 0
        for attribute, layout in ports:
            for _, field, count in layout:
                view = getattr(self, attribute)._memory_of(field)
                made.append((view.reshape(-1), slice(start, start + count)))
                start += count
        return made

    def see(self, flat):
        if "_esc_in" not in self.__dict__:
            self.__dict__["_esc_in"] = pieces(self, inputs)
        for view, place in self.__dict__["_esc_in"]:
            flat[place] = view
        return flat

    def give(self, flat):
        if "_esc_out" not in self.__dict__:
            self.__dict__["_esc_out"] = pieces(self, outputs)
        for view, place in self.__dict__["_esc_out"]:
            view[...] = flat[place]

    space.update(_see=see, _give=give, step=lambda self, t, dt: None)
    return type("Seat", (Participant,), space)


def _seat_of(env, seat, parameters):
    """The participant through which an agent sees and acts."""
    env.seen = np.zeros(sum(count for _, _, count in env._seen))
    env.action = np.zeros(sum(count for _, _, count in env._given))

    class Agent(_class_of(seat, parameters)):
        def step(self, t, dt):
            self._give(env.action)
            self._see(env.seen)

        def save(self):
            return b""

        def restore(self, state):
            pass

    return Agent
