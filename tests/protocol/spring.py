"""The mass on a spring of examples/spring, in Python: the same tape, byte for byte."""

from escapement import CONTINUOUS, Message, run

MOTION = Message("Motion", ("position", "d", [], "m", "N"), ("velocity", "d", [], "m/s", "N"))


class Spring:
    kind = CONTINUOUS
    inputs = [("neighbour", MOTION, True)]
    outputs = [("motion", MOTION)]

    def __init__(self, setup):
        self.position, self.velocity = float(setup["parameters"]["position"]), 0.0

    def initialise(self, t, outputs):
        outputs[0] = (self.position, self.velocity)

    def step(self, t, period, inputs, outputs):
        position, _ = inputs[0]
        acceleration = 5.0 * (position - self.position) - 40.0 * self.position
        self.velocity += period * acceleration
        self.position += period * self.velocity
        outputs[0] = (self.position, self.velocity)


run(Spring, "spring.py 1")
