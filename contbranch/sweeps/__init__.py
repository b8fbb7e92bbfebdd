"""Many contacts: what varies, a journal of what has been computed, and any executor to compute the rest."""
