#!/usr/bin/env python3
"""A peer on Cyclone DDS that drives the simulation: state, steps, reset, clock, joint commands, live changes, two commanders.

Usage: simulate.py GOVTWIN FOLDER   (needs PyPI `cyclonedds` 11; ROS_DOMAIN_ID picks the domain; logs go to FOLDER)
CASES picks among: steps action live own follow anew rivals typos. Exits 0 when everything was as it should be, 1 otherwise, 77 without cyclonedds.
"""

import itertools
import os
import subprocess
import sys
import time

from bench import ENDS_S, Bench, Policy, Qos, check, duration, matched, now, run_cases, stamp_ns, wait_for, whole, BEST_EFFORT, DOMAIN, RELIABLE
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
import types_ros as ros
from faults import Node

LATCHED = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal, Policy.History.KeepLast(10))
OK, INCORRECT_STATE, FAILED_RESULT, UNSUPPORTED, ALREADY = 1, 3, 4, 0, 101
STOPPED, PLAYING, PAUSED, QUITTING = 0, 1, 2, 3


class Driver(Bench):
    """A bench that also calls the services of the simulation, as rmw_cyclonedds lays a call out."""

    SERVICES = {
        "reset": (ros.TriggerRequest, ros.TriggerResponse),
        "get_simulator_features": (ros.FeaturesRequest, ros.FeaturesResponse),
        "get_simulation_state": (ros.GetStateRequest, ros.GetStateResponse),
        "set_simulation_state": (ros.SetStateRequest, ros.SetStateResponse),
        "step_simulation": (ros.StepRequest, ros.StepResponse),
        "reset_simulation": (ros.ResetRequest, ros.ResetResponse),
        "set_logger_levels": (ros.SetLoggerLevelsRequest, ros.SetLoggerLevelsResponse),
        "get_logger_levels": (ros.GetLoggerLevelsRequest, ros.GetLoggerLevelsResponse),
        "set_parameters_atomically": (ros.SetParametersAtomicallyRequest, ros.SetParametersAtomicallyResponse),
        "get_type_description": (ros.TypeRequest, ros.TypeResponse),
    }

    def __init__(self):
        super().__init__()
        self.numbers = itertools.count(100)
        self.calls = {}
        for name, (request, response) in self.SERVICES.items():
            call = DataWriter(self.participant, Topic(self.participant, f"rq/govtwin/{name}Request", request), qos=RELIABLE)
            self.calls[name] = (call, self.reader(f"rr/govtwin/{name}Reply", response, RELIABLE))
        self.joint_commands = DataWriter(
            self.participant, Topic(self.participant, "rt/sim/joint_commands", ros.JointState), qos=RELIABLE)
        self.clock_in = self.reader("rt/clock", ros.Clock)

    def call(self, name, *fields, seconds=10.0):
        """One call, sent once: a step must not be done twice."""
        call, reply = self.calls[name]
        wait_for(lambda: matched(call) and matched(reply), 10)
        request = self.SERVICES[name][0](0x0102030405060708, next(self.numbers), *fields)
        call.write(request)
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            for sample in whole(reply.take(20)):
                if (sample.caller, sample.number) == (request.caller, request.number):
                    return sample
            time.sleep(0.0005)
        return None

    def inputs(self, opening):
        self.command.write(ros.GovernorCommand(now(), opening))
        self.pressure.write(ros.FluidPressure(now(), 6.3e6, 0.0))
        self.esv.write(ros.EsvState(now(), 1))

    def matched(self):
        """Whether all writers of inputs are matched, and the readers of states: what was published before is not for them."""
        ends = (self.command, self.pressure, self.esv, self.joint_commands, self.state, self.reliable_state)
        return wait_for(lambda: all(map(matched, ends)), 30)

    def states(self):
        return whole(self.state.take(10000))


def result(reply):
    return None if reply is None else reply.result.result


def double(value):
    return ros.ParameterValue(3, False, 0, value, "", [], [], [], [], [])


