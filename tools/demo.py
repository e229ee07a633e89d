# SPDX-License-Identifier: Apache-2.0
"""What the suite answers: start nodes, ask them, walk over a terrain, draw pictures."""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ros_domain

DOMAIN_ID = ros_domain.use_own_domain()  # so that the demo meets no robot; before ROS is loaded

import numpy as np  # noqa: E402
from leg_msgs.msg import FootholdVerdict  # noqa: E402
from leg_msgs_py.arrays import FloatArray  # noqa: E402
from leg_msgs_py.client import LegClient  # noqa: E402
from leg_msgs_py.client.description import LegDescription  # noqa: E402
from leg_msgs_py.errors import LegServiceError, ServerUnavailableError  # noqa: E402
from node_processes import NodeProcesses  # noqa: E402
from rich.box import SIMPLE_HEAD  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.markup import escape  # noqa: E402
from rich.table import Table  # noqa: E402

from leg_kinematics import load_robot  # noqa: E402
from leg_statics import Contact, evaluate_footholds, load_grounds  # noqa: E402

START_TIMEOUT = 600.0  # the first start on a machine compiles [s]
WALK_TIMEOUT = 120.0  # s
WALKER = Path(__file__).resolve().parent.parent / "examples" / "04_walk_over_terrain.py"
DISTANCE = 3.0  # of the walk [m]
LOAD = 600.0  # on one foot [N]
GROUNDS = ("ice", "wood", "cement")
OFFSETS = np.array(  # candidate footholds, from the initial foot position [m]
    [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [-0.2, -0.05, 0.05], [0.0, 0.0, 0.15], [0.0, 0.0, -0.3]]
)
MODEL_LOAD = 8.0  # on one foot of the small robot [N]
MODEL_OFFSETS = np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.0], [-0.08, 0.03, 0.04], [0.2, 0, -0.1]])
HEIGHTS = np.array([0.50, 0.55, 0.60, 0.65, 0.70, 0.75])  # of the body over the ground [m]
WRAPPED = ("message of the node",)  # columns of long texts
MAP_HEIGHTS, MAP_RESOLUTION = (-0.7, -0.65, -0.6), 0.005  # m
VERDICTS = {
    FootholdVerdict.FEASIBLE: "[green]feasible[/green]",
    FootholdVerdict.REACH: "[yellow]out of reach[/yellow]",
    FootholdVerdict.JOINT_RANGE: "[yellow]joint range[/yellow]",
    FootholdVerdict.PASSIVE_JOINT: "[yellow]passive joint range[/yellow]",
    FootholdVerdict.SINGULAR: "[yellow]singular[/yellow]",
    FootholdVerdict.INVALID_INPUT: "[yellow]invalid[/yellow]",
    FootholdVerdict.FRICTION: "[yellow]would slip[/yellow]",
    FootholdVerdict.EFFORT: "[yellow]too weak[/yellow]",
}

console = Console(width=None if sys.stdout.isatty() else 110)


