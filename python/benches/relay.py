"""The exchange of `escapement bench`, in Python: 27 doubles are read and forwarded."""

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
