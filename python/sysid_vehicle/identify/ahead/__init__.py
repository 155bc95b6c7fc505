"""Parameters that predict best some seconds ahead."""
