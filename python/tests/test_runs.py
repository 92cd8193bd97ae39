"""Runs: the same tape wherever participants run; checkpoints, restarts, substitutions, campaigns, handles, Ctrl-C."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest
from conftest import EXAMPLES, PID, SPRING

import escapement as esc
import pid as loop
import spring
from escapement import _program

BOTH = {"left": spring.Spring, "right": spring.Spring}
LOOP = {"plant": loop.Plant, "controller": loop.Pid, "reference": loop.Reference}


def library(built, which):
    return {"library": str(built / "libposition_loop.so"), "participant": which}


def in_rust(built):
    """The position loop with all participants in Rust, as changes of the scenario."""
    slots = {"plant": "plant", "controller": "pid", "reference": "reference"}
    return {f"participants.{slot}.run": library(built, which) for slot, which in slots.items()}


def bytes_of(run):
    return {name: run[name].array.tobytes() for name in run}


def assert_same_tape(one, other):
    assert one.digest == other.digest
    assert bytes_of(one) == bytes_of(other)


@pytest.fixture
def rust(built):
    return esc.run(PID, set=in_rust(built), in_process=True, out="rust")


def test_springs_in_rust_and_python_give_one_tape(built):
    rust = esc.run(SPRING, out="rust")
    assert_same_tape(rust, esc.run(SPRING, participants=BOTH, out="within"))
    assert_same_tape(rust, esc.run(SPRING, participants=BOTH, in_process=False, out="apart"))
    # One of each, with draws and gaps.
    late = {"connections.to-right.jitter": "7ms", "connections.to-left.drop": 0.2, "connections.to-left.hold": "initial"}
    mixed = esc.run(SPRING, set=late, participants={"right": spring.Spring}, in_process=False, out="mixed")
    assert_same_tape(esc.run(SPRING, set=late, out="late"), mixed)
    # Exactly the README's command, with the host that a scenario names.
    run = {"exe": sys.executable, "args": ["-m", "escapement.host", f"{EXAMPLES}/spring.py:Spring"]}
    assert_same_tape(rust, esc.run(SPRING, set={"participants.left.run": run}, in_process=False, out="named"))
    assert_same_tape(rust, esc.run(SPRING, set={"participants.left.run": run, "participants.right.run": run}, out="named-within"))


def test_position_loops_in_rust_and_python_give_one_tape(rust):
    assert_same_tape(rust, esc.run(PID, participants=LOOP, out="within"))
    assert_same_tape(rust, esc.run(PID, participants=LOOP, in_process=False, out="apart"))


def test_run_is_resumed_in_process_and_in_processes(rust):
    for here in (True, False):
        begun = esc.run(PID, participants=LOOP, in_process=here, checkpoint_at="1.234 s", out=f"begun-{here}")
        assert_same_tape(rust, begun)
        for there in (True, False):
            assert_same_tape(rust, esc.resume(begun, in_process=there, out=f"resumed-{here}-{there}"))


def test_program_resumes_a_run_of_python(rust):
    """A run in one Python process gives an ordinary run folder: the program can replay, resume and shadow it."""
    begun = esc.run(PID, participants=LOOP, checkpoint_at="1.234 s", out="begun")
    assert_same_tape(rust, begun)
    program = _program.find()

    def run_program(*words):
        done = subprocess.run([program, *words], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, (words, done)
        return done.stdout

    assert "identical" in run_program("replay", begun.folder, "--participant", "controller")
    run_program("resume", begun.folder, "--quiet", "--out", "resumed")
    assert_same_tape(rust, esc.open("resumed"))
    assert "identical" in run_program("compare", begun.folder, "resumed")


def test_state_contains_objects_of_the_participants_file(rust, tmp_path):
    """A run is resumed where the file was imported under another name: as a script, as a module, and by the host."""
    (tmp_path / "own.py").write_text(textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(EXAMPLES)!r})
        import pid

        class Memory:
            def __init__(self):
                self.integral = 0.0

        class Pid(pid.Pid):
            def __init__(self):
                self.memory = Memory()

            @property
            def integral(self):
                assert type(self.memory) is Memory
                return self.memory.integral

            @integral.setter
            def integral(self, value):
                self.memory.integral = value
    """))
    sys.path.insert(0, str(tmp_path))
    try:
        import own

        for here, controller in ((True, own.Pid), (False, f"{tmp_path}/own.py:Pid")):
            begun = esc.run(
                PID, participants={**LOOP, "controller": controller}, in_process=here, checkpoint_at="1.234 s", out=f"begun-{here}"
            )
            for there, other in ((True, own.Pid), (False, own.Pid)):
                resumed = esc.resume(begun, participants={"controller": other}, in_process=there, out=f"resumed-{here}-{there}")
                assert_same_tape(rust, resumed)
    finally:
        sys.path.remove(str(tmp_path))


