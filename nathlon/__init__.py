"""Which of my thousands of racing checkpoints do I send to the race, and why?

Importing the package makes the environments of `nathlon.policies.environments` known to Gymnasium.
"""

from nathlon.policies.environments import register_environments

register_environments()
