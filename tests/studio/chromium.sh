#!/bin/sh
# Chromium that may not put its threads before others: as root it would, and with the processor
# drawing in the place of a graphics card the daemons and cranes of the tests would come too late.
exec setpriv --bounding-set -sys_nice --inh-caps -sys_nice chromium "$@"
