"""Which cores a measured program may use."""

import os


def usable():
    """Numbers of this process's cores, the last first: the first of a machine serves most of its interrupts."""
    return sorted(os.sched_getaffinity(0), reverse=True)


def pin_to(count):
    """For subprocess's preexec_fn: the first `count` of the usable cores, the same for everyone who asks."""
    chosen = usable()[:count]
    return lambda: os.sched_setaffinity(0, chosen)
