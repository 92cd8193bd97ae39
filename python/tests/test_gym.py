"""Environments of gymnasium."""

import threading
import warnings

import numpy as np
import pytest
from conftest import PID, ROOT, SPRING

import escapement as esc
import pid as loop
from spring import Spring

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from escapement.gym import Env, Policy  # noqa: E402

LOOP = {"plant": loop.Plant, "controller": loop.Pid, "reference": loop.Reference}
RANGES = {"push.force": (-20.0, 20.0)}


def reward(observation, action, t):
    return -abs(observation[2] - observation[0])


def env(**options):
    return Env(PID, "controller", reward=reward, participants=LOOP, ranges=RANGES, **options)


def test_checker_of_gymnasium_passes():
    with warnings.catch_warnings(record=True) as caught_warnings:
        warnings.simplefilter("always")
        check_env(env(), skip_render_check=True)
    # The positions have no bounds, and nothing registers it.
    unexpected = [str(one.message) for one in caught_warnings if not any(word in str(one.message) for word in ("infinity", "inf", "spec"))]
    assert not unexpected, unexpected


def act(observation):
    return np.clip([400.0 * (observation[2] - observation[0]) - 40.0 * observation[1]], -20.0, 20.0)


def test_episode_equals_the_run_of_the_same_policy():
    one = env()
    observation, info = one.reset()
    episode = [observation]
    truncated = False
    while not truncated:
        observation, value, over, truncated, info = one.step(act(observation))
        assert not over
        episode.append(observation)
    run = esc.run(PID, participants={**LOOP, "controller": Policy.of(one, act)})
    position = run["plant.motion"].position
    # The measurement is 7 ms old.
    assert [float(observation[0]) for observation in episode[2:-1]] == [float(position[5 * at - 7]) for at in range(2, 800)]
    assert info["t"] == 4.0 and value == reward(observation, None, 4.0)


def test_reset_returns_to_the_start():
    one = env()
    first, _ = one.reset(seed=3)

    def some():
        return [one.step([force])[0].tolist() for force in (1.0, -2.0, 3.0, 20.0, 5.0)]

    before = some()
    again, _ = one.reset()
    assert (again == first).all() and some() == before
    other, _ = one.reset(seed=4)
    assert (other == first).all() and some() == before


def test_bounds_are_those_of_guards():
    guard = {"guards.strong": {"output": "controller.push", "field": "force", "range": "[-0.02, 0.02] kN"}}
    guard["guards.near"] = {"output": "plant.motion", "field": "position", "range": "[-50, 50] cm"}
    one = Env(PID, "controller", reward=reward, participants=LOOP, set=guard)
    assert (one.action_space.low, one.action_space.high) == (-20.0, 20.0)
    assert one.observation_space.low.tolist() == [-0.5, -np.inf, -np.inf]
    # Leaving the bounds ends the episode; the next one starts from the beginning.
    one.reset()
    assert not one.step([19.0])[2]
    _, _, over, _, info = one.step([21.0])
    assert over and "controller" in info["failure"] and "strong" in info["failure"]
    one.reset()
    assert not one.step([1.0])[2]


def test_environments_in_parallel_are_independent():
    many = gymnasium.vector.SyncVectorEnv([env, env, env])
    observation, _ = many.reset()
    for _ in range(30):
        observation, *_ = many.step(np.array([[1.0], [1.0], [5.0]]))
    assert (observation[0] == observation[1]).all() and (observation[0] != observation[2]).any()
    many.close()


def test_environment_refuses_another_thread():
    one = env()
    one.reset()
    errors = []

    def use():
        for call in (lambda: one.step(one.action_space.sample()), one.reset, one.outcome, one.close):
            try:
                call()
            except esc.RunError as error:
                errors.append(str(error))

    other = threading.Thread(target=use)
    other.start()
    other.join()
    assert len(errors) == 4 and all("belongs to the thread that started it" in error for error in errors)
    one.step(np.array([1.0]))
    one.close()


def test_invalid_environment_is_refused():
    with pytest.raises(esc.EscapementError, match="no participant `pilot`; there is"):
        Env(PID, "pilot", reward=reward, participants=LOOP)
    with pytest.raises(esc.EscapementError, match="has no `push.torque`; it has"):
        Env(PID, "controller", reward=reward, participants=LOOP, ranges={"push.torque": (0, 1)})
    with pytest.raises(esc.EscapementError, match="reset it"):
        env().step([0.0])


def play_episode(one, act):
    observation, _ = one.reset()
    over = truncated = False
    while not (over or truncated):
        observation, _, over, truncated, info = one.step(act(observation))
    assert truncated, info
    return one.outcome()


def test_agent_with_the_law_of_the_controller_gives_its_tape():
    integral = [0.0]

    def pid(observation):
        error = observation[2] - observation[0]
        wanted = 400.0 * (error + integral[0] / 0.3) - 40.0 * observation[1]
        force = min(max(wanted, -20.0), 20.0)
        if force == wanted:
            integral[0] += 0.005 * error
        return [force]

    whole = esc.run(PID, participants=LOOP, record="digest", in_process=True)
    one = env()
    assert play_episode(one, pid).digest == whole.digest
    # Once more, from the checkpoint at the start.
    integral[0] = 0.0
    assert play_episode(one, pid).digest == whole.digest


