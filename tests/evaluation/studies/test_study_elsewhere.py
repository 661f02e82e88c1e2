"""The same study, wherever it runs: the same files, byte for byte."""

from contextlib import suppress
from importlib.util import find_spec

import pytest
from small_studies import contents

from kinarm.evaluation.running.ray_cluster import RayExecutor
from kinarm.evaluation.running.slurm import SlurmExecutor
from kinarm.workers import Finished

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # Ray's own
]


class Disturbed:
    """A Ray cluster that loses a node amid the work and gets another one."""

    def __init__(self, cluster, lost):
        self._cluster, self._lost = cluster, lost

    def carry_out(self, work, tasks):
        done = RayExecutor(self._cluster.address).carry_out(work, tasks)
        for count, (number, result) in enumerate(done):
            yield Finished(number, result)
            if count == 3:
                with suppress(AssertionError):  # on a busy machine, its processes end later
                    self._cluster.remove_node(self._lost, allow_graceful=False)
            if count == 5:
                self._cluster.add_node(num_cpus=1)


@pytest.mark.skipif(find_spec("ray") is None, reason="needs the extra ray")
def test_on_a_ray_cluster_whose_nodes_come_and_go(small, monkeypatch):
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    straight = small("straight", seeds=5).run(jobs=1)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        lost, _ = cluster.add_node(num_cpus=1), cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        study = small(seeds=5).run(executor=Disturbed(cluster, lost))
    finally:
        cluster.shutdown()
    assert study.failures == {}
    assert contents(study.store.folder) == contents(straight.store.folder)


@pytest.mark.skipif(find_spec("submitit") is None, reason="needs the extra slurm")
def test_as_array_jobs(small, finished, tmp_path):
    study = small().run(executor=SlurmExecutor(tmp_path / "slurm", bundle=3, cluster="local"))
    assert contents(study.store.folder) == contents(finished.store.folder)
