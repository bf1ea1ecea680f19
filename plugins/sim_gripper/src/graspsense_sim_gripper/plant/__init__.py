"""What moves and what is measured: the drive, friction, the contact through the pads, and the sensors."""
