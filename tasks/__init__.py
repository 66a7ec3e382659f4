"""Steps of the flows, and the documents that the command line and the console show.

A step is a plain function with three parts: load its inputs, call the science, keep the result. A
result is one file, found by the hash of its inputs and settings, so a step that is repeated reads
its result back.

Modules: `workspace_access` opens the workspace folder and its catalogue, where every task starts;
`stored_steps` derives the key of a result and stores its file; `result_versions` holds the version
of what each step returns; `references` resolves what a user names (a vehicle, a version, a
point); `provenance` names the code version and the user.

Packages: `steps` (what flows call), `view` (read-only documents) and `workers` (processes for work
on untrusted logs).
"""
