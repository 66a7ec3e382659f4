"""Every command that writes, and the services under load, killed (SIGKILL) while at work.

``python -m tests.campaigns.kills --kills 300 --seed 1 --to kills.jsonl`` kills in turn each command
of `commands.COMMANDS`, appends a line of JSON per kill, and prints a table; ``--report FILE ...``
prints the table of such files. ``--command NAME`` takes only these, ``--but NAME`` not these.

A command begins on a copy of a prepared workspace and is killed

- at a random fraction of the time that it works, or
- at one of its writes: the first, second, ... time that it opens, renames or removes a file there,
  adds or changes a row of one table, or commits (`writes`);

its process alone, its process group, or (services) all processes that it has started, or only the
process of a run. Then queries must answer, no file and no row may be damaged, and the same command
again (after ``--in-a-row`` such kills) must end in the workspace of an undisturbed run: the same ids, results, files and numbers of
rows, and no process may be left. `places`: the folder of a trial. `checks`: what is compared.
`services`: load, and when a service has done its work. `trial`: one kill. `campaign`: many.
"""
