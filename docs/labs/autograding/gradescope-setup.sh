#!/bin/sh
# setup.sh of a Gradescope autograder (an image of Ubuntu 24.04): the course's clone, and what it needs.
# Zip it with gradescope-run_autograder, named setup.sh and run_autograder.
set -eu
COURSE=${COURSE:-https://github.com/OWNER/COURSE.git}
apt-get update && apt-get install -y --no-install-recommends git make sudo ca-certificates bubblewrap valgrind
git clone --depth 1 "$COURSE" /autograder/course
make -C /autograder/course setup