def steps(binary, folder):
    """Lock-step by StepSimulation: exact, in order, the same each time, and faster than the clock."""
    runs = []
    for turn in range(2):
        node = Node(binary, os.path.join(folder, f"steps_{turn}.txt"), "--paused", "--publish-clock")
        driver = Driver()
        try:
            driver.matched()
            features = driver.call("get_simulator_features", 0)
            check("the features are those of a simulator that can be stepped", features is not None
                  and sorted(features.features.features) == [20, 21, 22, 24, 25, 26, 31, 32, 33])
            state = driver.call("get_simulation_state", 0)
            check("it stands at first", state is not None and state.state == PAUSED)
            driver.inputs(0.3)
            time.sleep(0.5)
            check("and does nothing", driver.states() == [])
            check("a step is done", result(driver.call("step_simulation", 1)) == OK)
            positions, begin = [], time.monotonic()
            for step in range(300):
                driver.inputs(0.3 if step < 50 else 0.6)
                reply = driver.call("step_simulation", 10)
                if result(reply) != OK:
                    check("every step is done", False, f"(step {step}: {reply})")
                    break
                # Reliable and sent before the answer: the state of this very step is there.
                got = whole(driver.reliable_state.take(1000))
                positions.append((stamp_ns(got[-1].header), got[-1].servomotor_position) if got else None)
            seconds = time.monotonic() - begin
            missing = sum(position is None for position in positions)
            check("each answer comes after its state", missing == 0, f"({missing} of {len(positions)} later)")
            stamps = [position[0] for position in positions if position]
            check("time advances by exactly the steps", all(b - a == 10_000_000 for a, b in zip(stamps, stamps[1:]))
                  if missing == 0 else False)
            print(f"     3 s in lock-step of 10 ms took {seconds:.2f} s: {3.0 / seconds:.1f} times real time, "
                  f"{1e3 * seconds / 300:.2f} ms a round")
            runs.append(positions)
            begin = time.monotonic()
            check("10,000 steps at once are done", result(driver.call("step_simulation", 10_000, seconds=30)) == OK,
                  f"({time.monotonic() - begin:.2f} s for 10 s)")
            clocks = whole(driver.clock_in.take(10000))
            check("its clock is told", clocks and clocks[-1].clock.sec >= 3, f"({len(clocks)} times)")
            check("stepping is refused while it plays", result(driver.call("set_simulation_state", PLAYING)) == OK
                  and result(driver.call("set_simulation_state", PLAYING)) == ALREADY
                  and result(driver.call("step_simulation", 1)) == FAILED_RESULT)
            check("a number of steps that cannot be is refused", result(driver.call("step_simulation", 1 << 62)) == FAILED_RESULT)
            check("a state that is none is refused", result(driver.call("set_simulation_state", 9)) == UNSUPPORTED)
            check("it is stopped and set back", result(driver.call("set_simulation_state", STOPPED)) == OK)
            driver.states()
            driver.inputs(0.3)
            driver.call("step_simulation", 1)
            back = []
            wait_for(lambda: back.extend(driver.states()) or back, 10)
            check("its time begins anew", back and stamp_ns(back[-1].header) < 10_000_000,
                  f"({stamp_ns(back[-1].header)} ns)" if back else "(no state)")
            check("a caller may end it", result(driver.call("set_simulation_state", QUITTING)) == OK)
            check("and it goes with exit code 0", wait_for(lambda: node.process.poll() is not None, ENDS_S)
                  and node.process.returncode == 0)
        finally:
            node.end()
            del driver
    check("two runs in lock-step are the same to the last bit", len(runs) == 2 and runs[0] == runs[1] and None not in runs[0])


