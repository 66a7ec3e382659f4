"""Flows, the command line and the console: the only part of aerodb that knows the orchestrator.

A flow is a plain function ``body(steps, workspace=..., run=..., **parameters)`` that calls steps of
`aerodb.tasks.steps`; `run.run_flow` runs it under Prefect or directly, and records the run.

Flows: `importing` (a database file), `flight` (per flight), `recalibrate`, `update`, `close_loop`,
`release` (promote, roll back), `report`, `inbox` (the sweep), `nightly`, `retry`, `demo`.

Running: `run` (Prefect or direct), `executors` (this machine or Dask), `deadline` (time limit of a
run); `serve` with `processes`, `orchestrator` and `deployments` (the service).

User interfaces: `cli` (the command ``aerodb``), `web` (the console ``aerodb web``) and `library`
(``import aerodb``).
"""
