"""Tables that papers have printed, as data for commands and pages; imports nothing else here."""
