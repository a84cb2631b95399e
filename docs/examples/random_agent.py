"""Random agents in two environments at a time: what there is to observe, to do, and to be measured by."""

import gymnasium

import logisticsvln.gym  # noqa: F401 - makes the environment known

envs = gymnasium.make_vec("LogisticsVLN-v0", num_envs=2, image_size=96, max_steps=20)
envs.action_space.seed(7)
seen, _ = envs.reset(seed=7)
print({name: space for name, space in envs.single_observation_space.items() if name != "instruction"})
print(seen["instruction"][0])

finished = 0
while finished < 4:
    seen, reward, terminated, truncated, info = envs.step(envs.action_space.sample())
    for number in (terminated | truncated).nonzero()[0]:
        finished += 1
        told = ("task", "outcome", "steps", "navigation_error_m", "success", "spl")
        print({name: info[name][number] for name in told})
envs.close()
