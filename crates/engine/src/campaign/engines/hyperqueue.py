# Speaks to a HyperQueue server for `--on hyperqueue`: what is asked comes as JSON on standard input, the answer goes as JSON to standard output.
import argparse
import json
import os
import sys


def client(args):
    from hyperqueue import Client

    parser = argparse.ArgumentParser(prog="--engine-args", add_help=False, allow_abbrev=False)
    parser.add_argument("--server-dir", default=os.environ.get("HQ_SERVER_DIR"))
    parser.add_argument("--cpus", default="1")
    parser.add_argument("--priority", type=int, default=0)
    parser.add_argument("--crash-limit", type=int, default=5)
    options = parser.parse_args(args)
    # The package answers anything else with an error of its parser. A policy such as `compact` may follow.
    count = options.cpus.split(" ")[0]
    if count != "all" and not (count.replace(".", "", 1).isdigit() and float(count) > 0):
        sys.exit(f"--engine-args: --cpus {options.cpus} is no number of cores above zero, and not `all`")
    return Client(options.server_dir), options


def version(asked):
    from hyperqueue import get_version

    return get_version()


def submit(asked):
    from hyperqueue import Job
    from hyperqueue.ffi.protocol import ResourceRequest

    server, options = client(asked["args"])
    # One task that fails cancels no other.
    job = Job(max_fails=None, name=asked["name"], default_workdir=asked["folder"])
    for shard in asked["shards"]:
        log = os.path.join(asked["folder"], "log", f"hyperqueue-{shard}.txt")
        job.program(
            [asked["script"], str(shard)],
            stdout=log,
            stderr=log,
            resources=ResourceRequest(cpus=options.cpus),
            priority=options.priority,
            crash_limit=options.crash_limit,
        )
    return str(server.submit(job).id)


def alive(asked):
    server, _ = client(asked["args"])
    job = int(asked["job"])
    told = []

    class Enough(Exception):
        pass

    # The package can only wait for jobs: the first report is all that is wanted.
    def report(jobs):
        told.append(jobs)
        raise Enough

    try:
        server.connection.wait_for_jobs([job], report)
    except BaseException:
        if not told:
            raise
    state = told[0].get(job)
    if state is None or state["completed"]:
        return []
    failed = server.connection.get_failed_tasks([job]).get(job, {})
    return [at for at in range(asked["tasks"]) if at not in failed]


asked = json.load(sys.stdin)
try:
    answer = {"version": version, "submit": submit, "alive": alive}[asked["what"]](asked)
except Exception as error:
    sys.exit(f"{type(error).__name__}: {error}".splitlines()[0])
json.dump(answer, sys.stdout)