def test_agent_replaces_a_continuous_participant():
    springs = {"left": Spring, "right": Spring}
    mass = [0.1, 0.0]

    def spring(observation):
        acceleration = 5.0 * (observation[0] - mass[0]) - 40.0 * mass[0]
        mass[1] += 0.001 * acceleration
        mass[0] += 0.001 * mass[1]
        return mass

    whole = esc.run(SPRING, participants=springs, record="digest", in_process=True)
    one = Env(SPRING, "left", reward=lambda *_: 0.0, participants=springs)
    assert play_episode(one, spring).digest == whole.digest
    mass[:] = [0.1, 0.0]
    with_policy = esc.run(SPRING, participants={**springs, "left": Policy.of(one, spring)}, record="digest", in_process=True)
    assert with_policy.digest == whole.digest


def test_rewards_of_figures_add_up_to_those_of_the_run():
    springs = {"left": Spring, "right": Spring}
    weights = {"swing": -1.0, "apart": -3.0, "fastest": 0.5}
    for at in ("step", "end"):
        one = Env(SPRING, "left", reward=weights, reward_at=at, participants=springs, set={"duration": "2 s"})
        one.reset()
        rewards, truncated = [], False
        while not truncated:
            _, value, _, truncated, _ = one.step([0.05, 0.0])
            rewards.append(value)
        figures = one.outcome().figures
        assert sum(rewards) == pytest.approx(sum(weight * figures[name] for name, weight in weights.items()), rel=1e-12)
        assert (len([value for value in rewards if value]) == 1) == (at == "end")
        # The next episode begins at zero.
        one.reset()
        first = one.step([0.05, 0.0])[1]
        assert first == rewards[0]
    with pytest.raises(esc.EscapementError, match="no figure `overshoot`; there is `apart`, `fastest`, `swing`"):
        Env(SPRING, "left", reward={"overshoot": -1.0}, participants=springs)
    with pytest.raises(esc.EscapementError, match="reward: give a function, or figures"):
        Env(SPRING, "left", reward={}, participants=springs)
    with pytest.raises(esc.EscapementError, match='reward_at=.*"step" or "end"'):
        Env(SPRING, "left", reward=weights, reward_at="last", participants=springs)


def test_close_capture_runs_with_a_passive_agent():
    one = Env(ROOT / "scenarios" / "close.toml", "controller", reward=lambda *_: 0.0, set={"duration": "0.2 s"})
    for _ in range(2):
        observation, info = one.reset()
        assert info["t"] == 0.0 and np.isfinite(observation).all()
        steps = 1
        while not one.step(np.zeros(one.action_space.shape))[3]:
            steps += 1
        assert steps == 20


def test_whole_numbers_names_and_truth_values_are_doubles(scenario):
    import enum

    class Mode(enum.IntEnum):
        OFF = 0
        ON = 3

    class Seen(esc.Message):
        count = esc.Field("1", element="i16", shape=2)
        mode = esc.Field("1", element=Mode)
        flag = esc.Field("1", element=bool)

    class World(esc.Participant):
        back = esc.Input(Seen)
        observation = esc.Output(Seen)

        def step(self, t, dt):
            self.observation.count[:] = [-7, 300]
            self.observation.mode, self.observation.flag = Mode.ON, True

    class Agent(esc.Participant):
        observation = esc.Input(Seen)
        back = esc.Output(Seen)

        def step(self, t, dt):
            pass

    text = """
duration = "50 ms"
[participants.world]
run = { exe = "world" }
period = "10 ms"
[participants.agent]
run = { exe = "agent" }
period = "10 ms"
[connections.observation]
from = "world.observation"
to = "agent.observation"
[connections.back]
from = "agent.back"
to = "world.back"
delay = "10 ms"
"""
    one = Env(scenario(text), "agent", reward=lambda *_: 0.0, participants={"world": World, "agent": Agent})
    observation, _ = one.reset()
    assert observation.tolist() == [-7.0, 300.0, 3.0, 1.0]
    one.step([5.0, -3.0, 0.0, 1.0])
    given = one._run.newest("agent.back")
    assert given.count.tolist() == [5, -3] and given.mode is Mode.OFF or given.mode == 0
    assert bool(given.flag) is True
    # A byte that is not a value of its type ends the episode.
    _, _, over, _, info = one.step([0.0, 0.0, 2.0, 0.0])
    assert over and "agent" in info["failure"] and "mode" in info["failure"]


def test_reset_without_states_begins_a_new_run(scenario):
    class Forgetful(loop.Plant):
        def save(self):
            raise RuntimeError("no state")

    one = Env(PID, "controller", reward=reward, participants={**LOOP, "plant": Forgetful}, ranges=RANGES)
    first = [one.reset()[0].tolist(), *(one.step([5.0])[0].tolist() for _ in range(5))]
    again = [one.reset()[0].tolist(), *(one.step([5.0])[0].tolist() for _ in range(5))]
    assert first == again