def test_killed_participant_is_restarted(rust, tmp_path, built):
    """A controller killed once during the run is restarted from the last checkpoint: the tape is that of the undisturbed run."""
    (tmp_path / "dies.py").write_text(textwrap.dedent(f"""
        import os, sys
        sys.path.insert(0, {str(EXAMPLES)!r})
        from pid import *

        class Dies(Pid):
            def step(self, t, dt):
                super().step(t, dt)
                if t > 2.5 and not os.path.exists({str(tmp_path / "died")!r}):
                    open({str(tmp_path / "died")!r}, "w").close()
                    os.kill(os.getpid(), 9)
    """))
    participants = {**LOOP, "controller": f"{tmp_path}/dies.py:Dies"}
    change = {"participants.controller.on-failure": "restart-from-checkpoint"}
    run = esc.run(PID, participants=participants, set=change, in_process=False, checkpoint_every="1 s", out="restarted")
    assert (tmp_path / "died").exists() and run.summary["recovered"]
    assert_same_tape(rust, run)


def test_substitution_in_mid_run_from_rust_to_python(rust, built):
    """The reference has no state, and the controller's state is kept where the replacement can restore it: Python replaces Rust and Python."""
    host = '{{ exe = "{}", args = ["-m", "escapement.host", "{}/{}"] }}'
    takes = 'at="1.5 s",substitute="{}",run={}{}'
    python = host.format(sys.executable, EXAMPLES, "pid.py:Reference")
    fault = takes.format("reference", python, "")
    for here in (True, False):
        assert_same_tape(rust, esc.run(PID, set=in_rust(built), faults=[fault], in_process=here, out=f"fresh-{here}"))
    python = host.format(sys.executable, EXAMPLES, "pid.py:Pid")
    fault = takes.format("controller", python, ',state="keep"')
    for here in (True, False):
        assert_same_tape(rust, esc.run(PID, participants=LOOP, faults=[fault], in_process=here, out=f"kept-{here}"))
    # A participant in Python cannot restore the state of one in Rust unless its `restore` accepts it.
    with pytest.raises(esc.EscapementError, match="none of a participant in Python"):
        esc.run(PID, set=in_rust(built), faults=[fault], in_process=True, out="refused")


def test_state_passes_from_rust_to_python_with_restore(rust, built, tmp_path):
    (tmp_path / "takes.py").write_text(textwrap.dedent(f"""
        import struct, sys
        sys.path.insert(0, {str(EXAMPLES)!r})
        import pid

        class Pid(pid.Pid):
            def save(self):
                return struct.pack("<d", self.integral)

            def restore(self, state):
                (self.integral,) = struct.unpack("<d", state)
    """))
    fault = f'at="1.5 s",substitute="controller",run={{ exe = "{sys.executable}", args = ["-m", "escapement.host", "{tmp_path}/takes.py:Pid"] }},state="keep"'
    for here in (True, False):
        assert_same_tape(rust, esc.run(PID, set=in_rust(built), faults=[fault], in_process=here, out=f"kept-{here}"))


@pytest.mark.parametrize(
    "fault",
    [
        'at=1s,until=2s,input=controller.measured,field=position,kind=bias,value="5 mm"',
        "at=1s,until=2s,output=controller.push,kind=stuck",
        {"at": "1 s", "until": "2 s", "input": "controller.measured", "field": "position", "kind": "bias", "value": "5 mm"},
        "at=1s,until=2s,connection=measured,drop=0.5",
    ],
)
def test_declared_faults_act_as_in_rust(built, fault):
    rust = esc.run(PID, set=in_rust(built), faults=fault, in_process=True, out="rust")
    assert_same_tape(rust, esc.run(PID, participants=LOOP, faults=fault, out="within"))
    assert_same_tape(rust, esc.run(PID, participants=LOOP, faults=fault, in_process=False, out="apart"))


