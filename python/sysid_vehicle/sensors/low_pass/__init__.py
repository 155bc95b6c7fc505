"""A low-pass in the spectra of a device."""
