"""Environments of gymnasium."""

import warnings

import numpy as np
import pytest
from conftest import PID

import escapement as esc
import pid as loop

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from escapement.gym import Env, Policy  # noqa: E402

LOOP = {"plant": loop.Plant, "controller": loop.Pid, "reference": loop.Reference}
RANGES = {"push.force": (-20.0, 20.0)}


def reward(observation, action, t):
    return -abs(observation[2] - observation[0])


def env(**how):
    return Env(PID, "controller", reward=reward, participants=LOOP, ranges=RANGES, **how)


def test_checker_of_gymnasium_passes():
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        check_env(env(), skip_render_check=True)
    # The positions have no bounds, and nothing registers it.
    odd = [str(one.message) for one in told if not any(word in str(one.message) for word in ("infinity", "inf", "spec"))]
    assert not odd, odd


def act(observation):
    return np.clip([400.0 * (observation[2] - observation[0]) - 40.0 * observation[1]], -20.0, 20.0)


def test_episode_is_the_run_of_the_same_policy():
    one = env()
    seen, info = one.reset()
    episode = [seen]
    truncated = False
    while not truncated:
        seen, value, over, truncated, info = one.step(act(seen))
        assert not over
        episode.append(seen)
    run = esc.run(PID, participants={**LOOP, "controller": Policy.of(one, act)})
    position = run["plant.motion"].position
    # The measurement is 7 ms old.
    assert [float(seen[0]) for seen in episode[2:-1]] == [float(position[5 * at - 7]) for at in range(2, 800)]
    assert info["t"] == 4.0 and value == reward(seen, None, 4.0)


def test_reset_goes_back_to_the_beginning():
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
    # Who leaves them ends the episode, and the next one begins afresh.
    one.reset()
    one.step([19.0])
    _, _, over, _, info = one.step([21.0])
    _, _, over, _, info = (None, None, over, None, info) if over else one.step([21.0])
    assert over and "controller" in info["failure"] and "strong" in info["failure"]
    one.reset()
    assert not one.step([1.0])[2]


def test_environments_side_by_side():
    many = gymnasium.vector.SyncVectorEnv([env, env, env])
    seen, _ = many.reset()
    for _ in range(30):
        seen, *_ = many.step(np.array([[1.0], [1.0], [5.0]]))
    assert (seen[0] == seen[1]).all() and (seen[0] != seen[2]).any()
    many.close()


def test_what_cannot_be_is_refused():
    with pytest.raises(esc.EscapementError, match="no participant `pilot`; there is"):
        Env(PID, "pilot", reward=reward, participants=LOOP)
    with pytest.raises(esc.EscapementError, match="`plant` is continuous"):
        Env(PID, "plant", reward=reward, participants=LOOP)
    with pytest.raises(esc.EscapementError, match="has no `push.torque`; it has"):
        Env(PID, "controller", reward=reward, participants=LOOP, ranges={"push.torque": (0, 1)})
    with pytest.raises(esc.EscapementError, match="reset it"):
        env().step([0.0])