def test_fault_is_given_as_dict_or_text(built):
    """Numbers, lists, tables and texts that look like numbers keep their types."""
    text = "at=1s,until=2s,connection=measured,drop=0.5,extra-delay='3 ms'"
    table = {"at": "1 s", "until": "2 s", "connection": "measured", "drop": 0.5, "extra-delay": "3 ms"}
    from_text = esc.run(PID, set=in_rust(built), faults=[text], out="text")
    assert_same_tape(from_text, esc.run(PID, set=in_rust(built), faults=table, out="table"))
    assert_same_tape(from_text, esc.run(esc.Scenario(PID, set=in_rust(built)), faults=(one for one in [table]), out="later"))
    twice = esc.sweep(PID, seeds=2, set=in_rust(built), faults=[text], out="texts"), esc.sweep(PID, seeds=2, set=in_rust(built), faults=table, out="tables")
    assert twice[0].equals(twice[1]) and len(twice[0]) == 2


def test_class_is_substituted_in_mid_run(rust):
    """In this process and in separate processes, where the participant that is replaced is a class as well."""
    takes = {"at": "1.5 s", "substitute": "controller", "run": loop.Pid, "state": "keep"}
    for here in (True, False):
        assert_same_tape(rust, esc.run(PID, participants=LOOP, faults=takes, in_process=here, out=f"taken-{here}"))


@pytest.mark.parametrize(
    "fault, words",
    [
        ({"at": "1 s", "untill": "2 s", "output": "controller.push", "kind": "stuck"}, "untill"),
        ({"at": "soon", "output": "controller.push", "kind": "stuck"}, "soon"),
        ({"at": "1 s", "output": "absent.push", "kind": "stuck"}, "absent"),
        ("at=1s,output", "KEY=VALUE"),
    ],
)
def test_invalid_fault_is_refused(fault, words):
    with pytest.raises(esc.ScenarioError, match=words) as refused:
        esc.Scenario(PID, participants=LOOP, faults=fault)
    assert str(refused.value.file).endswith("pid.toml") and refused.value.key.startswith("faults")


def test_fault_of_another_type_is_refused():
    for wrong in (3, None, {"at": "1 s", "substitute": "controller", "run": int}):
        with pytest.raises(esc.EscapementError, match="fault"):
            esc.Scenario(PID, participants=LOOP, faults=[wrong])


