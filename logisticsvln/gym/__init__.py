"""LogisticsVLN as an environment of Gymnasium; importing this module makes it known.

`gymnasium.make("logisticsvln.gym:LogisticsVLN-v0")` imports it as well. docs/gymnasium.md says what is observed and
done, and what is measured.
"""

import gymnasium

ENVIRONMENT = "LogisticsVLN-v0"

if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="logisticsvln.gym.environment:LogisticsVlnEnv")
