"""What `escapement bench` exchanges, in Python: 27 doubles are taken, and passed on."""

import escapement as esc


class Parcel(esc.Message):
    values = esc.Field("1", shape=27)


class Relay(esc.Participant):
    taken = esc.Input(Parcel, name="from")
    given = esc.Output(Parcel, name="to")

    def step(self, t, dt):
        values = self.given.values
        values[:] = self.taken.values
        values[0] += 1.0


class First(Relay):
    kind = "continuous"