def live(binary, folder):
    """On the machine's clock: reset, joint commands with a load force, live changes, logger levels, types."""
    node = Node(binary, os.path.join(folder, "live.txt"), "--optional", "esv", "tank_pressure")
    driver = Driver()
    status = driver.reader("rt/sim/status", ros.TwinStatus)

    def drive(seconds, position_m, effort_n=None):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            effort = [] if effort_n is None else [effort_n]
            driver.joint_commands.write(ros.JointState(now(), ["servomotor"], [position_m], [], effort))
            time.sleep(0.01)
        return driver.states()

    try:
        driver.matched()
        states = drive(3.0, 0.24)
        check("a joint command in metres moves it", states and abs(states[-1].servomotor_position - 0.4) < 2e-3,
              f"({states[-1].servomotor_position:.4f})" if states else "(no state)")
        joints = whole(driver.joints.take(1000))
        check("and its joint state comes to the command", joints and abs(joints[-1].position[1] - 0.24) < 2e-3)
        drive(0.5, 0.24, -3.0e5)
        pushed = drive(0.5, 0.24, -3.0e5)
        seen = whole(status.take(1000))
        check("a load force is taken and told", seen and seen[-1].load == 1 and pushed
              and min(s.servomotor_position for s in pushed) > 0.3)
        reply = driver.call("reset", 0)
        check("~/reset sets it back", reply is not None and reply.success, f"({reply.message})" if reply else "(no reply)")
        reply = driver.call("reset_simulation", 2)
        check("so does reset_simulation", result(reply) == OK)
        check("time is not its own to set back", result(driver.call("reset_simulation", 1)) == UNSUPPORTED)
        drive(0.5, 0.24, 0.0)
        # Half of this is wrong: nothing may change.
        change = [ros.Parameter("effects.servo_leak.leakage_m3_s_pa", double(1.5e-8)),
                  ros.Parameter("unit.oil.density_kg_m3", double(-1.0))]
        reply = driver.call("set_parameters_atomically", change)
        check("a change that is half wrong changes nothing", reply is not None and not reply.result.successful,
              f"({reply.result.reason})" if reply else "(no reply)")
        ask = lambda: driver.ask(driver.get_call, driver.get_reply, ros.GetParametersRequest(
            0x1122334455667788, next(driver.numbers), ["effects.servo_leak.leakage_m3_s_pa", "unit.servomotor.load_closed_n"]))
        before = [value.double_value for value in ask().values]
        change[1] = ros.Parameter("unit.servomotor.load_closed_n", double(2.5e5))
        check("an effect and a parameter are set together", driver.call("set_parameters_atomically", change).result.successful)
        after = [value.double_value for value in ask().values]
        check("and both are told", before == [0.0, 1.5e5] and after == [1.5e-8, 2.5e5], f"({before} -> {after})")
        leaky = drive(2.0, 0.24, 0.0)
        jumps = [abs(b.servomotor_position - a.servomotor_position) for a, b in zip(leaky, leaky[1:])]
        check("the changed unit goes on without a jump", leaky and max(jumps) < 5e-3, f"(largest {max(jumps):.1e} pu)")
        level = [ros.LoggerLevel("govtwin", 40), ros.LoggerLevel("other", 20)]
        results = driver.call("set_logger_levels", level).results
        check("a logger's level is set, a stranger's refused", [one.successful for one in results] == [True, False])
        levels = driver.call("get_logger_levels", ["govtwin", "other"]).levels
        check("and told", [one.level for one in levels] == [40, 0])
        joint = "sensor_msgs/msg/JointState"
        hashed = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
        reply = driver.call("get_type_description", joint, hashed, True)
        check("a type is described by its hash", reply is not None and reply.successful
              and [field.name for field in reply.type_description.fields] == ["header", "name", "position", "velocity", "effort"]
              and len(reply.referenced_type_descriptions) == 2)
        reply = driver.call("get_type_description", joint, "RIHS01_0", False)
        check("a foreign hash is refused", reply is not None and not reply.successful)
        check("it can be paused", result(driver.call("set_simulation_state", PAUSED)) == OK)
        # What was published before the pause may still be on its way.
        wait_for(lambda: driver.states() == [], 10)
        time.sleep(7.0)
        check("a pause publishes nothing", driver.states() == [])
        driver.call("set_simulation_state", PLAYING)
        went_on = drive(1.0, 0.24, 0.0)
        seen = whole(status.take(1000))
        check("and trips nothing", went_on and all(one.state == 1 for one in seen[-50:]))
    finally:
        check("it ends in order", node.end())
    said = node.said()
    for words in ("a caller sets the twin back", "the twin was set back", "the changed unit took hold"):
        check(f"it said: {words}", words in said)
    check("it is quiet below its logger's level", "a caller pauses" not in said)


