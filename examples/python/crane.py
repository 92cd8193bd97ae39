"""A gantry crane: a trolley on a rail, a load on a rope, and a driver who brings it across without letting it swing."""

import math

import escapement as esc

GRAVITY = 9.81  # m/s²


class Drive(esc.Message):
    pull = esc.Field("kN", frame="hall")


class Hook(esc.Message):
    rail = esc.Field("cm", frame="hall")  # along x
    sway = esc.Field("deg", frame="hall")  # of the rope about y, from hanging down
    load = esc.Field("m", frame="hall", shape=3)
    turned = esc.Field("1", frame="hall", shape=4)  # attitude of the load: x, y, z, w
    hoisting = esc.Field("N", frame="load", shape=3)  # force of the rope on the load, in the load's axes


class Crane(esc.Participant):
    kind = "continuous"
    drive = esc.Input(Drive)
    hook = esc.Output(Hook)
    trolley = esc.Parameter("kg")
    mass = esc.Parameter("kg")
    rope = esc.Parameter("m")
    height = esc.Parameter("m")

    def __init__(self):
        self.x = self.v = self.angle = self.rate = 0.0

    def initialise(self, t):
        self.tell(0.0)

    def step(self, t, dt):
        force = 1000.0 * self.drive.pull
        sine, cosine = math.sin(self.angle), math.cos(self.angle)
        swing = self.mass * sine * (self.rope * self.rate**2 + GRAVITY * cosine)
        acceleration = (force + swing) / (self.trolley + self.mass * sine**2)
        turning = -(acceleration * cosine + GRAVITY * sine) / self.rope
        self.v += dt * acceleration
        self.x += dt * self.v
        self.rate += dt * turning
        self.angle += dt * self.rate
        self.tell(self.mass * (self.rope * self.rate**2 + GRAVITY * math.cos(self.angle) - acceleration * math.sin(self.angle)))

    def tell(self, tension):
        # The rope hangs along -z; a turn about y takes the load to -x.
        sine, cosine, half = math.sin(self.angle), math.cos(self.angle), self.angle / 2.0
        hook = self.hook
        hook.rail, hook.sway = 100.0 * self.x, -math.degrees(self.angle)
        hook.load[:] = self.x + self.rope * sine, 0.0, self.height - self.rope * cosine
        hook.turned[:] = 0.0, -math.sin(half), 0.0, math.cos(half)
        hook.hoisting[:] = 0.0, 0.0, tension


class Driver(esc.Participant):
    seen = esc.Input(Hook)
    drive = esc.Output(Drive)
    goal = esc.Parameter("m")
    rise = esc.Parameter("s")

    def __init__(self):
        self.before = None

    def step(self, t, dt):
        part = min(t / self.rise, 1.0)
        wanted = self.goal * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        now = (self.seen.rail / 100.0, math.radians(-self.seen.sway))
        (x, angle), (v, rate) = now, (0.0, 0.0)
        if self.before:
            v, rate = (now[0] - self.before[0]) / dt, (now[1] - self.before[1]) / dt
        self.before = now
        self.drive.pull = 0.8 * (wanted - x) - 1.5 * v + 3.0 * angle + 0.5 * rate
