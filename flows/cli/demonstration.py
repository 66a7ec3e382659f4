"""``aerodb demo``: the built-in example, from logs to a validated candidate and the sealed
truth."""

from typing import Annotated

import typer

from aerodb.flows.cli.closing import say_loop
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Direct, Verbose
from aerodb.flows.cli.responses import say_responses


def demo(
    context: typer.Context,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed for random undeclared effects; default: the Phoenix case."),
    ] = None,
    flights: Annotated[int, typer.Option(min=3, max=40, help="How many flights to fly.")] = 8,
    noise_seed: Annotated[
        int, typer.Option(min=0, help="Seed of noise, sensor errors and pilot in the Phoenix case.")
    ] = 0,
    together: Annotated[
        bool,
        typer.Option(
            "--together", help="Body flap and speed brake move together, as the real ones did."
        ),
    ] = False,
    direct: Direct = False,
    verbose: Verbose = False,
) -> None:
    """Fly the built-in example, ingest its logs, close the loop, and compare with the
    errors hidden in it.

    Example: aerodb demo --seed 3
    """
    from aerodb.flows.demo import run_demo, write_logs
    from aerodb.flows.fly import validate_flow
    from aerodb.report import parameter_name

    session: Session = context.obj
    workspace = session.workspace(create=True)
    session.say(f"flying {flights} drops of the Phoenix-like example")
    with session.waiting("flying"):
        logs = write_logs(
            workspace.root / "demo-logs", flights, seed, noise_seed, together=together
        )
    session.say(
        f"wrote {len(logs)} logs, {sum(log.stat().st_size for log in logs) / 1e6:.0f} MB, to"
        f" {logs[0].parent}"
    )
    result = run_demo(
        workspace, logs, lambda body, parameters: session.run(body, parameters, direct), session.say
    )
    say_loop(session, result.document, verbose)
    responses = None
    if result.document["candidate"]:
        session.say()
        session.say("The flights not used, flown by the preflight database and by the update:")
        parameters = {
            "version": result.document["candidate"],
            "baseline": result.document["baseline"],
            "flights": result.document["flights"]["held_out"],
        }
        responses = session.run(validate_flow, parameters, direct)
        say_responses(session, result.document["label"], responses, verbose)
    session.say()
    session.say("Now the hidden errors are shown. On the flights not used, rms of flight - model:")
    session.table(
        ["axis", "preflight", "updated", "true model", "updated / true"],
        [
            [
                axis,
                f"{v['before']:.5f}",
                f"{v['after']:.5f}",
                f"{v['floor']:.5f}",
                f"{v['after'] / v['floor']:.3f}",
            ]
            for axis, v in result.floors.items()
        ],
        numbers=(1, 2, 3, 4),
    )
    session.say()
    session.table(
        ["hidden error", "axis", "parameter", "value", "verdict"],
        [
            [
                e["effect"],
                e["axis"],
                parameter_name(e["parameter"]),
                f"{e['value']:.4g}",
                (e["verdict"] or e["agreement"]).replace("_", " "),
            ]
            for e in result.truth
        ],
        numbers=(3,),
    )
    if result.lags:
        session.say()
        session.table(
            ["lag of a sensor", "flown [ms]", "found [ms]", "95 %"],
            [
                [
                    lag["parameter"],
                    f"{1e3 * lag['value']:.1f}",
                    f"{1e3 * lag['found']:.1f}",
                    f"{1e3 * lag['ci95'][0]:.1f} to {1e3 * lag['ci95'][1]:.1f}",
                ]
                for lag in result.lags
            ],
            numbers=(1, 2),
        )
    agreed = [entry["agreement"] for entry in result.truth]
    session.answer(
        {
            **result.document,
            "truth": result.truth,
            "agreement": agreed,
            "truth_floor": result.floors,
            "truth_lags": result.lags,
            "responses": responses,
        }
    )
