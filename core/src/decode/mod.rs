//! Wire-word decoders: the same code on the device and on the PC.
