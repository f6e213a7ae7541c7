"""Which of my thousands of racing checkpoints do I send to the race, and why?

Importing the package makes the environments of `policies.environments` known to Gymnasium.
"""

from policies.environments import register_environments

register_environments()