def test_failure_in_a_separate_process_is_named_and_logged(tmp_path):
    (tmp_path / "fails.py").write_text(textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(EXAMPLES)!r})
        from spring import *

        class Fails(Spring):
            def step(self, t, dt):
                if t > 1.0:
                    raise ValueError("the spring broke")
                super().step(t, dt)
    """))
    with pytest.raises(esc.RunError, match=r"ValueError: the spring broke \(.*fails.py:9, in step\)") as caught:
        esc.run(SPRING, participants={"left": f"{tmp_path}/fails.py:Fails"}, in_process=False)
    assert caught.value.participant == "left"
    assert "Traceback (most recent call last)" in caught.value.run.log("left")


def test_figures_and_criteria():
    run = esc.run(SPRING, participants=BOTH)
    assert set(run.figures) >= {"swing", "apart", "fastest"}
    assert run.verdict == "met" and run.criteria[0]["met"] is True
    worse = esc.run(SPRING, participants=BOTH, set={"measures.swing.at-most": "1 mm"})
    assert worse.verdict == "not-met"
    digest = esc.run(SPRING, participants=BOTH, record="digest")
    assert digest.digest == run.digest and digest.figures == run.figures


def test_scenario_is_read_and_changed_as_object(tmp_path):
    scenario = esc.Scenario(SPRING, participants=BOTH)
    assert (scenario.name, scenario.duration, scenario.participants) == ("spring", 10.0, ["left", "right"])
    scenario.set("duration", "2 s").set("participants.left.parameters.position", 0.2)
    assert scenario["participants.left.parameters.position"] == 0.2
    ports = scenario.check()["participants"]["left"]
    assert ports["kind"] == "continuous" and ports["outputs"]["motion"]["name"] == "Motion"
    with pytest.raises(esc.ScenarioError, match="given with --set") as caught:
        scenario.set("connections.to-right.delay", "3 apples")
    assert caught.value.key == "connections.to-right.delay"
    # A rejected change changes nothing.
    assert esc.run(scenario)["left.motion"].t[-1] == 2.0
    bad = tmp_path / "bad.toml"
    bad.write_text('duration = "1 s"\n\n[participants.a]\nrun = { builtin = "spring" }\nperiode = "1 ms"\n')
    with pytest.raises(esc.ScenarioError) as caught:
        esc.Scenario(bad)
    assert (caught.value.file, caught.value.line, caught.value.key) == (str(bad), 5, "participants.a.periode")


def test_fault_without_effect_is_a_warning():
    late = "at=20s,until=30s,connection=to-left,drop=0.5"
    with pytest.warns(esc.ScenarioWarning, match="it does not happen in this run") as warnings:
        esc.run(SPRING, participants=BOTH, faults=late, record="digest")
    assert warnings[0].filename == __file__


def test_run_pauses_steps_saves_and_restores():
    whole = esc.run(SPRING, participants=BOTH)
    with esc.Run(SPRING, participants=BOTH) as run:
        run.run_to("2 s")
        assert run.now == 2.0
        first = run.newest("left.motion")
        assert first.t == 2.0 and first.position == whole["left.motion"].position[2000]
        here = run.save()
        run.run_to(3.5)
        run.restore(here)
        assert run.now == 2.0 and run.newest("left.motion").position == first.position
        run.step()
        assert run.now == 2.001
        run.run_to("10 s")
        outcome = run.end()
    assert outcome.digest == whole.digest and outcome.figures == whole.figures
    with pytest.raises(esc.RunError, match="has passed"):
        with esc.Run(SPRING, participants=BOTH) as run:
            run.run_to("2 s")
            run.run_to("1 s")
    with pytest.raises(esc.PortError, match="there is no such output"):
        with esc.Run(SPRING, participants=BOTH) as run:
            run.newest("left.nothing")


def test_inputs_are_set_from_code(built):
    sets = {**in_rust(built)}
    text = PID.read_text().replace('[connections.push]\nfrom = "controller.push"\nto = "plant.push"\n', "")
    text = text.replace('duration = "4 s"', 'duration = "4 s"\ninputs = ["plant.push"]')
    scenario = esc.Scenario(PID, text=text, set=sets, participants={"plant": loop.Plant})
    with esc.Run(scenario) as run:
        run.run_to("1 s")
        assert run.newest("plant.motion").position == 0.0
        run.set("plant.push", loop.Push(force=50.0))
        run.run_to("4 s")
        assert run.newest("plant.motion").position == pytest.approx(1.0, rel=0.2)
        with pytest.raises(esc.PortError, match="`controller.measured`"):
            run.set("controller.measured", position=1.0)


def test_sweep_gives_a_table():
    table = esc.sweep(SPRING, {"connections.to-right.delay": ["0 ms", "20 ms"], "participants.left.parameters.position": [0.1, 0.2]}, set={"duration": "1 s"}, digest=True)
    assert len(table) == 4 and list(table["outcome"]) == ["met", "not-met"] * 2 or set(table["outcome"]) <= {"met", "not-met"}
    swing = next(column for column in table if column.startswith("swing"))
    alone = esc.run(SPRING, set={"duration": "1 s", "connections.to-right.delay": "20 ms", "participants.left.parameters.position": 0.2})
    assert table[swing].iloc[3] == alone.figures["swing"]
    python = esc.sweep(SPRING, {"connections.to-right.delay": "0ms..20ms:20ms"}, set={"duration": "1 s"}, participants={"right": spring.Spring}, digest=True)
    assert list(python["tape"]) == list(table["tape"][::2])
    with pytest.raises(esc.ScenarioError, match="delai"):
        esc.sweep(SPRING, {"connections.to-right.delai": [1]})


SCRIPT = """
import sys
sys.path.insert(0, {examples!r})
import escapement as esc, spring
if __name__ == "__main__":
    try:
        print("begun", flush=True)
        esc.run({scenario!r}, set={{"duration": "100000 s"}}, participants={{"left": spring.Spring, "right": spring.Spring}},
                in_process={here}, out="long")
    except KeyboardInterrupt as error:
        print("interrupted:", error, flush=True)
        print(esc.open("long").verdict, len(esc.open("long")["left.motion"]) > 10, flush=True)
