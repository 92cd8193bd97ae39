# A HyperQueue server with workers of one core each on this machine, until it is ended: local_cluster.py FOLDER WORKERS
import signal
import sys

from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig

folder, workers = sys.argv[1], int(sys.argv[2])
with LocalCluster(folder) as cluster:
    for _ in range(workers):
        cluster.start_worker(WorkerConfig(cores=1))
    signal.sigwait({signal.SIGTERM, signal.SIGINT})