def follow(binary, folder):
    """A node that follows /clock: told when it is absent, stands or jumps; lock-step over it without polling."""
    node = Node(binary, os.path.join(folder, "follow.txt"), "--ros-args", "-p", "use_sim_time:=true")
    driver = Driver()
    clock = DataWriter(driver.participant, Topic(driver.participant, "rt/clock", ros.Clock), qos=RELIABLE)
    try:
        driver.matched()
        wait_for(lambda: matched(clock), 10)
        check("a missing clock is told", node.says("/clock: nothing heard for 3 s"))
        check("it cannot be paused from here", result(driver.call("set_simulation_state", PAUSED)) == INCORRECT_STATE)
        driver.state.take(10000)
        rounds, late, begin = [], 0, time.monotonic()
        for step in range(1, 501):
            driver.inputs(0.3 if step < 50 else 0.6)
            sent = time.monotonic()
            clock.write(ros.Clock(ros.Time(1000 + step // 100, step % 100 * 10_000_000)))
            wanted, got = (1000 + step // 100) * 10**9 + step % 100 * 10_000_000, None
            while time.monotonic() < sent + 3 and got != wanted:
                for sample in whole(driver.reliable_state.take(100)):
                    got = stamp_ns(sample.header)
                time.sleep(0)
            late += got != wanted
            rounds.append(time.monotonic() - sent)
        seconds = time.monotonic() - begin
        rounds.sort()
        check("each time of the clock is answered by its state", late <= 5, f"({late} of 500 were not; the first wait for inputs)")
        print(f"     5 s in lock-step over /clock took {seconds:.2f} s: {5.0 / seconds:.1f} times real time; a round "
              f"{1e3 * rounds[250]:.2f} ms (median), {1e3 * rounds[494]:.2f} ms (99 %)")
        check("a clock that stands is told", node.says("/clock: stands at 1005.000 s"))
        for step in range(20):
            driver.inputs(0.3)
            clock.write(ros.Clock(ros.Time(2000 + step, 0)))
            time.sleep(0.1)
        node.says("/clock: heard", 2)
        check("so is that it goes on", node.said().count("/clock: heard") >= 2, f"({node.said().count('/clock: heard')} times)")
        check("and a leap", node.says("time jumped back, or ahead"))
        driver.inputs(0.3)
        clock.write(ros.Clock(ros.Time(5, 0)))
        check("and a jump back", node.says("time jumped back", 2))
        # Publishers that offer best effort, as those of transducers do, are followed like the others.
        offered = lambda name, kind: DataWriter(driver.participant, Topic(driver.participant, f"rt/governor/{name}", kind), qos=BEST_EFFORT)
        driver.command, driver.esv = offered("command", ros.GovernorCommand), offered("esv", ros.EsvState)
        driver.pressure = offered("tank_pressure", ros.FluidPressure)
        driver.matched()
        followed = []
        for step in range(1, 401):
            driver.inputs(0.6)
            clock.write(ros.Clock(ros.Time(5 + step // 100, step % 100 * 10_000_000)))
            time.sleep(0.005)
            followed += driver.states()
        check("best-effort inputs are followed too", followed and abs(followed[-1].servomotor_position - 0.6) < 2e-3,
              f"({followed[-1].servomotor_position:.4f})" if followed else "(no state)")
        check("and are not told as incompatible", "offers less" not in node.said())
        other = DomainParticipant(DOMAIN)
        second = DataWriter(other, Topic(other, "rt/clock", ros.Clock), qos=RELIABLE)
        check("two clocks are told", node.says("/clock: 2 publishers"))
        del second
    finally:
        check("it ends in order", node.end())


def anew(binary, folder):
    """`use_sim_time` set while the node runs, both ways: refused where it cannot be, else states flow again by the other time, with what was set."""
    follows = lambda flag: [ros.Parameter("use_sim_time", ros.ParameterValue(1, flag, 0, 0.0, "", [], [], [], [], []))]
    node = Node(binary, os.path.join(folder, "own_clock.txt"), "--publish-clock")
    driver = Driver()
    try:
        driver.matched()
        refusal = driver.call("set_parameters_atomically", follows(True))
        check("a node that publishes /clock cannot follow it", refusal and not refusal.result.successful and "publish_clock" in refusal.result.reason,
              f"({refusal.result.reason if refusal else 'no response'})")
    finally:
        check("it ends in order", node.end())
    node = Node(binary, os.path.join(folder, "anew.txt"))
    driver = Driver()
    clock = DataWriter(driver.participant, Topic(driver.participant, "rt/clock", ros.Clock), qos=RELIABLE)
    try:
        driver.matched()
        driver.call("set_parameters_atomically", [ros.Parameter("hold", double(0.7))])
        ticks, waits = itertools.count(1), {}
        for flag in (True, False) * 3:
            for _ in range(100):
                driver.inputs(0.3)
                time.sleep(0.01)
            response = driver.call("set_parameters_atomically", follows(flag))
            begin, since = time.monotonic(), time.time_ns()
            check(f"use_sim_time:={str(flag).lower()} is taken", response is not None and response.result.successful)
            came = False
            while not came and time.monotonic() < begin + 20:
                driver.inputs(0.3)
                tick = next(ticks)
                clock.write(ros.Clock(ros.Time(1000 + tick // 100, tick % 100 * 10_000_000)))
                stamps = [stamp_ns(state.header) for state in driver.states()]
                came = any(stamp < 10**15 if flag else stamp > since for stamp in stamps)
                time.sleep(0.005)
            check("states flow by the other time", came)
            waits.setdefault(flag, []).append(time.monotonic() - begin)
        print("     from the response to the first state: " + "; ".join(
            f"{time_of} {', '.join(f'{wait:.2f}' for wait in waits[flag])} s" for flag, time_of in ((True, "/clock"), (False, "the machine's"))))
        reply = driver.ask(driver.get_call, driver.get_reply, ros.GetParametersRequest(0x1122334455667788, 9, ["hold", "use_sim_time"]), 10)
        check("what was set is kept", reply and reply.values[0].double_value == 0.7 and not reply.values[1].bool_value)
    finally:
        check("it ends in order", node.end())


def rivals(binary, folder):
    """The source of the command dies and comes back, then two say different things."""
    node = Node(binary, os.path.join(folder, "rivals.txt"), "--optional", "esv", "tank_pressure")
    driver = Driver()
    told = "command: two publishers say different things"
    try:
        driver.matched()

        def drive(seconds, *sources):
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                for writer, opening in sources:
                    writer.write(ros.GovernorCommand(now(), opening))
                time.sleep(0.01)
            return driver.states()

        def source():
            participant = DomainParticipant(DOMAIN)
            writer = DataWriter(participant, Topic(participant, "rt/governor/command", ros.GovernorCommand), qos=RELIABLE)
            wait_for(lambda: matched(writer), 10)
            return participant, writer

        first = source()
        drive(2.0, (first[1], 0.4))
        del first
        closing = lambda: (states := driver.states()) and states[-1].servomotor_position < 0.39
        check("a command source that died trips the fail-safe", wait_for(closing, 30))
        second = source()
        follows = lambda: (states := drive(0.5, (second[1], 0.5))) and abs(states[-1].servomotor_position - 0.5) < 2e-3
        check("its successor is followed", wait_for(follows, 30))
        check("and is no rival", told not in node.said())
        third = source()
        drive(1.0, (second[1], 0.5), (third[1], 0.5))
        check("two that agree are none either", told not in node.said())
        wait_for(lambda: drive(0.5, (second[1], 0.5), (third[1], 0.3)) is None or told in node.said(), 30)
        drive(1.0, (second[1], 0.5), (third[1], 0.3))
        check("two different commands are told once", node.says(told), f"({node.said().count(told)} times)")
    finally:
        check("it ends in order", node.end())


def typos(binary, folder):
    """Remappings, overrides, parameters and security that do nothing are told by name."""
    log = os.path.join(folder, "typos.txt")
    node = Node(binary, log, "--ros-args", "-r", "governor/comand:=/y", "-r", "other:sim/status:=/s",
                "-p", "qos_overrides./sim/servo_stat.publisher.reliability:=best_effort", "-p", "hodl:=2.0")
    node.says("waits for it")
    check("it ends in order", node.end())
    said = node.said()
    for words in ("-r /governor/comand:=/y matches no topic or service of this node; did you mean `/governor/command`?",
                  "is for a node `other`; this process has only `govtwin`",
                  "did you mean `qos_overrides./sim/servo_state.publisher", "did you mean `hold`?"):
        check(f"it said: {words}", words in said)
    head = said.split("waits for it")[0]
    informative = [line for line in head.splitlines() if "Info: " in line]
    check("and what it is in about ten lines", 8 <= len(informative) <= 12, f"({len(informative)})")
    security = dict(os.environ, ROS_SECURITY_ENABLE="true", ROS_SECURITY_STRATEGY="Enforce")
    done = subprocess.run([binary, "run", "--duration", "1"], env=security, capture_output=True, text=True, timeout=60)
    check("security that must be kept is refused", done.returncode == 1 and "ROS_SECURITY_STRATEGY=Permissive" in done.stderr)


def add_action(driver):
    """Lets a driver call the action's services; readers of its feedback and its statuses."""
    at = "govtwin/simulate_steps/_action/"
    for name, request, response in (("send_goal", ros.SendGoalRequest, ros.SendGoalResponse), ("cancel_goal", ros.CancelRequest, ros.CancelResponse),
                                    ("get_result", ros.GetResultRequest, ros.GetResultResponse)):
        call = DataWriter(driver.participant, Topic(driver.participant, f"rq/{at}{name}Request", request), qos=RELIABLE)
        driver.SERVICES = {**driver.SERVICES, name: (request, response)}
        driver.calls[name] = (call, driver.reader(f"rr/{at}{name}Reply", response, RELIABLE))
    return (driver.reader(f"rt/{at}feedback", ros.Feedback, RELIABLE), driver.reader(f"rt/{at}status", ros.GoalStatusArray, LATCHED))


def action(binary, folder):
    """The action SimulateSteps: feedback, result, an early end, and what is refused."""
    node = Node(binary, os.path.join(folder, "action.txt"), "--paused", "--publish-clock")
    driver = Driver()
    feedback, status = add_action(driver)
    one, two, never = [1] * 16, [2] * 16, [9] * 16
    ever = ros.Time(0, 0)
    try:
        driver.matched()
        driver.inputs(0.3)
        time.sleep(0.3)
        reply = driver.call("send_goal", one, 2000)
        check("a goal is accepted", reply is not None and reply.accepted and reply.stamp.sec > 0)
        reply = driver.call("get_result", one)
        check("its result comes once it is done", reply is not None and (reply.status, reply.result.result) == (4, OK), f"({reply})")
        # Result and feedback are two topics, which may be read in either order.
        told = []
        wait_for(lambda: told.extend(whole(feedback.take(1000))) or told and told[-1].completed_steps == 2000, 10)
        sums = {sample.completed_steps + sample.remaining_steps for sample in told}
        done = [sample.completed_steps for sample in told]
        check("feedback rises to the end", sums == {2000} and done == sorted(done) and done[-1] == 2000, f"({done})")
        # Each state was sent before the result, reliably; but two topics may be read in either order.
        newest_ns = [None]

        def the_last_is_there():
            got = whole(driver.reliable_state.take(1000))
            newest_ns.extend(stamp_ns(state.header) for state in got)
            return newest_ns[-1] == 1_999_000_000

        wait_for(the_last_is_there, 5)
        time.sleep(0.2)
        check("time advanced by exactly the steps", the_last_is_there(), f"({newest_ns[-1]} ns)")
        state = driver.call("get_simulation_state", 0)
        check("and it stands again", state is not None and state.state == PAUSED)

        check("a long goal is accepted", driver.call("send_goal", two, 500_000_000).accepted)
        reply = driver.call("send_goal", never, 5)
        check("another one meanwhile is not", reply is not None and not reply.accepted)
        reply = driver.call("cancel_goal", ros.GoalInfo(two, ever))
        check("it is ended early", reply is not None and reply.return_code == 0 and [list(info.goal_id) for info in reply.goals_canceling] == [two], f"({reply})")
        reply = driver.call("get_result", two)
        check("which is its result", reply is not None and reply.status == 5, f"({reply})")
        reply = driver.call("cancel_goal", ros.GoalInfo(two, ever))
        check("an end early needs a goal under way", reply is not None and reply.return_code == 3)
        reply = driver.call("cancel_goal", ros.GoalInfo(never, ever))
        check("that there is", reply is not None and reply.return_code == 2)
        reply = driver.call("get_result", never)
        check("a result of nothing is unknown", reply is not None and reply.status == 0)
        driver.call("set_simulation_state", PLAYING)
        check("while it plays, a goal is accepted", driver.call("send_goal", [3] * 16, 10).accepted)
        reply = driver.call("get_result", [3] * 16)
        check("and fails with the reason", reply is not None and reply.status == 6 and "pause" in reply.result.error_message, f"({reply})")
        reply = driver.call("send_goal", [4] * 16, 2**63)
        check("more steps than there can be are refused", reply is not None and not reply.accepted)
        late = driver.reader("rt/govtwin/simulate_steps/_action/status", ros.GoalStatusArray, LATCHED)
        seen = []
        wait_for(lambda: seen.extend(whole(late.take(10))) or seen, 5)
        check("who comes late has the statuses", bool(seen) and [one.status for one in seen[-1].status_list] == [4, 5, 6])
        statuses = [[one.status for one in sample.status_list] for sample in whole(status.take(100))]
        check("each change of status was told", [2] in statuses and [4, 2] in statuses and [4, 5] in statuses, f"({statuses})")
    finally:
        check("the node ends in order", node.end())


if __name__ == "__main__":
    run_cases(sys.argv[2], steps, action, live, follow, anew, rivals, typos)