def main() -> int:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=Path("demo_output"), help="folder of the pictures"
    )
    output: Path = parser.parse_args().output
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` leaves it ignored
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with tempfile.TemporaryFile() as log:
        nodes = NodeProcesses("hexapod", stdout=log, stderr=subprocess.STDOUT)
        try:
            output.mkdir(parents=True, exist_ok=True)
            with nodes, walking(output, log) as walker, LegClient(timeout=20.0) as client:
                wait_until_ready(client, nodes)
                tour(client)
                draw_maps(client, output)
                show_model_robot()
                with console.status("The planner walks ..."):
                    code = walker.wait(WALK_TIMEOUT)
            arrived = show_walk(output / "walk.json")
            show_pictures(output)
            if code == 0 and arrived:
                return 0
        except KeyboardInterrupt:
            console.print("\nStopped.")
            return 0
        except (LegServiceError, subprocess.TimeoutExpired) as error:
            console.print(f"[red]{type(error).__name__}[/red]: {error}")
        log.seek(0)
        console.print(log.read().decode(errors="replace"), markup=False)
        return 1


@contextmanager
def walking(output: Path, log: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Run the planner node of the examples as a process; it ends with the block.

    It waits for the nodes and plans while the tables are shown.
    """
    plan = output / "walk.json"
    plan.unlink(missing_ok=True)
    walker = subprocess.Popen(
        [
            *(sys.executable, WALKER, "--output", output, "--json", plan),
            *("--ros-args", "-p", f"distance:={DISTANCE}", "-p", f"patience:={START_TIMEOUT}"),
        ],
        stdout=log,
        stderr=subprocess.STDOUT,
        start_new_session=True,  # Ctrl-C reaches it through this process only
    )
    try:
        yield walker
    finally:
        for number, patience in ((signal.SIGINT, 5.0), (signal.SIGKILL, None)):
            if walker.poll() is None:
                walker.send_signal(number)
                try:
                    walker.wait(patience)
                except subprocess.TimeoutExpired:
                    continue


def wait_until_ready(client: LegClient, nodes: NodeProcesses) -> None:
    """Wait until the nodes serve, showing that something goes on."""
    started = time.monotonic()
    with console.status("Starting the nodes (the first time on a machine they compile) ..."):
        while True:
            try:
                client.wait_until_ready(timeout=1.0)
                break
            except ServerUnavailableError:
                for name, code in nodes.ended().items():
                    console.print(f"[red]{name} ended by itself with exit code {code}.[/red]")
                if nodes.ended() or time.monotonic() - started > START_TIMEOUT:
                    raise
    seconds = time.monotonic() - started
    names = ", ".join(f"/{name}" for name in nodes.processes)
    console.print(f"Nodes {names} answer on ROS_DOMAIN_ID {DOMAIN_ID}, after {seconds:.1f} s.\n")


def tour(client: LegClient) -> None:
    """Ask for what a gait planner needs."""
    leg = client.describe("right_front")
    names = client.legs()
    console.print(
        f"Robot [bold]{leg.robot}[/bold] with the legs {', '.join(names)}: mechanism "
        f"{leg.mechanism}, {len(leg.joint_names)} actuated and {len(leg.passive_joint_names)} "
        "passive joints each.\n"
    )
    show_footholds(client, leg)
    show_step_lengths(client)
    show_efforts(client, leg)
    show_refusals(client, leg)


def show_footholds(client: LegClient, leg: LegDescription) -> None:
    """Show what a leg can carry at candidate footholds, on each ground."""
    feet = leg.initial_foot_position + OFFSETS
    title = f"query_footholds: can {leg.leg} bear {LOAD:g} N there?"
    answers = ("capacity [N]", "mu_e", "mu_e,xy", "effort used", "limiting joint", "verdict")
    columns = ("foothold [m]", *answers)
    table = new_table(title, "ground", *columns)
    for ground in GROUNDS:
        answer = client.query_footholds(leg.leg, feet, ground, LOAD)
        for k, foot in enumerate(feet):
            joint = answer.limiting_joint[k]
            table.add_row(
                f"{ground}, mu {answer.friction_coefficient:g}" if k == 0 else "",
                vector(foot),
                number(answer.load_capacity[k], 0),
                number(answer.rated_friction[k], 2),
                number(answer.rated_friction_full[k], 2),
                f"{100 * answer.utilisation[k]:.0f} %" if joint >= 0 else "-",
                leg.joint_names[joint].removeprefix(f"{leg.leg}_") if joint >= 0 else "-",
                VERDICTS[int(answer.verdict[k])],
            )
        table.add_section()
    console.print(table, "")


def show_step_lengths(client: LegClient) -> None:
    """Show how far all legs can step together, on each ground and at each body height."""
    title = f"query_step_length: longest step of all legs [m], {LOAD:g} N on each foot"
    table = new_table(title, "ground", "criterion", *(f"body {height:.2f}" for height in HEIGHTS))
    for ground in GROUNDS:
        for criterion, rated in (("load capacity", False), ("mu_e <= mu", True)):
            answer = client.query_step_length((), -HEIGHTS, ground, LOAD, by_rated_friction=rated)
            steps = [f"{step:.3f}" for step in answer.common_length]
            if answer.best_height >= 0:
                steps[answer.best_height] = f"[bold]{steps[answer.best_height]}[/bold]"
            first = f"{ground}, mu {answer.friction_coefficient:g}" if not rated else ""
            table.add_row(first, criterion, *steps)
        table.add_section()
    console.print(table, "")


def show_efforts(client: LegClient, leg: LegDescription) -> None:
    """Show the joint efforts on hard ground, and on soft ground, which applies a moment, too."""
    foot = leg.initial_foot_position
    joints = [
        f"{joint.removeprefix(f'{leg.leg}_')} [{unit}]"
        for joint, unit in zip(leg.joint_names, leg.effort_units, strict=True)
    ]
    table = new_table(
        f"compute_efforts: {leg.leg} at {vector(foot)}", "ground reaction", *joints, "effort used"
    )
    for title, moment in (
        (f"hard ground: {LOAD:g} N", None),
        (f"soft ground: {LOAD:g} N and (20, 10, 0) N.m", [20.0, 10.0, 0.0]),
    ):
        answer = client.compute_efforts(leg.leg, foot, [0.0, 0.0, LOAD], moment)
        efforts = [number(effort, 1) for effort in answer.joint_efforts]
        table.add_row(title, *efforts, f"{100 * float(answer.utilisation):.0f} %")
    console.print(table, "")


def show_refusals(client: LegClient, leg: LegDescription) -> None:
    """Show what a planner is told when it asks for something wrong."""
    foot = leg.initial_foot_position
    requests = {
        "a leg that is not there": lambda: client.describe("middle_leg"),
        "an unknown ground": lambda: client.query_footholds(leg.leg, foot, "lava", LOAD),
        "an effort limit below zero": lambda: client.set_effort_limits(
            leg.leg, leg.joint_names[:1], [-5.0]
        ),
    }
    table = new_table(
        "wrong requests are answered, too", "request", "exception", "message of the node"
    )
    for what, request in requests.items():
        try:
            request()
        except LegServiceError as error:
            table.add_row(what, type(error).__name__, escape(error.message))
    console.print(table, "")


def show_model_robot() -> None:
    """Show what a leg of a public robot's URDF can carry, asked in this process."""
    robot = load_robot("solo12")
    leg = robot.leg("FL")
    feet = leg.mechanism.initial_posture.foot_position + MODEL_OFFSETS
    found = evaluate_footholds(
        leg, feet, Contact(load_grounds().find("wood").friction_low, load=MODEL_LOAD)
    )
    weight = "counts" if found.weight_counted else "does not count"
    title = f"{robot.name} from its URDF: can {leg.name} bear {MODEL_LOAD:g} N? Its weight {weight}"
    table = new_table(title, "foothold [m]", "capacity [N]", "verdict")
    for foot, capacity, verdict in zip(feet, found.load_capacity, found.verdict, strict=True):
        table.add_row(vector(foot), number(capacity, 1), VERDICTS[int(verdict)])
    console.print(table, "")


def draw_maps(client: LegClient, output: Path) -> None:
    """Ask the maps node for planes of one leg's workspace and draw them."""
    # Imported here, while the planner walks: it takes seconds.
    from leg_statics.drawing.maps import plot_maps
    from leg_statics.drawing.style import height_title
    from leg_statics.maps import CAPACITY_LAYER, IndexMap

    def plane(height: float, layer: str, ground: str) -> IndexMap:
        answer = client.index_map("right_front", height, MAP_RESOLUTION, [layer], ground)
        z = np.array(answer.height)
        return IndexMap(answer.x, answer.y, z, answer.layers, answer.values, answer.status)

    middle = MAP_HEIGHTS[len(MAP_HEIGHTS) // 2]
    capacity = {ground: plane(middle, CAPACITY_LAYER, ground) for ground in GROUNDS}
    friction = {
        height_title(height): plane(height, "rated_friction", GROUNDS[0]) for height in MAP_HEIGHTS
    }
    title = f"right front leg, {height_title(middle)}"
    for figure, name in (
        (plot_maps(capacity, CAPACITY_LAYER, title=title), "map_load_capacity.png"),
        (
            plot_maps(friction, "rated_friction", title="right front leg"),
            "map_rated_friction.png",
        ),
    ):
        figure.savefig(output / name, dpi=200)


def show_walk(plan: Path) -> bool:
    """Show the half steps that the planner made; return whether it arrived."""
    if not plan.is_file():
        return False
    walk = json.loads(plan.read_text())
    title = (
        f"tripod walk over boards, ice, a pit and a kerb: {walk['mass']:g} kg, "
        f"carried {walk['reserve']:g} times at every instant"
    )
    columns = ("x, y [m]", "height", "step [m]", "feet on", "carried", "margin", "friction used")
    table = new_table(title, "", *columns, "refused for")
    for k, step in enumerate(walk["half_steps"], start=1):
        x, y, _ = step["body_end"]
        feet = step["footholds"]
        tightest = max(feet, key=lambda foot: foot["friction_used"] / foot["friction"])
        grounds = Counter(foot["ground"] for foot in feet)
        refused = Counter(step["rejected"]).most_common(2)
        table.add_row(
            str(k),
            f"{x:.2f} {y:5.2f}",
            f"{step['body_height']:.2f}",
            f"{step['step_length']:.3f}",
            ", ".join(f"{n} {ground}" for ground, n in grounds.most_common()),
            f"{step['load_factor']:.2f}",
            f"{step['margin']:.3f} m",
            f"{tightest['friction_used']:.2f} of {tightest['friction']:g}",
            ", ".join(reason for reason, _ in refused),
        )
    console.print(table)
    steps = walk["half_steps"]
    if walk["arrived"]:
        console.print(
            f"Arrived at x = {steps[-1]['body_end'][0]:.2f} m in {len(steps)} half steps."
        )
    else:
        console.print(f"[red]Stopped:[/red] {escape(walk['reason'])}")
    return bool(walk["arrived"])


def show_pictures(output: Path) -> None:
    """Tell where the pictures are."""
    console.print("\nPictures and the plan:")
    for path in sorted(output.iterdir()):
        if path.suffix in (".png", ".json"):
            console.print(f"  {path}", highlight=False)


def new_table(title: str, *columns: str) -> Table:
    """Return a table; units in brackets are text, not markup."""
    table = Table(
        title=escape(title),
        title_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    for column in columns:
        table.add_column(escape(column), no_wrap=column not in WRAPPED)
    return table


def vector(values: FloatArray) -> str:
    """Return a vector for a table."""
    return " ".join(f"{value:5.2f}" for value in values)


def number(value: float, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is no answer."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


if __name__ == "__main__":
    sys.exit(main())
