#!/bin/sh
# A program whose verdict is its TAP stream.
echo "TAP version 13"
echo "1..3"
echo "ok 1 - the shell runs"
if [ -s "$RTF_RUN_FOLDER/server.port" ]; then
    echo "ok 2 - the server has a port"
else
    echo "not ok 2 - the server has a port"
fi
echo "ok 3 - a robot is there # SKIP none on this bench"
