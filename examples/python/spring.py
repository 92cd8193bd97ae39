"""A mass on a spring that its neighbour pulls along: examples/spring in Python."""

import escapement as esc


class Motion(esc.Message):
    position = esc.Field("m", frame="N")
    velocity = esc.Field("m/s", frame="N")


class Spring(esc.Participant):
    kind = "continuous"
    neighbour = esc.Input(Motion)
    motion = esc.Output(Motion)
    position = esc.Parameter("1")  # m

    def __init__(self):
        self.x, self.v = self.position, 0.0

    def initialise(self, t):
        self.motion.position, self.motion.velocity = self.x, self.v

    def step(self, t, dt):
        acceleration = 5.0 * (self.neighbour.position - self.x) - 40.0 * self.x  # stiffness over mass, 1/s²
        self.v += dt * acceleration
        self.x += dt * self.v
        self.motion.position, self.motion.velocity = self.x, self.v
