"""Makes the shipped samples: ``python -m resources.recipes --help``."""

import sys

from resources.recipes.make import main

sys.exit(main())
