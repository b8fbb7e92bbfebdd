"""What measures contacts: force curves, read and fitted."""
