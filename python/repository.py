"""The build backend of this folder: that of the repository above, which describes the package."""

import os

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir))

from scikit_build_core.build import *  # noqa: E402, F403
