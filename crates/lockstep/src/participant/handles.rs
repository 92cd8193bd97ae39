//! Ports as handles that know the message: declared once, used as an index.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Index, IndexMut};

use super::{Inputs, Interface, Kind, Outputs};
use crate::port::Message;

/// The ports of a participant during their declaration.
///
/// ```
/// use lockstep::participant::{Failure, InputPort, Inputs, Interface, Kind, OutputPort, Outputs, Participant, Ports, Step};
///
/// lockstep::message! {
///     /// A signal.
///     pub struct Signal {
///         /// Its value.
///         pub value: f64 = "V",
///     }
/// }
///
/// struct Amplifier {
///     ports: Ports,
///     low: InputPort<Signal>,
///     high: OutputPort<Signal>,
/// }
///
/// impl Amplifier {
///     fn new() -> Amplifier {
///         let mut ports = Ports::new(Kind::Sampled);
///         Amplifier { low: ports.input("low"), high: ports.output("high"), ports }
///     }
/// }
///
/// impl Participant for Amplifier {
///     fn interface(&self) -> Interface {
///         self.ports.interface()
///     }
///     fn step(&mut self, _step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
///         outputs[self.high].value = 20.0 * inputs[self.low].value;
///         Ok(())
///     }
/// }
/// # assert_eq!(Amplifier::new().interface(), Interface::new(Kind::Sampled).input::<Signal>("low").output::<Signal>("high"));
/// ```
#[derive(Debug, Clone)]
pub struct Ports {
    interface: Interface,
}

impl Ports {
    /// Starts without ports.
    pub fn new(kind: Kind) -> Ports {
        Ports {
            interface: Interface::new(kind),
        }
    }

    /// Adds an input that the scenario must connect.
    pub fn input<M: Message>(&mut self, name: &str) -> InputPort<M> {
        self.add(|interface| interface.input::<M>(name));
        InputPort::new(self.interface.inputs.len() - 1)
    }

    /// Adds an input that may stay unconnected and then holds zeros.
    pub fn optional_input<M: Message>(&mut self, name: &str) -> InputPort<M> {
        self.add(|interface| interface.optional_input::<M>(name));
        InputPort::new(self.interface.inputs.len() - 1)
    }

    /// Adds an output.
    pub fn output<M: Message>(&mut self, name: &str) -> OutputPort<M> {
        self.add(|interface| interface.output::<M>(name));
        OutputPort::new(self.interface.outputs.len() - 1)
    }

    /// The return value of [`super::Participant::interface`].
    pub fn interface(&self) -> Interface {
        self.interface.clone()
    }

    fn add(&mut self, with: impl FnOnce(Interface) -> Interface) {
        let empty = Interface::new(self.interface.kind);
        self.interface = with(std::mem::replace(&mut self.interface, empty));
    }
}

macro_rules! handle {
    ($name:ident, $text:literal) => {
        #[doc = $text]
        ///
        /// It belongs to the [`Ports`] that returned it: used with another participant's buffers it selects another port, or panics.
        pub struct $name<M> {
            number: usize,
            message: PhantomData<fn() -> M>,
        }

        impl<M> $name<M> {
            fn new(number: usize) -> Self {
                Self {
                    number,
                    message: PhantomData,
                }
            }

            /// The number of the port among those of its direction.
            pub fn number(self) -> usize {
                self.number
            }
        }

        // Implemented by hand: a derive would require the same trait of the message.
        impl<M> Clone for $name<M> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<M> Copy for $name<M> {}

        impl<M> fmt::Debug for $name<M> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}({})", stringify!($name), self.number)
            }
        }
    };
}

handle!(InputPort, "An input that carries `M`.");
handle!(OutputPort, "An output that carries `M`.");

impl<M: Message> Index<InputPort<M>> for Inputs {
    type Output = M;
    fn index(&self, port: InputPort<M>) -> &M {
        self.get(port.number)
    }
}

impl<M: Message> IndexMut<InputPort<M>> for Inputs {
    fn index_mut(&mut self, port: InputPort<M>) -> &mut M {
        self.get_mut(port.number)
    }
}

impl<M: Message> Index<OutputPort<M>> for Outputs {
    type Output = M;
    fn index(&self, port: OutputPort<M>) -> &M {
        self.get(port.number)
    }
}

impl<M: Message> IndexMut<OutputPort<M>> for Outputs {
    fn index_mut(&mut self, port: OutputPort<M>) -> &mut M {
        self.get_mut(port.number)
    }
}
