"""Reads cargo's JSON messages on standard input and prints the executable of the bench named on the command line."""
import json
import sys

for line in sys.stdin:
    message = json.loads(line)
    if message.get("target", {}).get("name") == sys.argv[1] and message.get("executable"):
        print(message["executable"])
