"""The position loop of examples/pid in Python: a mass on a spring with a damper, its PID controller, and a reference."""

import escapement as esc


class Motion(esc.Message):
    position = esc.Field("m", frame="N")
    velocity = esc.Field("m/s", frame="N")


class Push(esc.Message):
    force = esc.Field("N", frame="N")


class Target(esc.Message):
    position = esc.Field("m", frame="N")


class Plant(esc.Participant):
    kind = "continuous"
    push = esc.Input(Push)
    motion = esc.Output(Motion)
    mass = esc.Parameter("kg")
    stiffness = esc.Parameter("N/m")
    damping = esc.Parameter("N s/m")

    def __init__(self):
        self.x, self.v = 0.0, 0.0

    def step(self, t, dt):
        force = self.push.force - self.stiffness * self.x - self.damping * self.v
        self.v += dt * (force / self.mass)
        self.x += dt * self.v
        self.motion.position, self.motion.velocity = self.x, self.v


class Pid(esc.Participant):
    measured = esc.Input(Motion)
    target = esc.Input(Target)
    push = esc.Output(Push)
    gain = esc.Parameter("N/m")
    integral_time = esc.Parameter("s", key="integral-time")
    damping = esc.Parameter("N s/m")
    limit = esc.Parameter("N")

    def __init__(self):
        if self.limit < 0.0:
            raise esc.ParameterError("limit", "a limit is not negative")
        self.integral = 0.0

    def step(self, t, dt):
        error = self.target.position - self.measured.position
        wanted = self.gain * (error + self.integral / self.integral_time) - self.damping * self.measured.velocity
        force = min(max(wanted, -self.limit), self.limit)
        if force == wanted:
            self.integral += dt * error
        self.push.force = force


class Reference(esc.Participant):
    target = esc.Output(Target)
    height = esc.Parameter("m")
    rise = esc.Parameter("s")

    def step(self, t, dt):
        part = t / self.rise if t < self.rise else 1.0
        self.target.position = self.height * part * part * (3.0 - 2.0 * part)