"""


@pytest.mark.parametrize("here", [True, False])
def test_ctrl_c_ends_a_run_in_an_orderly_way(here, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(examples=str(EXAMPLES), scenario=str(SPRING), here=here))
    # Tests started in the background may ignore this signal, and a process inherits that.
    restore_handler = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, script], **pipes, text=True, cwd=tmp_path, preexec_fn=restore_handler)
    assert process.stdout.readline() == "begun\n"
    # Until there are samples.
    tape = tmp_path / "long" / "tape" / "left.motion.bin"
    while not (tape.exists() and tape.stat().st_size > 1000):
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert out.startswith("interrupted: interrupted at t = ") and out.endswith("None True\n")
    assert (tmp_path / "long" / "tape" / "seal.json").exists()
    assert not errors


HANGS = """
import sys, time
sys.path.insert(0, {examples!r})
import escapement as esc
import spring

class Hangs(spring.Spring):
    def step(self, t, dt):
        print("hangs", flush=True)
        while True:
            time.sleep(0.01)

try:
    if {staged}:
        with esc.Run({scenario!r}, participants={{"left": Hangs, "right": spring.Spring}}, in_process=True) as run:
            run.step()
    else:
        esc.run({scenario!r}, participants={{"left": Hangs, "right": spring.Spring}}, in_process=True)
except KeyboardInterrupt as interrupt:
    print("interrupted:", interrupt)
"""


@pytest.mark.parametrize("staged", [False, True])
def test_second_ctrl_c_ends_a_step_that_hangs(tmp_path, staged):
    script = tmp_path / "script.py"
    script.write_text(HANGS.format(examples=str(EXAMPLES), scenario=str(SPRING), staged=staged))
    restore_handler = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, script], **pipes, text=True, cwd=tmp_path, preexec_fn=restore_handler)
    try:
        assert process.stdout.readline() == "hangs\n"
        process.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=0.5)
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert out.startswith("interrupted: ") and "participant `left`: failed at t = 0 s" in out and "KeyboardInterrupt" in out


def test_file_that_starts_a_run_at_import_is_reported(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys\nsys.path.insert(0, {str(EXAMPLES)!r})\nimport escapement as esc\nfrom spring import *\n"
        f"class Mine(Spring):\n    pass\nesc.run({str(SPRING)!r}, participants={{'left': Mine}}, in_process=False)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert done.returncode == 1 and '__name__ == "__main__"' in done.stderr and "participant `left`" in done.stderr


def test_class_without_a_file_runs_in_process_only():
    space = {}
    exec("import spring\nclass Loose(spring.Spring):\n    pass\n", space)
    space["Loose"].__module__ = "nowhere"
    run = esc.run(SPRING, participants={"left": space["Loose"], "right": space["Loose"]}, in_process=True)
    assert len(run["left.motion"]) == 10001
    with pytest.raises(esc.EscapementError, match="put it into a file, or run with in_process=True"):
        esc.run(SPRING, participants={"left": space["Loose"]}, in_process=False)


def test_progress_is_reported():
    events = []
    esc.run(SPRING, participants=BOTH, progress=lambda what, value: events.append(what))
    assert events[0] == "begun" and events[-1] == "over" and "time" in events


def test_figures_contain_only_those_of_the_scenario():
    short = {"duration": "0.5 s", "measures.apart.from": "0 s"}
    run = esc.run(SPRING, participants=BOTH, set=short)
    paced = esc.run(SPRING, participants=BOTH, set=short, pace=1000.0)
    assert "pace" in paced.summary and paced.figures == run.figures
    # The entries of a run with `--trace`, and of one whose tape has only a part of its samples.
    summary = {**run.summary, "trace": {"file": "trace.json"}, "tape_has_only": {"left.motion": 1}}
    assert esc.Outcome(summary).figures == run.figures


def test_report_is_one_page(tmp_path):
    run = esc.run(SPRING, participants=BOTH)
    page = run.report()
    assert os.path.getsize(page.path) > 10_000 and "left.motion" in page.html
    assert page._repr_html_().startswith("<iframe srcdoc=")
    assert "swing" in run._repr_html_()
    other = esc.run(SPRING, participants=BOTH, set={"duration": "5 s"})
    assert "duration" in run.report(other, out=tmp_path / "two.html").html
